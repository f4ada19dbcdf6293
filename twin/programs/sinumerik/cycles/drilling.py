"""CYCLE81, CYCLE82, and the boring cycles CYCLE85 to CYCLE89 ("Cycles", chapter "Drilling cycles").

All begin with rapid to the reference plane brought forward by the safety clearance, and end with rapid to the retraction plane.
"""

from twin.programs.canonical import ProgramStop
from twin.programs.refusal import RefusedError
from twin.programs.sinumerik import motion
from twin.programs.sinumerik.cycles.arguments import Arguments
from twin.programs.sinumerik.cycles.levels import fed, levels, pause, pause_of, to
from twin.programs.sinumerik.spindle import DIRECTIONS, orient, turn
from twin.programs.sinumerik.state import State


def drill(state: State, given: Arguments) -> None:
    """CYCLE81 to the depth; CYCLE82 with a pause DTB there."""
    given.only_zero("_GMODE", reason="a depth by the diameter of the centring is not read")
    heights = levels(state, given)
    to(state, heights.start)
    to(state, heights.depth, cuts=True)
    pause(state, pause_of(given))
    to(state, heights.back)


def ream(state: State, given: Arguments) -> None:
    """CYCLE85: in with FFR, out to the start with RFF."""
    heights = levels(state, given)
    to(state, heights.start)
    fed(state, heights.depth, given.number("FFR") * state.feed_unit_mm)
    pause(state, pause_of(given))
    fed(state, heights.start, given.number("RFF") * state.feed_unit_mm)
    to(state, heights.back)


def started(state: State, given: Arguments) -> None:
    """SDIR: 3 and 4 are M3 and M4."""
    code = given.whole("SDIR", 0, 4)
    if code not in (0, 3, 4):
        raise RefusedError(f"{given.cycle} SDIR", "is 3 or 4: M3 or M4 (61102)")
    if code and state.spindle_direction != DIRECTIONS[code]:
        turn(state, DIRECTIONS[code])


def bore(state: State, given: Arguments) -> None:
    """CYCLE86: at the depth the spindle is oriented, and the tool leaves the wall by RPA, RPO, RPAP."""
    heights = levels(state, given)
    started(state, given)
    to(state, heights.start)
    to(state, heights.depth, cuts=True)
    pause(state, pause_of(given))
    orient(state)
    hole = state.frames.to_program(state.position)
    away = list(hole)
    first, second = (state.normal + 1) % 3, (state.normal + 2) % 3
    for axis, name in ((first, "RPA"), (second, "RPO"), (state.normal, "RPAP")):
        away[axis] += given.length(name)
    if tuple(away) != hole:
        motion.rapid(state, state.checked(state.frames.to_machine(tuple(away))))
    to(state, heights.start)
    over = list(hole)
    over[state.normal] = heights.back
    motion.rapid(state, state.checked(state.frames.to_machine(tuple(over))))


def bore_and_stop(state: State, given: Arguments) -> None:
    """CYCLE87, and CYCLE88 with a pause: at the depth spindle and program stop (M5, M0); then rapid to the retraction plane."""
    heights = levels(state, given)
    started(state, given)
    to(state, heights.start)
    to(state, heights.depth, cuts=True)
    pause(state, pause_of(given))
    turn(state, 0)
    state.emit(ProgramStop(state.line, False, state.program))
    to(state, heights.back)


def bore_back(state: State, given: Arguments) -> None:
    """CYCLE89: in and, after a pause, out to the start with the same feed."""
    heights = levels(state, given)
    to(state, heights.start)
    to(state, heights.depth, cuts=True)
    pause(state, pause_of(given))
    to(state, heights.start, cuts=True)
    to(state, heights.back)
