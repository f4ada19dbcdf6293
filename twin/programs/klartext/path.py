"""The path blocks: L, C, CR, CT, LP, CP, CTP, CC, RND, CHF, and blocks with M functions alone."""

import math
from collections.abc import Callable
from typing import Final

from twin.programs.arcs import Sweep, by_centre, by_radius
from twin.programs.canonical import Arc, Position
from twin.programs.klartext import compensation, corners, m_functions, motion
from twin.programs.klartext.block import Block, parse
from twin.programs.klartext.cycles import calling
from twin.programs.klartext.source import Source
from twin.programs.klartext.state import State
from twin.programs.pieces import piece, placed
from twin.programs.planar import extent, tangent
from twin.programs.planes import PLANES
from twin.programs.refusal import RefusedError

Shape = Callable[[State, Block, bool, bool], None]
"""A function that draws a block: FMAX or not, leaving a contour or not."""
NEAR_MM: Final = 1e-9
TURNS_MAX: Final = 100_000.0


def compiled(source: Source, begin: int, head: str) -> Callable[[State], None]:
    """A path block whose words begin at `begin`."""
    allowed, shape = SHAPES[head]
    block = parse(source, begin, allowed)

    def run(state: State) -> None:
        m_functions.before(state, block.m)
        leaves = compensation.switch(state, block.compensation)
        rapid = motion.take_feed(state, block)
        before = state.position
        shape(state, block, rapid, leaves)
        if has(block, 98):
            compensation.leave_open(state)
        if leaves and state.compensation is not None:
            compensation.finish(state)
        retract(state, block)
        calling.after_positioning(state, block, moved=state.position is not before)
        m_functions.after(state, block.m)

    return run


def retract(state: State, block: Block) -> None:
    """M140 MB50: back along the tool's axis; MB MAX: to where its reference says that the axis ends."""
    for function in block.m:
        if function.code != 140:
            continue
        moved, axis = list(state.position), state.normal
        state.take_length()
        if "MAX" in function.flags:
            places = state.settings.references_mm
            end = places[0][axis] if places else None
            if end is None or end < state.position[axis]:
                raise RefusedError("M140", "the end of the tool's axis is not known; [control] references_mm says where it is")
            moved[axis] = end
        elif "MB" in function.words:
            moved[axis] += function.words["MB"](state.variables) * state.unit_mm
        else:
            raise RefusedError("M140", "needs MB and a distance, or MB MAX")
        feed = function.words.get("F")
        if feed is not None:
            state.set_feed(feed(state.variables), "M140", per_revolution=False)
        motion.line(state, tuple(moved), rapid=feed is None)


def has(block: Block, code: int) -> bool:
    return any(function.code == code for function in block.m)


def straight(state: State, block: Block, rapid: bool, leaves: bool) -> None:
    machine = has(block, 91)
    if machine:
        compensation.refuse(state, "M91")
    if not block.values:
        return
    motion.line(state, motion.target(state, block, machine), rapid, leaves)


def straight_polar(state: State, block: Block, rapid: bool, leaves: bool) -> None:
    motion.line(state, motion.polar_target(state, block)[0], rapid, leaves)


def no_rapid(rapid: bool) -> None:
    if rapid:
        raise RefusedError("FMAX", "cannot go along an arc; write a feed")


def clockwise(state: State, block: Block, plane: int) -> bool:
    """The sense of rotation as seen in machine coordinates."""
    if block.direction is None:
        raise RefusedError("", "needs its sense of rotation; write DR+ or DR-")
    return (block.direction < 0) != state.frame.mirrors(plane)


def put_arc(state: State, end: Position, swept: Sweep, plane: int, leaves: bool) -> None:
    feed, per_rev = state.feed()
    first, second, _ = PLANES[plane]
    middle = list(state.position[:3])
    middle[first], middle[second] = swept.centre
    centre = (middle[0], middle[1], middle[2])
    motion.add(state, Arc(state.line, end, centre, plane, swept.sweep_rad, feed, per_rev, state.program), leaves)


def pole_centre(state: State) -> tuple[int, tuple[float, float]]:
    """The plane of the circle, and its centre in machine coordinates."""
    pole = motion.need_pole(state)
    first, second, _ = PLANES[pole.plane]
    program = list(state.frame.to_program(state.position))
    program[first], program[second] = pole.first_mm, pole.second_mm
    machine = state.frame.to_machine(tuple(program))
    state.frame.arc_scale(pole.plane)
    return pole.plane, (machine[first], machine[second])


def circle(state: State, block: Block, rapid: bool, leaves: bool) -> None:
    """C: about CC to the end; end on start is a full circle."""
    no_rapid(rapid)
    plane, centre = pole_centre(state)
    first, second, normal = PLANES[plane]
    end = with_superimposed(state, block, motion.target(state, block), normal)
    start_point = (state.position[first], state.position[second])
    turn = clockwise(state, block, plane)
    swept = by_centre(start_point, (end[first], end[second]), centre, turn, state.settings.arc_radius_error_mm_max, "CC")
    put_arc(state, end, swept, plane, leaves)


def circle_polar(state: State, block: Block, rapid: bool, leaves: bool) -> None:
    """CP: to a polar angle; with IPA as many turns as it says, with IZ a helix."""
    no_rapid(rapid)
    plane, centre = pole_centre(state)
    first, second, normal = PLANES[plane]
    end, turned = motion.polar_target(state, block)
    end = with_superimposed(state, block, end, normal)
    turn = clockwise(state, block, plane)
    start_point, end_point = (state.position[first], state.position[second]), (end[first], end[second])
    swept = by_centre(start_point, end_point, centre, turn, state.settings.arc_radius_error_mm_max, "CC")
    if "IPA" in block.values:
        if turned == 0.0 or (turned > 0.0) != (block.direction == 1):
            raise RefusedError(block.texts["IPA"], "IPA and DR have to have the same sign")
        if abs(turned) > 360.0 * TURNS_MAX:
            raise RefusedError(block.texts["IPA"], f"makes more than {TURNS_MAX:g} turns")
        swept = swept._replace(sweep_rad=-abs(math.radians(turned)) if turn else abs(math.radians(turned)))
    put_arc(state, end, swept, plane, leaves)


