"""The activity of a machine at a moment, in the time elements of ISO 22400-2: production, setup, delay, down; or not known.

The execution state, its reasons and the runs are those of the processor `events`: one definition, folded here once more.
"""

from enum import StrEnum
from typing import NamedTuple

from processors.events.execution import ACTIVE, MODE, NO_STOP, NOT_TOLD, PROGRAM, text
from processors.events.processor import State as Runs
from processors.sample import Sample
from sparkplug.quality import Quality

NO_DATA, NO_PROGRAM = "no data", "no program"


class Kind(StrEnum):
    """The time element that a moment counts to."""

    PRODUCTION = "production"  # APT
    SETUP = "setup"  # AUST
    DELAY = "delay"  # ADET
    DOWN = "down"  # ADOT
    UNKNOWN = "unknown"


class Doing(NamedTuple):
    """The time element, and for what reason the machine does not produce; '' while it does."""

    kind: Kind
    reason: str


UNKNOWN = Doing(Kind.UNKNOWN, NO_DATA)
PRODUCING = Doing(Kind.PRODUCTION, "")


def doing(runs: Runs, sample: Sample, modes: tuple[str, ...]) -> Doing:
    """Return what the machine does as of this sample, by the state of `events` behind it."""
    state = runs.execution
    if state is None or not runs.is_known or runs.is_blind:
        return UNKNOWN
    mode = text(sample.row, MODE)
    if state == ACTIVE and not runs.is_held:
        return PRODUCING if mode is None or mode in modes else Doing(Kind.SETUP, f"mode {mode}")
    reason = NOT_TOLD if runs.reason == NO_STOP else runs.reason
    if reason.startswith("alarm"):
        return Doing(Kind.DOWN, reason)
    if mode is not None and mode not in modes:
        return Doing(Kind.SETUP, f"mode {mode}")
    if reason == NOT_TOLD and _has_no_program(sample):
        return Doing(Kind.DELAY, NO_PROGRAM)
    return Doing(Kind.DELAY, reason)


def _has_no_program(sample: Sample) -> bool:
    """Return True if the control says that no program is chosen; one that says nothing of it may have one."""
    reading = sample.row.get(PROGRAM)
    return reading is not None and reading.quality is Quality.GOOD and reading.value == ""
