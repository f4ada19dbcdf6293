"""Roughing and finishing of a pocket whose outline is a shape (cycles 251 to 254).

Roughing: plunge where the shape starts, clear from inside out in contours at most Q370 tool radii apart, up to the allowance Q368
of the wall; at the end lift by Q200 and go back in rapid; the same on each level, Q202 apart, down to the allowance Q369 of the
floor. Finishing: the wall with Q385 (without it Q207), in plunges of Q338, on and off it on a quarter circle; then the floor
(Cycle Programming TNC 640, "Pocket milling, stud milling, slot milling"). A control's way inside the pocket is its own; these
contours stand for it. What is left, the levels, the last contour and the feeds are those of the cycle.
"""

import math
from typing import Final, NamedTuple

from twin.programs.arcs import Point
from twin.programs.canonical import Arc
from twin.programs.klartext import motion
from twin.programs.klartext.cycles import steps
from twin.programs.klartext.cycles.definition import Definition
from twin.programs.klartext.cycles.shapes import Shape
from twin.programs.klartext.state import State
from twin.programs.planar import Piece, left_of, tangent
from twin.programs.planes import PLANES
from twin.programs.refusal import RefusedError

PLUNGE_ANGLE_DEG: Final = 3.0
"""ANGLE of the tool table, which the twin does not have: the slope of a helix and of plunging to and fro."""
HELIX_RADIUS_SHARE: Final = 0.5
"""Radius of the plunging helix in tool radii, where that fits."""
HIGHEST_OVERLAP: Final = 2.0


class Work(NamedTuple):
    """A pocket to be made: figures in mm and mm/min, heights in program coordinates."""

    shape: Shape
    tool_mm: float
    side_mm: float
    bottom_mm: float
    feed: float
    plunge_feed: float
    finishing_feed: float
    climb: bool
    plunging: int
    overlap_mm: float


def run(state: State, cycle: Definition, shape: Shape, plunging: int) -> None:
    """The whole cycle at the place where the tool is."""
    total = cycle.depth_mm()
    if total == 0.0:
        return
    tool = state.radius_mm(cycle.text)
    if tool <= 0.0 or tool > shape.reach_mm + steps.ROUNDING_MM:
        raise RefusedError(
            cycle.text, f"the tool, {tool:g} mm in radius, does not fit into a half width of {shape.reach_mm:g} mm"
        )
    kind, feed = cycle.number_of(215, 0, 2), cycle.cutting_feed(207)
    finishing = cycle.cutting_feed(385) if 385 in cycle.values else feed
    overlap = cycle.value(370)
    if not 0.0 < overlap <= HIGHEST_OVERLAP:
        raise cycle.refusal(370, f"the path overlap is more than 0 and up to {HIGHEST_OVERLAP:g} tool radii")
    side, bottom = cycle.length(368, 0.0), cycle.length(369, 0.0)
    # Clockwise turning tool: inside a pocket climb milling goes counter-clockwise.
    climb = cycle.number_of(351, -1, 1) >= 0
    work = Work(shape, tool, side, bottom, feed, cycle.cutting_feed(206), finishing, climb, plunging, overlap * tool)
    clearance = steps.begin(state, cycle)
    surface, deepest = cycle.surface_mm(), total
    origin = steps.in_plane(state)
    if kind != 2:
        rough(state, cycle, work, surface, deepest - bottom)
    if kind == 2 or (kind == 0 and (side > 0.0 or bottom > 0.0)):
        if side > 0.0 or kind == 2:
            finish_wall(state, cycle, work, surface, deepest)
        if bottom > 0.0:
            finish_floor(state, cycle, work, surface, deepest)
    steps.to(state, clearance)
    steps.finish(state, cycle)
    steps.across(state, *origin)


def rough(state: State, cycle: Definition, work: Work, surface: float, depth: float) -> None:
    clear, done = cycle.length(200, 0.0), 0.0
    rings = contours(state, work, work.tool_mm + work.side_mm)
    for level in steps.pecks(state, cycle, depth, cycle.length(202), 0.0, 0.0):
        steps.across(state, *work.shape.start)
        steps.to(state, surface - done + clear if done > 0.0 else surface + clear)
        plunge(state, work, surface - done, surface - level)
        clear_out(state, work, rings, work.feed)
        done = level
        steps.to(state, surface - level + clear)
    steps.across(state, *work.shape.start)


def contours(state: State, work: Work, outermost_mm: float) -> list[list[Piece]]:
    """The contours from the innermost to the one at `outermost_mm` from the wall, evenly apart."""
    reach = work.shape.reach_mm
    outermost = min(outermost_mm, reach)
    count = math.ceil((reach - outermost) / work.overlap_mm - steps.ROUNDING_MM)
    if count > state.settings.pecks_max:
        raise RefusedError(
            "Q370", f"makes more than {state.settings.pecks_max} contours; a larger overlap, or Settings.pecks_max"
        )
    insets = [reach - (reach - outermost) * at / count for at in range(count + 1)] if count else [outermost]
    found = [work.shape.contour(inset) for inset in insets]
    return [ring if work.climb else reverse(ring) for ring in found if ring]


def reverse(ring: list[Piece]) -> list[Piece]:
    return [piece._replace(start=piece.end, end=piece.start, sweep_rad=-piece.sweep_rad) for piece in reversed(ring)]


