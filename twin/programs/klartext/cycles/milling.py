"""Cycles 208 and 251 to 254: bore milling, rectangular and circular pocket, slot, circular slot.

Parameters are those of Cycle Programming TNC 640, "Bore milling", "Rectangular pocket", "Circular pocket", "Slot milling",
"Circular slot".
"""

import math

from twin.programs.klartext.cycles import pocketing, steps
from twin.programs.klartext.cycles.definition import Definition
from twin.programs.klartext.cycles.shapes import Circle, Rectangle, RoundSlot, Slot, Turn
from twin.programs.klartext.state import State
from twin.programs.planar import Piece


def bore_milling(state: State, cycle: Definition) -> None:
    """208: on a half circle to the wall at the set-up clearance, a helix of Q334 a turn to the depth, one full circle there."""
    total = cycle.depth_mm()
    if total == 0.0:
        return
    tool, radius = state.radius_mm(cycle.text), cycle.positive(335) / 2.0
    feed, pitch = cycle.cutting_feed(206), cycle.positive(334)
    sense = 1.0 if cycle.number_of(351, -1, 1) >= 0 else -1.0
    path = radius - tool
    if path < -steps.ROUNDING_MM:
        raise cycle.refusal(335, f"the bore, {2.0 * radius:g} mm, is narrower than the tool, {2.0 * tool:g} mm")
    clearance, centre = steps.begin(state, cycle), steps.in_plane(state)
    bottom = cycle.surface_mm() - total
    if path > steps.ROUNDING_MM:
        turns = (clearance - bottom) / pitch
        if turns > state.settings.pecks_max:
            raise cycle.refusal(334, f"makes more than {state.settings.pecks_max} turns; Settings.pecks_max")
        wall = (centre[0] + path, centre[1])
        half = (centre[0] + path / 2.0, centre[1])
        pocketing.put(state, Piece(centre, wall, half, sense * math.pi), feed)
        sweep = sense * math.tau * turns
        end = (centre[0] + path * math.cos(sweep), centre[1] + path * math.sin(sweep))
        pocketing.put(state, Piece(wall, end, centre, sweep), feed, bottom)
        pocketing.put(state, Piece(end, end, centre, sense * math.tau), feed)
        between = ((centre[0] + end[0]) / 2.0, (centre[1] + end[1]) / 2.0)
        pocketing.put(state, Piece(end, centre, between, sense * math.pi), feed)
    else:
        steps.to(state, bottom, feed)
    steps.to(state, clearance)
    steps.finish(state, cycle)


def rectangular_pocket(state: State, cycle: Definition) -> None:
    """251: Q218 by Q219, corners of Q220, turned by Q224 about the tool's place; Q367 says which point of it that is."""
    half_a, half_b = cycle.positive(218) / 2.0, cycle.positive(219) / 2.0
    place = cycle.number_of(367, 0, 4)
    side_a, side_b = ((0, 0), (1, 1), (-1, 1), (-1, -1), (1, -1))[place]
    turn = Turn(steps.in_plane(state), math.radians(cycle.value(224)))
    centre = turn.point(side_a * half_a, side_b * half_b)
    corner = max(cycle.length(220, 0.0), state.radius_mm(cycle.text))
    shape = Rectangle(half_a, half_b, min(corner, half_a, half_b), Turn(centre, turn.angle_rad))
    pocketing.run(state, cycle, shape, cycle.number_of(366, 0, 2))


def circular_pocket(state: State, cycle: Definition) -> None:
    """252: of the diameter Q223."""
    shape = Circle(cycle.positive(223) / 2.0, Turn(steps.in_plane(state), 0.0))
    pocketing.run(state, cycle, shape, cycle.number_of(366, 0, 1))


def slot(state: State, cycle: Definition) -> None:
    """253: Q218 long, Q219 wide, turned by Q374; Q367: the tool is in the middle (0), at an end (1, 4), at its centre (2, 3)."""
    length, width = cycle.positive(218), cycle.positive(219)
    if length < width:
        raise cycle.refusal(218, "the slot is shorter than it is wide")
    half = (length - width) / 2.0
    away = (0.0, length / 2.0, half, -half, -length / 2.0)[cycle.number_of(367, 0, 4)]
    turn = Turn(steps.in_plane(state), math.radians(cycle.value(374)))
    shape = Slot(half, width / 2.0, Turn(turn.point(away, 0.0), turn.angle_rad))
    pocketing.run(state, cycle, shape, plunging_of_slot(cycle))


def plunging_of_slot(cycle: Definition) -> int:
    """0: straight; 1 and 2: to and fro, the only way with a slope in a slot."""
    return 2 if cycle.number_of(366, 0, 2) else 0


def circular_slot(state: State, cycle: Definition) -> None:
    """254: Q219 wide on a pitch circle of Q375, from Q376 over Q248; Q377 of them, Q378 apart.

    Q367 = 0: about Q216, Q217; else the tool is at the centre of the beginning (1), in the middle (2), at that of the end (3).
    """
    width, pitch = cycle.positive(219), cycle.positive(375) / 2.0
    begin, opening = math.radians(cycle.value(376)), math.radians(cycle.value(248))
    if not 0.0 < opening < math.tau:
        raise cycle.refusal(248, "the opening angle is more than 0 and less than 360 degrees")
    if pitch <= width / 2.0:
        raise cycle.refusal(375, "the pitch circle is too small for the width Q219")
    place, here = cycle.number_of(367, 0, 3), steps.in_plane(state)
    at = (0.0, begin, begin + opening / 2.0, begin + opening)[place]
    centre = (
        (cycle.length(216), cycle.length(217))
        if place == 0
        else (
            here[0] - pitch * math.cos(at),
            here[1] - pitch * math.sin(at),
        )
    )
    for number in range(cycle.number_of(377, 1, state.settings.repeats_max)):
        turn = Turn(centre, math.radians(cycle.value(378)) * number)
        pocketing.run(state, cycle, RoundSlot(pitch, width / 2.0, begin, opening, turn), plunging_of_slot(cycle))
