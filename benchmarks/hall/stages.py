"""The stages in which the time goes, from samples of the running processors by py-spy (MIT), sorted by the files they were in.

Only the thread that holds the interpreter's lock is sampled, since one that waits for it looks busy too. The CPU time that is
left, by the kernel's count, went into system calls and compiled code without the lock.
"""

import re
import shutil
import subprocess
from collections import Counter
from pathlib import Path

from benchmarks.hall.trial import Running

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
_SHARED = ("contract", "sample", "config", "actions", "alarms")
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
            return "folding: rows, order, ledger" if processor[1] in _SHARED else f"fold: {processor[1]}"
    return "other"


def profiled(running: Running, folder: Path, spent: dict[str, float], program: str = "") -> dict[str, dict[str, float]]:
    """Sample the processors for 15 s and return the share of each stage, the largest first.

    spent: what the processors took before they were sampled, cores and µs a machine-message, which is split here
    """
    spy = program or shutil.which("py-spy")
    if not spy:
        raise SystemExit("py-spy is not installed; pip install py-spy, or give the program with --py-spy")
    counts: Counter[str] = Counter()
    for index, child in enumerate(running.processors):
        file = folder / f"stacks-{index}.txt"
        sampling = ("-d", str(SECONDS), "-r", str(RATE_HZ), "--gil", "-f", "raw", "-F", "-o", str(file))
        done = subprocess.run(
            [spy, "record", "-p", str(child.pid), *sampling], capture_output=True, text=True, check=False, timeout=300
        )
        if done.returncode or not file.exists():
            raise SystemExit(f"py-spy failed: {' '.join(done.stderr.strip().splitlines()[-1:])}")
        for stack, _, count in (entry.rpartition(" ") for entry in file.read_text().splitlines()):
            counts[stage_of(stack)] += int(count)
    with_lock = {stage: count / RATE_HZ / SECONDS for stage, count in counts.items()}
    with_lock["without the lock"] = max(0.0, spent["cores"] - sum(with_lock.values()))
    total = sum(with_lock.values()) or 1.0
    return {
        stage: {"pct": round(100.0 * cores / total, 1), "us_a_message": round(spent["us_a_message"] * cores / total, 1)}
        for stage, cores in sorted(with_lock.items(), key=lambda entry: -entry[1])
    }
