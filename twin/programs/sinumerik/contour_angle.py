"""ANG=: a straight line by its angle. With one axis of the plane the other follows; by itself the next line, with its end and its
own angle, tells where the two cross ("Fundamentals", chapter "Contour definitions")."""

import math
from typing import Final

from twin.programs.canonical import Position
from twin.programs.planes import PLANES
from twin.programs.refusal import RefusedError
from twin.programs.sinumerik import corners
from twin.programs.sinumerik.motion import linear, rapid, target
from twin.programs.sinumerik.state import PendingAngle, State
from twin.programs.sinumerik.words import Words

PARALLEL: Final = 1e-9


def angled(state: State, words: Words) -> bool:
    """Move by ANG= of this block, or keep it for the next; False where the block has none and is a motion of its own."""
    pending = state.pending_angle
    if "ANG" not in words.values:
        if pending is not None:
            raise RefusedError(pending.text, "the line behind it needs its end and its own ANG=")
        return False
    given = words.values["ANG"]
    mode = state.modal["motion"]
    if mode not in ("G0", "G1"):
        raise RefusedError(given.text, f"belongs to a straight line, not to {mode}")
    first, second, _ = PLANES[state.plane]
    names = [state.axes[axis].upper() for axis in (first, second)]
    many = sum(name in words.values for name in names)
    if pending is not None:
        crossed(state, words, pending, many)
        return True
    if many == 2:
        raise RefusedError(given.text, "both axes of the plane are given; leave one out")
    corner = corners.wanted(state, words)
    start, line = state.position, state.line
    if many == 0:
        if corner is not None:
            raise RefusedError(given.text, "a corner here is not read; write the end of the line")
        state.pending_angle = PendingAngle(given.number, state.frames.to_program(start), line, given.text)
        return True
    end = target(state, words)
    put(state, completed(state, words, end, given.number))
    if corner is not None:
        corners.begin(state, corner, start)
    return True


def completed(state: State, words: Words, end: Position, angle_deg: float) -> Position:
    """The end of the line, with the axis of the plane that the block leaves out."""
    first, second, _ = PLANES[state.plane]
    now, program = state.frames.to_program(state.position), list(state.frames.to_program(end))
    across, up = math.cos(math.radians(angle_deg)), math.sin(math.radians(angle_deg))
    if state.axes[first].upper() in words.values:
        if abs(across) < PARALLEL:
            raise RefusedError(words.values["ANG"].text, f"a line at this angle does not change {state.axes[first].upper()}")
        program[second] = now[second] + (program[first] - now[first]) * up / across
    else:
        if abs(up) < PARALLEL:
            raise RefusedError(words.values["ANG"].text, f"a line at this angle does not change {state.axes[second].upper()}")
        program[first] = now[first] + (program[second] - now[second]) * across / up
    return state.checked(state.frames.to_machine(tuple(program)))


def crossed(state: State, words: Words, pending: PendingAngle, many: int) -> None:
    """Two lines: to where they cross, then to the end of this block."""
    given = words.values["ANG"]
    if many != 2:
        raise RefusedError(given.text, "the second line needs both axes of the plane")
    state.pending_angle = None
    first, second, _ = PLANES[state.plane]
    end = target(state, words)
    start, last = pending.start, state.frames.to_program(end)
    one, other = math.radians(pending.angle_deg), math.radians(given.number)
    cross = math.sin(other - one)
    if abs(cross) < PARALLEL:
        raise RefusedError(given.text, "the two lines are parallel")
    gap = (last[first] - start[first], last[second] - start[second])
    reach = (gap[0] * math.sin(other) - gap[1] * math.cos(other)) / cross
    middle = list(start)
    middle[first] += reach * math.cos(one)
    middle[second] += reach * math.sin(one)
    line, state.line = state.line, pending.line
    put(state, state.checked(state.frames.to_machine(tuple(middle))))
    state.line = line
    before = state.position
    put(state, end)
    corner = corners.wanted(state, words)
    if corner is not None:
        corners.begin(state, corner, before)


def put(state: State, end: Position) -> None:
    if state.modal["motion"] == "G0":
        rapid(state, end)
    else:
        linear(state, end)
