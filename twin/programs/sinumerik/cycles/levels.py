"""The heights of a cycle along the tool, and the moves between them.

The tool goes from the retraction plane RTP to the reference plane RFP, brought forward by the safety clearance SDIS, and from
there to the depth: DP absolute, or DPR from the reference plane, which goes first where both are given.
"""

from typing import NamedTuple

from twin.programs.canonical import Dwell
from twin.programs.refusal import RefusedError
from twin.programs.sinumerik import motion
from twin.programs.sinumerik.cycles.arguments import Arguments
from twin.programs.sinumerik.state import State


class Levels(NamedTuple):
    """Program coordinates along the normal of the plane, mm. down: -1 where the tool goes towards smaller ones."""

    back: float
    surface: float
    start: float
    depth: float
    down: float


def levels(state: State, given: Arguments) -> Levels:
    """The heights of a call. RefusedError where the depth is not below the reference plane, seen from the retraction plane."""
    state.frames.arc_scale(state.plane, given.cycle)
    for name in ("RTP", "RFP"):
        if not given.has(name):
            raise RefusedError(f"{given.cycle} {name}", "is needed")
    back, face = given.length("RTP"), given.length("RFP")
    relative = given.size("DPR") if given.has("DPR") else 0.0
    if relative == 0.0 and not given.has("DP"):
        raise RefusedError(f"{given.cycle} DP", "is needed: the depth")
    if relative > 0.0 and back == face:
        raise RefusedError(
            f"{given.cycle} DPR", "needs a retraction plane beyond the reference plane, which says where down is (61101)"
        )
    down = -1.0 if back > face or (back == face and given.length("DP") < face) else 1.0
    bottom = face + down * relative if relative > 0.0 else given.length("DP")
    if (bottom - face) * down < 0.0:
        raise RefusedError(f"{given.cycle} DP", f"the depth {bottom:g} is not below the reference plane {face:g} (61101)")
    return Levels(back, face, face - down * given.size("SDIS"), bottom, down)


def to(state: State, height: float, cuts: bool = False) -> None:
    """Go along the tool to a height in program coordinates."""
    program = list(state.frames.to_program(state.position))
    if program[state.normal] == height:
        return
    program[state.normal] = height
    if state.normal == motion.Z:
        state.take_length()
    end = state.checked(state.frames.to_machine(tuple(program)))
    if cuts:
        motion.linear(state, end)
    else:
        motion.rapid(state, end)


def fed(state: State, height: float, feed: float | None) -> None:
    """Cut along the tool with a feed of the cycle's own (mm/min or mm/rev, as F), None or 0: that in force."""
    state.block_feed = feed or None
    to(state, height, cuts=True)
    state.block_feed = None


def pause_of(given: Arguments, name: str = "DTB") -> float:
    """The pause of a call; the tens of _AMODE can say that its figure counts revolutions."""
    time = given.number(name)
    return -abs(time) if given.whole("_AMODE", 0, 999_999_999) // 10 % 10 == 2 else time


def pause(state: State, time: float) -> None:
    """A dwell: seconds, negative in revolutions of the spindle."""
    if time < 0.0:
        if state.rpm <= 0.0:
            raise RefusedError("", "a pause in revolutions needs a speed; write S")
        time = -time * 60.0 / state.rpm
    if time > 0.0:
        state.emit(Dwell(state.line, time, state.program))
