"""Cycles 202 and 204: boring with an oriented spindle at the end, and boring from the far side.

Cycle Programming TNC 640, "Boring", "Back boring". Q214 is the direction off the wall: 1 -X, 2 -Y, 3 +X, 4 +Y of the working
plane; 0 none.
"""

from collections.abc import Mapping
from typing import Final

from twin.programs.klartext import spindle
from twin.programs.klartext.cycles import steps
from twin.programs.klartext.cycles.definition import Definition
from twin.programs.klartext.state import State

OFF_WALL_MM: Final = 0.2
DIRECTIONS: Final[Mapping[int, tuple[float, float]]] = {
    0: (0.0, 0.0),
    1: (-1.0, 0.0),
    2: (0.0, -1.0),
    3: (1.0, 0.0),
    4: (0.0, 1.0),
}


def boring(state: State, cycle: Definition) -> None:
    """202: to depth, pause, oriented stop, 0.2 mm off the wall, out with Q208, back to the centre."""
    total = cycle.depth_mm()
    if total == 0.0:
        return
    away = DIRECTIONS[cycle.number_of(214, 0, 4)]
    direction = state.spindle_direction
    clearance = steps.begin(state, cycle)
    steps.to(state, cycle.surface_mm() - total, cycle.cutting_feed(206))
    steps.pause(state, cycle.seconds(211))
    spindle.orient(state)
    centre = steps.in_plane(state)
    steps.across(state, centre[0] + OFF_WALL_MM * away[0], centre[1] + OFF_WALL_MM * away[1])
    steps.to(state, clearance, cycle.feed(208, instead=206))
    steps.finish(state, cycle)
    steps.across(state, *centre)
    spindle.turn(state, direction)


def back_boring(state: State, cycle: Definition) -> None:
    """204: beside the hole's centre by Q252 down through the material Q250, to the centre, up by Q249 with Q254, and out again.

    The tooth lies Q251 above the tool's lower end, which is what its length is measured to.
    """
    depth = cycle.length(249, 0.0)
    if depth == 0.0:
        return
    away = DIRECTIONS[cycle.number_of(214, 0, 4)]
    if away == (0.0, 0.0):
        raise cycle.refusal(214, "needs the direction off the wall, 1 to 4")
    shift, direction = cycle.positive(252), state.spindle_direction or 1
    under = cycle.surface_mm() - cycle.length(250, 0.0) - cycle.length(251, 0.0)
    below = under - cycle.length(200, 0.0)
    centre = steps.in_plane(state)
    aside = (centre[0] + shift * away[0], centre[1] + shift * away[1])
    clearance = steps.begin(state, cycle)
    spindle.orient(state)
    steps.across(state, *aside)
    steps.to(state, below, cycle.feed(253))
    steps.across(state, *centre)
    spindle.turn(state, direction)
    steps.to(state, under + depth, cycle.cutting_feed(254))
    steps.pause(state, cycle.seconds(255))
    steps.to(state, below, cycle.feed(253))
    spindle.orient(state)
    steps.across(state, *aside)
    steps.to(state, clearance, cycle.feed(253))
    steps.finish(state, cycle)
    steps.across(state, *centre)
    spindle.turn(state, direction)
