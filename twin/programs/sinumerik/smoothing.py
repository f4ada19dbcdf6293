"""Exact stop and continuous path, and the tolerance that goes with them: G60, G64, G641 to G645, ADIS, CTOL, OTOL, CYCLE832.

A contour tolerance comes from CYCLE832 or CTOL; without one, G641 leaves the path by at most its rounding distance ADIS, which is
then put out as the tolerance. G642 to G645 without CTOL keep to figures of the machine: none is put out.
"""

from typing import Final

from twin.programs.canonical import ExactStop, FeedForward, JerkLimit, Tolerance
from twin.programs.refusal import RefusedError
from twin.programs.sinumerik.language.functions import Value, as_number, as_whole
from twin.programs.sinumerik.state import State
from twin.programs.sinumerik.words import Words

OFF: Final = -1.0
"""CTOL=-1 gives the tolerance back to the machine."""
MODE_MAX: Final = 9_999_999


def modes(state: State, words: Words) -> None:
    """The words of a block about exact stops, tolerance, jerk and feed-forward."""
    before = tolerance(state)
    for name in ("ADIS", "ADISPOS"):
        if name in words.values:
            state.distance_mm[name] = at_least_zero(words, name) * state.unit_mm
    if "CTOL" in words.values:
        value = words.number("CTOL")
        state.tolerance_mm = None if value == OFF else at_least_zero(words, "CTOL") * state.unit_mm
    if "OTOL" in words.values:
        value = words.number("OTOL")
        state.rotary_tolerance_deg = None if value == OFF else at_least_zero(words, "OTOL")
    if "path" in words.codes:
        path(state, words.codes["path"])
    changed(state, before)
    for group, code in words.codes.items():
        if group == "jerk":
            state.modal[group] = code
            state.emit(JerkLimit(state.line, code == "SOFT", state.program))
        elif group == "feed_forward":
            state.modal[group] = code
            state.emit(FeedForward(state.line, code == "FFWON", state.program))


def at_least_zero(words: Words, name: str) -> float:
    value = words.number(name)
    if value < 0.0:
        raise RefusedError(words.values[name].text, "is at least 0")
    return value


def path(state: State, code: str) -> None:
    """From exact stop to continuous path and back."""
    stops = code == "G60"
    if stops != (state.modal["path"] == "G60"):
        state.emit(ExactStop(state.line, stops, state.program))
    state.modal["path"] = code


def tolerance(state: State) -> tuple[float | None, float | None]:
    """The tolerance in force: of the contour, mm, and of rotary axes, degrees."""
    contour = state.tolerance_mm
    if contour is None and state.modal["path"] == "G641" and state.distance_mm.get("ADIS", 0.0) > 0.0:
        contour = state.distance_mm["ADIS"]
    return contour, state.rotary_tolerance_deg


def changed(state: State, before: tuple[float | None, float | None]) -> None:
    now = tolerance(state)
    if now != before:
        state.emit(Tolerance(state.line, now[0], now[1], state.program))


def high_speed(state: State, given: list[Value | None]) -> None:
    """CYCLE832(tolerance, mode, ...): continuous path with that tolerance; without figures, or with mode 0, the machine's.

    The last digit of the mode is the kind of cut: 0 off, 1 finishing, 2 semi-finishing, 3 roughing, 4 smooth finishing. With 1 in
    the tens, the third figure is the tolerance of rotary axes. What else the machine's builder has it switch (CUST_832: SOFT or
    BRISK, FFWON, a compressor) is not known: the jerk limit stays as it was.
    """
    if any(isinstance(value, str) for value in given):
        raise RefusedError("CYCLE832", "its figures are numbers")
    figures = [0.0 if value is None else as_number(value, "CYCLE832") for value in given]
    contour = figures[0] if figures else 0.0
    mode = as_whole(figures[1], "CYCLE832") if len(figures) > 1 else 1
    if contour < 0.0 or not 0 <= mode <= MODE_MAX:
        raise RefusedError("CYCLE832", "its tolerance is at least 0, its mode a whole number such as 1, 2, 3")
    before = tolerance(state)
    is_on = contour > 0.0 and mode % 10 != 0
    state.tolerance_mm = contour * state.unit_mm if is_on else None
    rotary = figures[2] if len(figures) > 2 and mode // 10 % 10 == 1 else 0.0
    state.rotary_tolerance_deg = rotary if is_on and rotary > 0.0 else None
    if is_on:
        path(state, "G645")
    changed(state, before)
