"""Measure what identification reaches on recordings: the figures of README and docs/how-to/identification.md.

    .venv/bin/python benchmarks/identification.py [folder of the cases]

The cases lie beside the folder of the recordings (`CNCTWIN_DATA`, else `../shared/data`). Takes about a minute.
"""

import os
import sys
import time
from pathlib import Path

import numpy as np

from twin.case import read_case
from twin.identification.identify import identify
from twin.simulator.recorded import told_of
from twin.simulator.response import respond

HEALTHY = ("case_16", "case_17", "case_18")
NEWTON_PER_VOLT = 35.1507


def emps(folder: Path) -> None:
    """The half that was not fitted, simulated from its reference alone."""
    case = read_case(folder / "emps")
    machine = identify(case).machine
    log = case.of(role="check")[0].log
    twin = respond(machine, told_of(log, machine)).columns
    position = twin["x_pos_mm"] - log["x_pos_mm"]
    torque = twin["x_torque_a"] - log["x_torque_a"]
    following = log["x_ref_mm"] - log["x_pos_mm"]
    rms = [float(np.sqrt(np.mean(values**2))) for values in (position, torque, following)]
    print(f"emps: {1000 * rms[0]:.2f} µm of {1000 * rms[2]:.0f} µm following error, {NEWTON_PER_VOLT * rms[1]:.2f} N")


def healthy(folder: Path) -> None:
    """Cells of signal and regime on runs that were not fitted, beside what runs differ by."""
    cells, above_pair, above_both = 0, 0, 0
    for name in HEALTHY:
        begin = time.perf_counter()
        rows = identify(read_case(folder / name)).gaps
        pair = [row for row in rows if row.ratio is not None and row.ratio > 1.5]
        both = [row for row in rows if row.gap > 1.5 * max(row.repeatability or 0.0, row.expected)]
        cells, above_pair, above_both = cells + len(rows), above_pair + len(pair), above_both + len(both)
        print(f"{name}: {len(rows)} cells in {time.perf_counter() - begin:.0f} s")
        for row in pair:
            print(f"  {row.run} {row.signal} {row.regime}: {row.ratio:.2f} × the pair, {row.gap / row.expected:.2f} × expected")
    print(f"within 1.5 × of the repeated pair: {cells - above_pair} of {cells} cells")
    print(f"within 1.5 × of the larger of that and of what the twin expects: {cells - above_both} of {cells} cells")


def main() -> int:
    """Print the figures; 2 where the cases are not there."""
    data = Path(os.environ.get("CNCTWIN_DATA", "../shared/data"))
    folder = Path(sys.argv[1]) if len(sys.argv) > 1 else data.parent / "cases"
    if not folder.is_dir():
        print(f"{folder}: there are no cases; name their folder", file=sys.stderr)
        return 2
    emps(folder)
    healthy(folder)
    return 0


if __name__ == "__main__":
    sys.exit(main())
