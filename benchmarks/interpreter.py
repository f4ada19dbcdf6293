#!/usr/bin/env python3
"""Lines a second of the part-program interpreter, beside LinuxCNC's rs274 and a bare `re.findall`, in one run.

    .venv/bin/python benchmarks/interpreter.py [--lines N] [--repeats N] [--json]

The text is typical CAM output: `N… G1 X… Y… Z…` with an F now and then. All figures are CPU time, the best of the repeats: read
the ratios, not the lines a second. rs274 is an outside process (on PATH, or where CNCTWIN_RS274 says, see
tests/twin/programs/fanuc/rs274.py); its time includes its start and the printing of its calls. `re.findall` finds the words
and does nothing with them.
"""

import argparse
import json
import os
import random
import re
import resource
import shutil
import subprocess
import tempfile
import time
from collections.abc import Callable
from pathlib import Path

from twin.programs import interpret

WORD = re.compile(r"([A-Z])([-+]?[0-9.]+)")


def program(lines: int) -> str:
    """A text of so many blocks, the same at each run."""
    chance = random.Random(1)
    blocks = ["G21 G90 G17", "S8000 M3"]
    while len(blocks) < lines - 1:
        x, y, z = (chance.uniform(-100.0, 100.0) for _ in range(3))
        feed = " F1200" if len(blocks) % 50 == 2 else ""
        blocks.append(f"N{len(blocks)} G1 X{x:.3f} Y{y:.3f} Z{z:.3f}{feed}")
    return "\n".join([*blocks, "M30\n"])


def loops(lines: int) -> str:
    """A macro that runs about so many blocks: the long way, with expressions."""
    count = lines // 4
    return f"#1=0\nWHILE[#1LT{count}]DO1\nG1 X[#1*0.01] Y[10.*SIN[#1]] F500\n#1=#1+1\nEND1\nM30"


def cpu_s(work: Callable[[], object], repeats: int) -> float:
    """Best CPU time of a piece of work, s."""
    best = float("inf")
    for _ in range(repeats):
        begin = time.process_time()
        work()
        best = min(best, time.process_time() - begin)
    return best


def rs274_root() -> Path | None:
    """The folder into which the package was unpacked, or that the program on PATH belongs to."""
    named = os.environ.get("CNCTWIN_RS274") or shutil.which("rs274")
    if not named:
        return None
    path = Path(named)
    return path if path.is_dir() else path.resolve().parent.parent.parent


def rs274_s(text: str, repeats: int) -> float | None:
    """Best CPU time of rs274 for that text, s; None where there is none or it does not come to the end."""
    root = rs274_root()
    if root is None:
        return None
    libraries = f"{root}/usr/lib:{root}/usr/lib/x86_64-linux-gnu:{os.environ.get('LD_LIBRARY_PATH', '')}"
    best = float("inf")
    with tempfile.TemporaryDirectory() as folder:
        source, tools = Path(folder, "program.ngc"), Path(folder, "tool.tbl")
        source.write_text(text)
        tools.write_text("T1 P1 D0.2\n")
        for _ in range(repeats):
            before = resource.getrusage(resource.RUSAGE_CHILDREN)
            done = subprocess.run(
                [str(root / "usr/bin/rs274"), "-g", "-t", str(tools), "-v", f"{folder}/rs274.var", str(source)],
                env={**os.environ, "LD_LIBRARY_PATH": libraries},
                capture_output=True,
                check=False,
            )
            after = resource.getrusage(resource.RUSAGE_CHILDREN)
            if b"PROGRAM_END" not in done.stdout:
                return None
            best = min(best, after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime)
    return best


def measure(lines: int, repeats: int) -> dict[str, float | None]:
    """Lines a second of CPU of each; None = not on this machine."""
    text, macro = program(lines), loops(lines)
    split = text.split("\n")
    times = {
        "ours": cpu_s(lambda: interpret(text), repeats),
        "re.findall": cpu_s(lambda: [WORD.findall(line) for line in split], repeats),
        "rs274": rs274_s(text, repeats),
        "ours, macro loop": cpu_s(lambda: interpret(macro), repeats),
    }
    return {name: None if seconds is None else lines / seconds for name, seconds in times.items()}


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--lines", type=int, default=100_000)
    parser.add_argument("--repeats", type=int, default=3)
    parser.add_argument("--json", action="store_true")
    given = parser.parse_args()
    found = measure(given.lines, given.repeats)
    if given.json:
        print(json.dumps(found))
        return
    ours = found["ours"]
    assert ours is not None
    print(f"{'':18}{'lines/s of CPU':>16}{'ours / it':>12}")
    for name, rate in found.items():
        print(f"{name:18}" + ("     not on this machine" if rate is None else f"{rate:16,.0f}{ours / rate:12.2f}"))


if __name__ == "__main__":
    main()
