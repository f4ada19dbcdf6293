"""The twin's expectations of the NC programs that came with the recordings: feed, speed and time of each line, and no load.

The machine is `hurco.toml`, fitted on plates 13, 14 and 15. The control counts the lines of a text from 0. Nothing is expected of
a line in which the spindle is told to stop: it runs down for seconds.
"""

from functools import cache
from pathlib import Path

import numpy as np

from benchmarks.programs.plates import PLATES
from benchmarks.recorded.parts import Floats, Part
from twin.anomaly.parts.quantity import TURNS_RPM_MIN
from twin.anomaly.parts.replay import EXPECTED
from twin.expected.expectation import Expectation
from twin.expected.lines import Numbering
from twin.expected.making import expectation_of
from twin.machine import machine_from_toml

MACHINE = Path(__file__).with_name("hurco.toml")
FILES = {
    **{f"PLATE-{int(name)}": f"NIST_MTC_CRADA_PLATE-{int(name)}.NC" for name in PLATES},
    "COVER OP3": "NIST_MTC_CRADA_COVER_REV-A.NC",
    "BOX OP1": "BOX_OP1.NC",
}
"""Label → the program that came with it; BOX_OP1 is the text of box 03 alone, PLATE-4 what was left of plate 4."""


@cache
def expectation(folder: Path, label: str) -> Expectation | None:
    """Return the expectation of the program of a label; None where no program of it is at hand."""
    if label not in FILES:
        return None
    machine = machine_from_toml(MACHINE.read_text(encoding="utf-8"), MACHINE.name)
    text = (folder / "nist" / "nc" / FILES[label]).read_text(encoding="utf-8")
    return expectation_of(machine, text, name=label, numbering=Numbering.FROM_0)


def expected_rows(folder: Path, part: Part) -> Floats:
    """Return the expectation (T, 6) of the program that the label of a part names, NaN where there is none."""
    rows = np.full((part.ticks, len(EXPECTED)), np.nan)
    program = expectation(folder, part.label)
    if program is None:
        return rows
    for line in np.unique(part.line[part.line >= 0]).tolist():
        one = program.at(line)
        if one is not None and one.feed_mm_min > 0.0 and one.spindle_rpm >= TURNS_RPM_MIN:
            rows[part.line == line] = [np.nan if getattr(one, name) is None else getattr(one, name) for name in EXPECTED]
    return rows