def plunge(state: State, work: Work, above: float, below: float) -> None:
    """From the last level to the next: straight (0), on a helix (1), or to and fro along the core (2)."""
    core, radius = work.shape.core(), min(work.tool_mm * HELIX_RADIUS_SHARE, work.shape.reach_mm - work.tool_mm)
    slope = math.tan(math.radians(PLUNGE_ANGLE_DEG))
    if work.plunging == 1 and radius > steps.ROUNDING_MM:
        steps.to(state, above, work.plunge_feed)
        centre = steps.in_plane(state)
        steps.across(state, centre[0] + radius, centre[1], work.plunge_feed)
        turns = math.ceil((above - below) / (math.tau * radius * slope))
        sweep = math.tau * turns * (1.0 if work.climb else -1.0)
        put(
            state, Piece((centre[0] + radius, centre[1]), (centre[0] + radius, centre[1]), centre, sweep), work.plunge_feed, below
        )
        put(
            state,
            Piece((centre[0] + radius, centre[1]), (centre[0] + radius, centre[1]), centre, math.copysign(math.tau, sweep)),
            work.plunge_feed,
        )
        steps.across(state, *centre, feed_mm_min=work.plunge_feed)
    elif work.plunging == 2 and core:
        steps.to(state, above, work.plunge_feed)
        way = core[0]
        length = math.dist(way.start, way.end) if way.centre is None else way.radius * abs(way.sweep_rad)
        strokes = 2 * math.ceil((above - below) / (2.0 * length * slope))
        for stroke in range(strokes):
            along = way if stroke % 2 == 0 else reverse([way])[0]
            put(state, along, work.plunge_feed, above - (above - below) * (stroke + 1) / strokes)
    else:
        steps.to(state, below, work.plunge_feed)


def clear_out(state: State, work: Work, rings: list[list[Piece]], feed: float) -> None:
    """Along the contours from inside out, and off the last one towards the middle."""
    for ring in rings:
        steps.across(state, *ring[0].start, feed_mm_min=feed)
        for piece in ring:
            put(state, piece, feed)
    if len(rings) > 1:
        side = 1.0 if work.climb else -1.0
        ahead = tangent(rings[-1][-1], rings[-1][-1].end)
        reach = min(work.tool_mm / 4.0, work.overlap_mm / 2.0)
        off = left_of(ahead, side * reach, (rings[-1][-1].end[0] + reach * ahead[0], rings[-1][-1].end[1] + reach * ahead[1]))
        steps.across(state, *off, feed_mm_min=feed)


def finish_wall(state: State, cycle: Definition, work: Work, surface: float, depth: float) -> None:
    """Once round the wall on each plunge of Q338 (0: in one), on and off on quarter circles."""
    ring = work.shape.contour(work.tool_mm)
    if not ring:
        return
    ring = ring if work.climb else reverse(ring)
    clear, every = cycle.length(200, 0.0), cycle.length(338, 0.0)
    radius = max(min((work.shape.reach_mm - work.tool_mm) / 2.0, work.tool_mm), 0.0)
    side = 1.0 if work.climb else -1.0
    start, ahead = ring[0].start, tangent(ring[0], ring[0].start)
    centre = left_of(ahead, side * radius, start)
    before = (centre[0] - radius * ahead[0], centre[1] - radius * ahead[1])
    behind = (centre[0] + radius * ahead[0], centre[1] + radius * ahead[1])
    for level in steps.pecks(state, cycle, depth, every if every > 0.0 else depth, 0.0, 0.0):
        steps.to(state, surface + clear)
        steps.across(state, *before)
        steps.to(state, surface - level, work.plunge_feed)
        on_and_off(state, before, start, centre, side, work.finishing_feed)
        for piece in ring:
            put(state, piece, work.finishing_feed)
        on_and_off(state, start, behind, centre, side, work.finishing_feed)
    steps.to(state, surface + clear)


def on_and_off(state: State, first: Point, last: Point, centre: Point, side: float, feed: float) -> None:
    if math.dist(first, last) > steps.ROUNDING_MM:
        put(state, Piece(first, last, centre, side * math.pi / 2.0), feed)


def finish_floor(state: State, cycle: Definition, work: Work, surface: float, depth: float) -> None:
    """The floor from inside out."""
    steps.to(state, surface + cycle.length(200, 0.0))
    steps.across(state, *work.shape.start)
    steps.to(state, surface - depth + work.bottom_mm + cycle.length(200, 0.0))
    plunge(state, work, surface - depth + work.bottom_mm, surface - depth)
    clear_out(state, work, contours(state, work, work.tool_mm), work.finishing_feed)


def put(state: State, piece: Piece, feed: float, level: float | None = None) -> None:
    """Cut along a piece of the working plane; level: the height at its end."""
    first, second, normal = PLANES[state.plane]
    end = steps.placed_in_plane(state, *piece.end)
    if level is not None:
        program = list(state.frame.to_program(end))
        program[normal] = level
        end = state.frame.to_machine(tuple(program))
    if piece.centre is None:
        if math.dist(end, state.position) > steps.ROUNDING_MM:
            steps.go(state, end, feed)
        return
    state.frame.arc_scale(state.plane)
    middle = list(state.position[:3])
    centre = steps.placed_in_plane(state, *piece.centre)
    middle[first], middle[second] = centre[first], centre[second]
    sweep = -piece.sweep_rad if state.frame.mirrors(state.plane) else piece.sweep_rad
    full = (middle[0], middle[1], middle[2])
    motion.add(state, Arc(state.line, end, full, state.plane, sweep, feed, None, state.program))
