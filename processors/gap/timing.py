"""The lengths that are timed on a machine: tool changes, and the sections of a program between them, as they end.

A section begins at cycle start or when a tool change ends, and ends when the next one begins or the program does. One that was
held, interrupted, resumed, or run with an override off 100 % is left out, and so is everything around a hole in the data.
Lengths are between the stamps of what the control says, not between the moments at which it came: a message that was late takes
nothing longer.
"""

from dataclasses import dataclass, replace
from typing import NamedTuple

from processors.gap.signals import PROGRAM_TIME, TOOL_CHANGE
from processors.gap.watch import EXECUTION, PROGRAM, PROGRAM_CHARACTERS_MAX, TURNING_RPM_MIN, ToolChange, Watch
from processors.sample import Sample, SampleKind
from processors.tool_change_detector.context import tool_change_context
from sparkplug.quality import Quality

OVERRIDES = ("feed_override_pct", "rapid_override_pct")
OVERRIDE_OFF_PCT = 0.5
CHANGE_S_MAX, SECTION_S_MIN, SECTION_S_MAX = 600.0, 2.0, 7200.0
CHANGE_WEIGHT_S = 30.0
"""A tool change counts like so many seconds of another signal."""
DONE_MAX = 16
SECTIONS_MAX = 40
_ACTIVE = "ACTIVE"
_RESUMED_FROM = frozenset({"FEED_HOLD", "INTERRUPTED", "OPTIONAL_STOP", "PROGRAM_STOPPED"})


class Timed(NamedTuple):
    """A tool change or a section that has ended: its signal and regime, its length, and as how many seconds it counts.

    is_stopped: the spindle stood when the tool change began; program, section: which section it was
    """

    signal: str
    regime: str
    seconds: float
    weight_s: float
    is_stopped: bool = False
    program: str = ""
    section: int = 0


@dataclass(frozen=True, slots=True)
class Timing:
    """The lengths that are being timed. A new one only where something changed.

    change_s: since when a tool is changed, None = no change, or its begin is not known; is_stopped: the spindle stood then
    program, section, section_s: what runs, its section counted from 0 and since when; None = nothing that can be timed
    execution: the last one heard; done: what has ended since the last tick
    """

    change_s: float | None = None
    is_stopped: bool = False
    program: str = ""
    section: int = 0
    section_s: float | None = None
    execution: str | None = None
    done: tuple[Timed, ...] = ()


NOTHING_TIMED = Timing()


def timed(timing: Timing, before: Watch, now: Watch, sample: Sample) -> Timing:
    """Return the timing after a sample of any kind but a tick, which took the watch from `before` to `now`."""
    if sample.kind is SampleKind.HOLE or sample.kind is SampleKind.DEATH:
        return timing if timing == NOTHING_TIMED else NOTHING_TIMED
    if now.change is not before.change:
        timing = _changing(timing, before.change, now, sample)
    if sample.kind is not SampleKind.DATA or not _HEARD.isdisjoint(sample.changed):
        timing = _running(timing, sample)
    return timing


_HEARD = frozenset({EXECUTION, PROGRAM, *OVERRIDES})


def _changing(timing: Timing, was: ToolChange, now: Watch, sample: Sample) -> Timing:
    """The timing where a tool change begins or ends."""
    at_s = tool_change_context(sample.row).since_s
    if now.change is ToolChange.ACTIVE and was is ToolChange.NONE:
        rpm, _ = sample.number("spindle_rpm")
        timing = _section_over(timing, at_s)
        is_stopped = rpm is not None and abs(rpm) < TURNING_RPM_MIN
        return replace(timing, change_s=at_s, is_stopped=is_stopped)
    if now.change is ToolChange.NONE and was is ToolChange.ACTIVE and timing.change_s is not None:
        seconds = at_s - timing.change_s
        regime = "spindle_stopped" if timing.is_stopped else "spindle_turning"
        if 0.0 < seconds < CHANGE_S_MAX:
            timing = _done(timing, Timed(TOOL_CHANGE, regime, seconds, CHANGE_WEIGHT_S, timing.is_stopped))
        goes_on = timing.program and timing.section < SECTIONS_MAX
        section_s = at_s if goes_on else None
        return replace(timing, change_s=None, section=timing.section + 1, section_s=section_s)
    return replace(timing, change_s=None, program="", section_s=None)


def _running(timing: Timing, sample: Sample) -> Timing:
    """The timing after the control said what it executes, which program, or where its overrides stand."""
    execution, program = _text(sample, EXECUTION), _text(sample, PROGRAM)[:PROGRAM_CHARACTERS_MAX]
    was = timing.execution
    if execution != was:
        timing, at_s = replace(timing, execution=execution), _said_s(sample, EXECUTION)
        if execution == _ACTIVE:
            starts = was is not None and was != "" and was not in _RESUMED_FROM and program != ""
            section_s = at_s if starts and timing.change_s is None else None
            timing = replace(timing, program=program if starts else "", section=0, section_s=section_s)
        elif execution in _RESUMED_FROM or execution == "":
            timing = replace(timing, program="", section_s=None)
        else:
            timing = replace(_section_over(timing, at_s), program="")
    elif timing.program and program != timing.program:
        timing = replace(timing, program="", section_s=None)
    if timing.section_s is not None and _is_overridden(sample):
        timing = replace(timing, section_s=None)
    return timing


def _section_over(timing: Timing, at_s: float) -> Timing:
    if timing.section_s is None:
        return timing
    seconds = at_s - timing.section_s
    timing = replace(timing, section_s=None)
    if not SECTION_S_MIN <= seconds <= SECTION_S_MAX:
        return timing
    regime = f"section {timing.section} of {timing.program}"
    return _done(timing, Timed(PROGRAM_TIME, regime, seconds, seconds, program=timing.program, section=timing.section))


def _done(timing: Timing, one: Timed) -> Timing:
    return replace(timing, done=(*timing.done, one)[-DONE_MAX:])


def _said_s(sample: Sample, name: str) -> float:
    """The time at which a signal was said to be what it is; that of the sample where it is not offered."""
    reading = sample.row.get(name)
    return sample.at_s if reading is None else reading.timestamp_ms / 1000


def _text(sample: Sample, name: str) -> str:
    """The text of a signal; empty where it is not known."""
    reading = sample.row.get(name)
    if reading is None or reading.quality is not Quality.GOOD or not isinstance(reading.value, str):
        return ""
    return reading.value.strip()


def _is_overridden(sample: Sample) -> bool:
    """Return True where an override that is offered is not at 100 %, or not known."""
    for name in OVERRIDES:
        if name in sample.row:
            override_pct, _ = sample.number(name)
            if override_pct is None or abs(override_pct - 100.0) > OVERRIDE_OFF_PCT:
                return True
    return False
