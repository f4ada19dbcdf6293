"""Where the time goes: samples of the running processors by py-spy (MIT), put in stages by the files that they were in."""

import re
import shutil
import subprocess
import time
from collections import Counter
from pathlib import Path

from benchmarks.hall.trial import Running
from benchmarks.hall.usage import usage_of

SECONDS, RATE_HZ = 15, 200
FRAME = re.compile(r"\(([^()]+?):\d+\)$")
# The innermost frame that is known says the stage: first the longest path.
STAGES = (
    ("processors/running/snapshot", "snapshot"),
    ("processors/running/emission", "publish: outputs compared"),
    ("processors/running/", "folding: rows, order, ledger"),
    ("processors/mirror", "fold: mirror"),
    ("processors/plain_topic", "fold: mirror"),
    ("processors/historian", "fold: historian"),
    ("cnctwin/memory/", "store"),
    ("cnctwin/running/", "folding: rows, order, ledger"),
    ("sparkplug/certificate", "encode"),
    ("sparkplug/edge_session", "encode"),
    ("sparkplug/edge_node", "publish"),
    ("sparkplug/transport/", "transport"),
    ("sparkplug/connection", "transport"),
    ("sparkplug/paho_client", "transport"),
    ("sparkplug/host.py", "transport"),
    ("sparkplug/", "decode"),
    ("paho/", "transport"),
)
_PROCESSOR = re.compile(r"(?:^|/)processors/([a-z_]+)(?:/|\.py)")


def stage_of(stack: str) -> str:
    """Return the stage of a stack, outermost frame first: that of the innermost frame whose file is known.

    >>> stage_of("run (processors/running/worker.py:80);step (processors/thermal.py:90);sqrt (numpy/x.py:3)")
    'fold: thermal'
    """
    for frame in reversed(stack.split(";")):
        found = FRAME.search(frame)
        if found is None:
            continue
        file = found[1]
        for part, stage in STAGES:
            if part in file:
                return stage
        processor = _PROCESSOR.search(file)
        if processor is not None:
            return f"fold: {processor[1]}"
    return "other"


def profiled(running: Running, folder: Path, program: str = "") -> dict[str, dict[str, float]]:
    """Sample the processors for 15 s and return the share of each stage, and µs a machine-message, the largest first."""
    spy = program or shutil.which("py-spy")
    if not spy:
        raise SystemExit("py-spy is not installed; pip install py-spy, or give the program with --py-spy")
    counts: Counter[str] = Counter()
    spent_s = 0.0
    running.open(time.time(), time.time() + 10 * SECONDS)
    tallied = 0
    for index, child in enumerate(running.processors):
        file = folder / f"stacks-{index}.txt"
        assert child.pid is not None
        before_s, sent = usage_of(child.pid).cpu_s, _sent(running)
        command = [
            spy,
            "record",
            "-p",
            str(child.pid),
            "-d",
            str(SECONDS),
            "-r",
            str(RATE_HZ),
            "-f",
            "raw",
            "-F",
            "-o",
            str(file),
        ]
        done = subprocess.run(command, capture_output=True, text=True, check=False)
        if done.returncode or not file.exists():
            raise SystemExit(f"py-spy failed: {done.stderr.strip().splitlines()[-1:]}")
        spent_s += usage_of(child.pid).cpu_s - before_s
        tallied += _sent(running) - sent
        for stack, _, count in (entry.rpartition(" ") for entry in file.read_text().splitlines()):
            counts[stage_of(stack)] += int(count)
    total, us = sum(counts.values()) or 1, spent_s / max(1, tallied) * 1e6 * len(running.processors)
    return {
        stage: {"pct": round(100.0 * count / total, 1), "us_a_message": round(us * count / total, 1)}
        for stage, count in counts.most_common()
    }


def _sent(running: Running) -> int:
    return sum(tally.sent for tally in running.tallies()[0])
