"""From the words of a path block to a canonical motion."""

import math
from typing import Final

from twin.programs.canonical import Linear, Motion, Position, Rapid
from twin.programs.klartext import compensation, corners
from twin.programs.klartext.block import Block, FeedKind
from twin.programs.klartext.state import INCH_FEED, MM_PER_INCH, Pole, State
from twin.programs.planes import PLANES
from twin.programs.refusal import RefusedError

AXES: Final = frozenset("XYZABCUVW")
CARTESIAN: Final = AXES | {f"I{letter}" for letter in AXES}
POLAR: Final = frozenset({"PR", "IPR", "PA", "IPA"})
LETTERS: Final = "XYZ"


def axis_of(state: State, name: str, text: str) -> int:
    """Index of an axis. RefusedError for one that the machine does not have."""
    letter = name[-1].lower()
    if letter not in state.axes:
        raise RefusedError(text, f"the machine has no axis {letter.upper()}; it has {', '.join(state.axes)}")
    return state.axes.index(letter)


def coordinates(state: State, block: Block) -> dict[int, tuple[float, bool]]:
    """Return what the block says of its axes: value in mm or degrees, and whether it is incremental."""
    found: dict[int, tuple[float, bool]] = {}
    for name, expression in block.values.items():
        if name not in CARTESIAN:
            continue
        axis = axis_of(state, name, block.texts[name])
        if axis in found:
            raise RefusedError(block.texts[name], "this axis stands twice in this block")
        given = expression(state.variables)
        found[axis] = (given * state.unit_mm if axis < 3 else given, name[0] == "I")
    return found


def target(state: State, block: Block, machine: bool = False) -> Position:
    """Machine position that the axis words ask for; an axis that is not named stays. machine: M91."""
    named = coordinates(state, block)
    if state.normal in named:
        state.take_length()
    if machine:
        moved = list(state.position)
        for axis, (given, incremental) in named.items():
            moved[axis] = moved[axis] + given if incremental else given
        return state.checked(tuple(moved))
    if state.frame.plain:
        moved, offset = list(state.position), state.frame.offset
        for axis, (given, incremental) in named.items():
            moved[axis] = moved[axis] + given if incremental else given + offset[axis]
    else:
        program = list(state.frame.to_program(state.position))
        for axis, (given, incremental) in named.items():
            program[axis] = program[axis] + given if incremental else given
        moved = list(state.frame.to_machine(tuple(program)))
    if state.shortest_rotary:
        for axis in named:
            if axis >= 3 and not named[axis][1]:
                moved[axis] = state.position[axis] + (moved[axis] - state.position[axis] + 180.0) % 360.0 - 180.0
    return state.checked(tuple(moved))


def polar_target(state: State, block: Block) -> tuple[Position, float]:
    """Machine position of PR and PA about the pole, and the angle that the tool turns about it, degrees."""
    pole = need_pole(state)
    program = list(state.frame.to_program(state.position))
    first, second, _ = PLANES[pole.plane]
    away_a, away_b = program[first] - pole.first_mm, program[second] - pole.second_mm
    radius, angle = math.hypot(away_a, away_b), math.degrees(math.atan2(away_b, away_a))
    start = angle
    for name in POLAR & block.values.keys():
        given = block.values[name](state.variables)
        if name == "PR":
            radius = given * state.unit_mm
        elif name == "IPR":
            radius += given * state.unit_mm
        elif name == "PA":
            angle = given
        else:
            angle += given
    for axis, (given, incremental) in coordinates(state, block).items():
        if axis in (first, second):
            raise RefusedError(LETTERS[axis], "has no meaning beside PR and PA")
        if axis == state.normal:
            state.take_length()
            program = list(state.frame.to_program(state.position))
        program[axis] = program[axis] + given if incremental else given
    program[first] = pole.first_mm + radius * math.cos(math.radians(angle))
    program[second] = pole.second_mm + radius * math.sin(math.radians(angle))
    return state.checked(state.frame.to_machine(tuple(program))), angle - start