def with_superimposed(state: State, block: Block, end: Position, normal: int) -> Position:
    """LIN_Z: a straight motion of the axis out of the plane, on top of the arc."""
    given = block.value(state.variables, "LIN_Z")
    if given is None:
        return end
    program = list(state.frame.to_program(end))
    program[normal] = given * state.unit_mm
    return state.frame.to_machine(tuple(program))


def circle_radius(state: State, block: Block, rapid: bool, leaves: bool) -> None:
    """CR: by its radius; negative = the longer arc."""
    no_rapid(rapid)
    plane = state.plane
    first, second, normal = PLANES[plane]
    given = block.value(state.variables, "R")
    if given is None:
        raise RefusedError("CR", "needs its radius; write R")
    end = with_superimposed(state, block, motion.target(state, block), normal)
    radius = given * state.unit_mm * abs(state.frame.arc_scale(plane))
    start_point, end_point = (state.position[first], state.position[second]), (end[first], end[second])
    turn = clockwise(state, block, plane)
    try:
        swept = by_radius(start_point, end_point, radius, turn, state.settings.arc_radius_error_mm_max)
    except RefusedError as refused:
        reason = refused.reason.replace("write I, J, K for a full circle", "write CC and C for a full circle")
        raise RefusedError(block.texts["R"], reason.replace("write the radius, or G1", "write the radius, or L")) from None
    put_arc(state, end, swept, plane, leaves)


def circle_tangent(state: State, block: Block, rapid: bool, leaves: bool) -> None:
    tangential(state, with_superimposed(state, block, motion.target(state, block), state.normal), rapid, leaves)


def circle_tangent_polar(state: State, block: Block, rapid: bool, leaves: bool) -> None:
    tangential(state, motion.polar_target(state, block)[0], rapid, leaves)


def tangential(state: State, end: Position, rapid: bool, leaves: bool) -> None:
    """CT, CTP: the arc that goes on in the direction of the move before. Sweep = twice the angle from there to the chord."""
    no_rapid(rapid)
    if state.last is None:
        raise RefusedError("CT", "needs a move of the contour just before, to which it is tangential")
    before = piece(state.last[0], state.last[1], state.plane)
    first, second, _ = PLANES[state.plane]
    start = (state.position[first], state.position[second])
    chord = (end[first] - start[0], end[second] - start[1])
    size = math.hypot(*chord)
    if extent(before) < NEAR_MM or size < NEAR_MM:
        raise RefusedError("CT", "needs a length in the working plane, and so does the move before it")
    ahead = tangent(before, before.end)
    across = ahead[0] * chord[1] - ahead[1] * chord[0]
    sweep = 2.0 * math.atan2(across, ahead[0] * chord[0] + ahead[1] * chord[1])
    if abs(across) < NEAR_MM:
        if abs(sweep) > math.pi:
            raise RefusedError("CT", "the end lies straight behind; no arc goes there")
        motion.line(state, placed(end, (end[first], end[second]), state.plane), rapid=False, leaves=leaves)
        return
    reach = size * size / (2.0 * across)
    centre = (start[0] - ahead[1] * reach, start[1] + ahead[0] * reach)
    put_arc(state, end, Sweep(centre, sweep), state.plane, leaves)


def centre(state: State, block: Block, rapid: bool, leaves: bool) -> None:
    motion.set_pole(state, block)


def corner_size(state: State, block: Block, head: str) -> tuple[float, str]:
    given = block.value(state.variables, "R")
    if given is None:
        raise RefusedError(head, "needs its size")
    return given * state.unit_mm * abs(state.frame.arc_scale(state.plane)), f"{head} {block.texts['R']}"


def corner(source: Source, begin: int, head: str) -> Callable[[State], None]:
    """`RND R5 F100`, `RND 5`, `CHF 12`."""
    rest = source.body[begin:].lstrip()
    if rest[:1] in "0123456789.,+-Q" and rest:
        # A bare figure is the size.
        at = len(source.body) - len(rest)
        source = source._replace(body=f"{source.body[:at]}R{rest}", written=f"{source.written[:at]} {source.written[at:]}")
    block = parse(source, begin, frozenset("R"))

    def run(state: State) -> None:
        m_functions.before(state, block.m)
        size, text = corner_size(state, block, head)
        corners.begin(state, head == "RND", size, motion.block_feed(state, block), text)
        m_functions.after(state, block.m)

    return run


def m_alone(state: State, block: Block, rapid: bool, leaves: bool) -> None:
    """A block without a path of its own."""


SHAPES: Final[dict[str, tuple[frozenset[str], Shape]]] = {
    "L": (motion.CARTESIAN, straight),
    "LP": (motion.CARTESIAN | motion.POLAR, straight_polar),
    "C": (motion.CARTESIAN | {"LIN_Z"}, circle),
    "CP": (motion.CARTESIAN | motion.POLAR | {"LIN_Z"}, circle_polar),
    "CR": (motion.CARTESIAN | {"R", "LIN_Z"}, circle_radius),
    "CT": (motion.CARTESIAN | {"LIN_Z"}, circle_tangent),
    "CTP": (motion.CARTESIAN | motion.POLAR, circle_tangent_polar),
    "CC": (motion.CARTESIAN, centre),
    "M": (frozenset(), m_alone),
}
