"""CYCLE84, rigid tapping (G331, G332), and CYCLE840, tapping with a compensating chuck (G33 with an encoder, G63 without).

The lead comes from PIT, or from MPIT, the size of a metric thread; its sign is the hand of the thread.
"""

import math
from collections.abc import Mapping
from typing import Final

from twin.programs.canonical import Linear
from twin.programs.refusal import RefusedError
from twin.programs.sinumerik import motion
from twin.programs.sinumerik.cycles.arguments import Arguments
from twin.programs.sinumerik.cycles.levels import Levels, levels, pause, to
from twin.programs.sinumerik.spindle import DIRECTIONS, orient, turn
from twin.programs.sinumerik.state import State
from twin.programs.spindle_speed import RPM_MAX

METRIC: Final[Mapping[int, float]] = {
    **{3: 0.5, 4: 0.7, 5: 0.8, 6: 1.0, 8: 1.25, 10: 1.5, 12: 1.75, 14: 2.0, 16: 2.0, 18: 2.5, 20: 2.5, 22: 2.5, 24: 3.0, 27: 3.0},
    **{30: 3.5, 33: 3.5, 36: 4.0, 39: 4.0, 42: 4.5, 45: 4.5, 48: 5.0},
}
"""Leads of the regular metric threads (DIN 13), mm, by their size."""
ALREADY_MM: Final = 25.4


def lead(given: Arguments) -> float:
    """The lead with its sign, mm a revolution; 0 where neither PIT nor MPIT is given."""
    unit = given.whole("_PITA", 0, 4)
    if unit == 4:
        raise RefusedError(f"{given.cycle} _PITA", "a lead in modules is not read")
    if given.number("PIT") != 0.0:
        value = given.number("PIT")
        if unit == 2:
            return ALREADY_MM / value
        return value * ALREADY_MM if unit == 3 else given.length("PIT")
    size = given.number("MPIT")
    if size == 0.0:
        return 0.0
    found = METRIC.get(int(abs(size))) if size.is_integer() else None
    if found is None:
        raise RefusedError(f"{given.cycle} MPIT", f"M{abs(size):g} is no regular thread from M3 to M48; write the lead as PIT")
    return math.copysign(found, size)


def afterwards(state: State, given: Arguments) -> None:
    """SDAC: the spindle turns as M3, M4 or M5 say."""
    code = given.whole("SDAC", 0, 5)
    if code not in (0, 3, 4, 5):
        raise RefusedError(f"{given.cycle} SDAC", "is 3, 4 or 5: M3, M4 or M5 (61102)")
    if code:
        turn(state, DIRECTIONS[code])


def tied(state: State, height: float, per_rev_mm: float) -> None:
    """Move along the tool with the spindle."""
    program = list(state.frames.to_program(state.position))
    program[state.normal] = height
    end = state.checked(state.frames.to_machine(tuple(program)))
    motion.add(state, Linear(state.line, end, per_rev_mm * state.rpm, per_rev_mm, state.program))


def rigid(state: State, given: Arguments) -> None:
    """CYCLE84: orient, in with SST, pause, out with SST1; in strokes of _DAM where _VARI is 1 (chip breaking) or 2 (removal)."""
    heights = levels(state, given)
    pitch = lead(given)
    if pitch == 0.0:
        raise RefusedError("CYCLE84 PIT", "is needed: the lead, or the size MPIT")
    before = state.rpm
    speed = given.number("SST") or before
    back = given.number("SST1") or speed
    if not (0.0 < speed <= RPM_MAX and 0.0 < back <= RPM_MAX):
        raise RefusedError("CYCLE84 SST", "is needed: the speed of tapping, more than 0")
    hand = 1 if pitch > 0.0 else -1
    to(state, heights.start)
    orient(state)
    way = given.whole("_VARI", 0, 9_999) % 10
    for place, depth in enumerate(tap_depths(state, given, heights, way)):
        if place:
            turn_at(state, back, -hand)
            height = heights.start if way == 2 else state.frames.to_program(state.position)[state.normal]
            height = height if way == 2 else height - heights.down * (given.size("_VRT") or 1.0)
            tied(state, height, abs(pitch))
        turn_at(state, speed, hand)
        tied(state, depth, abs(pitch))
    pause(state, given.number("DTB"))
    turn_at(state, back, -hand)
    tied(state, heights.start, abs(pitch))
    turn(state, 0)
    state.rpm = before
    to(state, heights.back)
    afterwards(state, given)


def turn_at(state: State, speed: float, direction: int) -> None:
    state.rpm = speed
    turn(state, direction)


def tap_depths(state: State, given: Arguments, heights: Levels, way: int) -> list[float]:
    """The heights of the strokes: one, or steps of _DAM."""
    if way not in (0, 1, 2):
        raise RefusedError("CYCLE84 _VARI", "is 0 in one stroke, 1 with chip breaking, 2 with chip removal")
    total = abs(heights.depth - heights.surface)
    step = given.size("_DAM")
    if way == 0 or step == 0.0 or total == 0.0:
        return [heights.depth]
    many = math.ceil(total / step - 1e-9)
    if many > state.settings.pecks_max:
        raise RefusedError("CYCLE84 _DAM", f"makes more than {state.settings.pecks_max} strokes")
    return [*(heights.surface + heights.down * step * (place + 1) for place in range(many - 1)), heights.depth]


def with_chuck(state: State, given: Arguments) -> None:
    """CYCLE840: in by lead and speed, or by F without an encoder (ENC = 1); the spindle turns back, and out the same way."""
    heights = levels(state, given)
    if state.spindle_direction == 0 or state.rpm <= 0.0:
        raise RefusedError("CYCLE840", "needs a turning spindle; write S and M3 before")
    pitch = abs(lead(given))
    feed = state.feed_word / (1.0 if state.modal["feed"] == "G95" else state.rpm)
    by_feed = given.whole("ENC", 0, 99) == 1 or pitch == 0.0
    per_rev = feed if by_feed else pitch
    if per_rev <= 0.0:
        raise RefusedError("CYCLE840 PIT", "is needed: the lead, the size MPIT, or F = speed times lead")
    code = given.whole("SDR", 0, 4)
    if code not in (0, 3, 4):
        raise RefusedError("CYCLE840 SDR", "is 0, 3 or 4: turned back by itself, M3 or M4 (61102)")
    to(state, heights.start)
    tied(state, heights.depth, per_rev)
    pause(state, given.number("DTB"))
    turn(state, DIRECTIONS[code] if code else -state.spindle_direction)
    tied(state, heights.start, per_rev)
    to(state, heights.back)
    if code == 0:
        turn(state, -state.spindle_direction)
    else:
        afterwards(state, given)