def need_pole(state: State) -> Pole:
    if state.pole is None:
        raise RefusedError("", "this block needs a pole or a circle centre; write CC before")
    return state.pole


def set_pole(state: State, block: Block) -> None:
    """CC: absolute, incremental from where the tool is, or without coordinates there."""
    program = state.frame.to_program(state.position)
    named = coordinates(state, block)
    if any(axis > 2 for axis in named) or len(named) > 2:
        raise RefusedError("CC", "takes two of X, Y, Z")
    plane = state.plane
    if len(named) == 2:
        plane = next(number for number, axes in PLANES.items() if set(axes[:2]) == set(named))
    first, second, _ = PLANES[plane]
    if not set(named) <= {first, second}:
        raise RefusedError("CC", "needs both coordinates where one of them is that of the tool's axis")
    kept = {first: program[first], second: program[second]}
    if named and state.pole is not None and state.pole.plane == plane:
        kept = {first: state.pole.first_mm, second: state.pole.second_mm}
    for axis, (given, incremental) in named.items():
        kept[axis] = program[axis] + given if incremental else given
    state.pole = Pole(plane, kept[first], kept[second])


def take_feed(state: State, block: Block) -> bool:
    """Take over the feed of a block; returns True for FMAX, which holds in this block alone."""
    if block.feed is None:
        return False
    if block.feed is FeedKind.RAPID:
        return True
    if block.feed is FeedKind.AUTO:
        if state.tool.feed_mm_min is None:
            raise RefusedError(block.feed_text, "TOOL CALL gave no feed; write F there, or a figure here")
        state.per_revolution, state.feed_mm_min = False, state.tool.feed_mm_min
        return False
    if block.feed is FeedKind.PER_TOOTH:
        raise RefusedError(block.feed_text, "the number of the tool's teeth is not known; write F or FU")
    assert block.feed_value is not None
    state.set_feed(block.feed_value(state.variables), block.feed_text, block.feed is FeedKind.PER_REVOLUTION)
    return False


def block_feed(state: State, block: Block) -> float | None:
    """The feed of RND and CHF, mm/min, which holds in that block alone; None without one."""
    if block.feed is None:
        return None
    if block.feed is not FeedKind.FIGURE or block.feed_value is None:
        raise RefusedError(block.feed_text, "a corner takes a figure as its feed")
    value = block.feed_value(state.variables) * (INCH_FEED if state.unit_mm == MM_PER_INCH else 1.0)
    if value <= 0.0:
        raise RefusedError(block.feed_text, "a feed is more than 0")
    return value


def add(state: State, move: Motion, leaves: bool = False) -> None:
    """Put out a motion, and take the position on. leaves: it leaves a contour with radius compensation."""
    if state.corner is not None and compensation.moves_in_plane(state, state.position, move):
        move = corners.close(state, move)
    elif state.corner is not None:
        raise RefusedError(state.corner.text, "the move behind a corner has to be in the working plane")
    if state.compensation is not None:
        move = compensation.at_the_edge(state, move)
        compensation.note(state, leaves)
    state.emit(move)
    state.last = (state.position, move)
    state.last_rapid = isinstance(move, Rapid)
    state.position = move.end_mm
    if leaves:
        compensation.finish(state)


def line(state: State, end: Position, rapid: bool, leaves: bool = False) -> None:
    """Go straight to a machine position."""
    add(state, straight_move(state, end, rapid), leaves)


def straight_move(state: State, end: Position, rapid: bool) -> Motion:
    """A straight motion to a machine position, with the feed in force."""
    if rapid:
        return Rapid(state.line, end, state.program)
    feed, per_rev = state.feed()
    factor = state.plunge_factor
    sink = state.position[state.normal] - end[state.normal]
    if factor is not None and sink > 0.0:
        # M103: along the tool's axis at most F times the factor.
        feed = min(feed, feed * factor * math.dist(state.position[:3], end[:3]) / sink)
    return Linear(state.line, end, feed, per_rev, state.program)
