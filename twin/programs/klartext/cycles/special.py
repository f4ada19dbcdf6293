"""Cycles 9, 12, 13 and 32: dwell, program call, oriented stop, tolerance; FUNCTION DWELL and FUNCTION RESET TCPM."""

import re
from collections.abc import Callable
from typing import Final

from twin.programs.canonical import Dwell, Tolerance
from twin.programs.klartext import spindle
from twin.programs.klartext.cycles.definition import SECONDS_MAX, Definition
from twin.programs.klartext.numbers import VALUE, value
from twin.programs.klartext.source import Source
from twin.programs.klartext.state import State
from twin.programs.refusal import RefusedError

SECONDS: Final = re.compile(rf"[ \t]*+(?:[A-Z. ]*?)[ \t]*+({VALUE})[ \t]*+")
TOLERANCE: Final = re.compile(rf"[ \t]*+T[ \t]*+({VALUE})[ \t]*+")
MODE: Final = re.compile(rf"[ \t]*+HSC-MODE[ \t]*+:[ \t]*+([01])[ \t]*+(?:TA[ \t]*+({VALUE}))?+[ \t]*+")
PASSED_OVER: Final = ("FUNCTION MODE MILL", "FUNCTION RESET TCPM", "FUNCTION FEED DWELL RESET", "FUNCTION S-PULSE RESET")


def dwell(state: State, source: Source, begin: int) -> None:
    """9.1 DWELL 1.5."""
    match = SECONDS.fullmatch(source.body, begin)
    seconds = None if match is None else value(match.group(1), match.group(1))(state.variables)
    if seconds is None or not 0.0 <= seconds <= SECONDS_MAX:
        raise RefusedError("CYCL DEF 9", f"needs its time in s, from 0 to {SECONDS_MAX:g}")
    state.emit(Dwell(state.line, seconds, state.program))


def orientation(state: State, source: Source, begin: int) -> None:
    """13.1 ANGLE 180."""
    spindle.orient(state)


def tolerance(state: State, source: Source, begin: int) -> None:
    """32.1 T0.05; without a value the machine's own is back."""
    match = TOLERANCE.fullmatch(source.body, begin)
    if match is None and source.body[begin:].strip():
        raise RefusedError(source.written[begin:].strip()[:24], "here stands the tolerance; write T0.02")
    state.tolerance_mm = None
    if match is not None:
        state.tolerance_mm = value(match.group(1), match.group(1))(state.variables) * state.unit_mm
        if state.tolerance_mm < 0.0:
            raise RefusedError("T", "a tolerance is at least 0")
        # T0 is the machine's own tolerance as well.
        state.tolerance_mm = state.tolerance_mm or None
    state.emit(Tolerance(state.line, state.tolerance_mm, None, state.program))


def tolerance_mode(state: State, source: Source, begin: int) -> None:
    """32.2 HSC-MODE:0 TA0.5: TA is the tolerance of rotary axes; the mode changes no path that is modelled."""
    rest = source.body[begin:].strip()
    match = MODE.fullmatch(source.body, begin)
    if match is None and rest:
        raise RefusedError(source.written[begin:].strip()[:24], "here stands the mode; write HSC-MODE:0 TA0.5")
    if match is not None and match.group(2) is not None:
        degrees = value(match.group(2), match.group(2))(state.variables)
        if degrees < 0.0:
            raise RefusedError("TA", "a tolerance is at least 0")
        state.emit(Tolerance(state.line, state.tolerance_mm, degrees, state.program))


def program_as_cycle(state: State, source: Source, begin: int) -> None:
    """12.1 PGM NAME: a program that CYCL CALL runs."""
    name = source.written[begin:].strip()
    name = name[3:].strip() if name[:3].upper() == "PGM" else name
    state.flow.find_program(name, name)
    state.cycle = Definition(12, {}, state.unit_mm, state.feed_unit, name=name)
    state.calls_cycle = False


def function(source: Source) -> Callable[[State], None]:
    """`FUNCTION DWELL TIME 0.5`, and those that only switch something back; all others are refused by name."""
    body = source.body
    if body.startswith(PASSED_OVER):
        return lambda state: None
    if body.startswith("FUNCTION DWELL TIME"):
        return lambda state: dwell(state, source, len("FUNCTION DWELL TIME"))
    raise RefusedError(" ".join(body.split()[:2]), "is not read")
