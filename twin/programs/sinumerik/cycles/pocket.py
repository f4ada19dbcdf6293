"""POCKET3, a rectangular pocket, and POCKET4, a round one ("Cycles", chapter "Milling cycles").

Roughing goes down in equal infeeds of at most _MID, at each depth from the middle outwards in rings of equal width, up to the
finishing allowance _FAL; the base keeps _FALD. Into each depth the tool goes in the middle: in rapid (_VARI 0x), with _FFD (1x),
on a helix of radius _RAD1 and _DP1 a turn (2x), or to and fro along the length at _RAD1 degrees (3x). Finishing cuts the wall
once at each infeed, over a quarter of a circle of 2 mm or what fits, and then the base; what has no allowance is left out.
"""

import math
from collections.abc import Callable
from typing import Final, NamedTuple

from twin.programs.arcs import Point
from twin.programs.refusal import RefusedError
from twin.programs.sinumerik.cycles.arguments import Arguments
from twin.programs.sinumerik.cycles.levels import Levels, levels, to
from twin.programs.sinumerik.cycles.milling import (
    SMALL_MM,
    Segment,
    Shape,
    circle_ring,
    rings,
    rounded_ring,
    steps,
    turns_left,
)
from twin.programs.sinumerik.state import State
from twin.programs.sinumerik.tool import cutter_radius

APPROACH_MM: Final = 2.0
HELIX_TURNS_MAX: Final = 10_000


class Pocket(NamedTuple):
    """Halves of the way of the tool's centre along the finished wall, mm; corner: the radius of that way in the corners.

    ring: its way, drawn in by a distance, as segments; start: where such a ring begins
    """

    half_u: float
    half_v: float
    corner: float
    ring: Callable[[float], list[Segment]]

    @property
    def room(self) -> float:
        return min(self.half_u, self.half_v)

    def start(self, inset: float) -> Point:
        return (self.half_u - inset, 0.0)


def rectangle(state: State, given: Arguments) -> None:
    """POCKET3"""
    heights = common(state, given)
    radius = cutter_radius(state, "POCKET3")
    left = turns_left(state, given)
    corner = given.size("_CRAD")
    half_u, half_v = given.needed("_LENG") / 2.0 - radius, given.needed("_WID") / 2.0 - radius
    if half_u < -SMALL_MM or half_v < -SMALL_MM or corner < radius - SMALL_MM:
        raise RefusedError(
            "POCKET3 _CRAD", f"the tool, {radius:g} mm in radius, is too large for this pocket or its corners (61105)"
        )
    if corner > min(half_u, half_v) + radius + SMALL_MM:
        raise RefusedError("POCKET3 _CRAD", "the corners are rounder than the pocket is wide")
    half_u, half_v, corner = max(half_u, 0.0), max(half_v, 0.0), max(corner - radius, 0.0)

    def ring(inset: float) -> list[Segment]:
        return rounded_ring(half_u - inset, half_v - inset, max(corner - inset, 0.0), left)

    shape = Shape(state, (given.length("_PA"), given.length("_PO")), math.radians(given.number("_STA")))
    mill(state, given, heights, shape, Pocket(half_u, half_v, corner, ring), radius, left)


def circle(state: State, given: Arguments) -> None:
    """POCKET4"""
    heights = common(state, given)
    radius = cutter_radius(state, "POCKET4")
    left = turns_left(state, given)
    half = given.needed("_PRAD") - radius
    if half < -SMALL_MM:
        raise RefusedError("POCKET4 _PRAD", f"the tool, {radius:g} mm in radius, is too large for this pocket (61105)")
    half = max(half, 0.0)
    shape = Shape(state, (given.length("_PA"), given.length("_PO")), 0.0)
    pocket = Pocket(half, half, half, lambda inset: circle_ring(half - inset, left))
    mill(state, given, heights, shape, pocket, radius, left)


def common(state: State, given: Arguments) -> Levels:
    given.only_zero("_AP1", "_AP2", "_AD", reason="a pocket that is partly milled already is not read")
    given.older_form("_UMODE", "_GMODE", "_AMODE")
    if state.spindle_direction == 0:
        raise RefusedError(given.cycle, "needs a turning spindle; write S and M3 before")
    return levels(state, given)


def mill(state: State, given: Arguments, heights: Levels, shape: Shape, pocket: Pocket, radius: float, left: bool) -> None:
    """Rough or finish, then leave to the retraction plane over the middle."""
    work = given.whole("_VARI", 0, 99)
    side, base = given.size("_FAL"), given.size("_FALD")
    if work % 10 not in (1, 2) or work // 10 > 3:
        raise RefusedError(f"{given.cycle} _VARI", "is 1 roughing or 2 finishing, in the tens 0 to 3 for the way in (61102)")
    if side > pocket.room + SMALL_MM:
        raise RefusedError(f"{given.cycle} _FAL", "is more than the pocket has room for")
    if base > abs(heights.depth - heights.surface):
        raise RefusedError(f"{given.cycle} _FALD", "is more than the pocket is deep")
    to(state, heights.back)
    shape.rapid((0.0, 0.0))
    to(state, heights.start)
    floor = heights.depth - heights.down * base
    if work % 10 == 1:
        rough(state, given, heights, shape, pocket, (radius, side, floor, left))
    else:
        finish(state, given, heights, shape, pocket, (radius, side, floor, left))
    to(state, heights.start)
    shape.rapid((0.0, 0.0))
    to(state, heights.back)


def rough(
    state: State, given: Arguments, heights: Levels, shape: Shape, pocket: Pocket, how: tuple[float, float, float, bool]
) -> None:
    """Every depth from the middle outwards, to the allowance of the wall."""
    radius, side, floor, left = how
    feed = given.number("_FFP1") * state.feed_unit_mm
    before = heights.surface
    for level in steps(state, given, heights.surface, floor, given.size("_MID")):
        way_in(state, given, shape, pocket, (before, level, side, left))
        outwards(state, given, shape, pocket, (radius, side, feed))
        up = before - heights.down * given.size("SDIS")
        if level != floor:
            to(state, up)
            shape.rapid((0.0, 0.0))
        before = level


def way_in(state: State, given: Arguments, shape: Shape, pocket: Pocket, how: tuple[float, float, float, bool]) -> None:
    """From the depth before to the next one, by the tens of _VARI."""
    before, level, side, _ = how
    way = given.whole("_VARI", 0, 99) // 10
    down_feed = given.number("_FFD") * state.feed_unit_mm
    if way < 2:
        to(state, before if way else level)
    if way == 1:
        shape.line((0.0, 0.0), down_feed, level)
    elif way == 2:
        helix(state, given, shape, pocket, how)
    elif way == 3:
        angle = given.number("_RAD1")
        half = max(pocket.half_u - side, 0.0)
        if not 0.0 < angle < 90.0 or half <= SMALL_MM:
            raise RefusedError(f"{given.cycle} _RAD1", "is the angle of the way in, and needs a pocket with a length")
        down = abs(level - before)
        if down / (2.0 * half * math.tan(math.radians(angle))) > HELIX_TURNS_MAX:
            raise RefusedError(f"{given.cycle} _RAD1", "is too flat: more than 10 000 ways to and fro")
        strokes = math.ceil(down / (2.0 * half * math.tan(math.radians(angle))) - SMALL_MM)
        shape.rapid((-half, 0.0))
        to(state, before)
        for stroke in range(1, strokes + 1):
            end = half if stroke % 2 else -half
            shape.line((end, 0.0), down_feed, before + (level - before) * stroke / strokes)
        shape.line((-half if strokes % 2 else half, 0.0), down_feed)
        shape.line((0.0, 0.0), down_feed)


def helix(state: State, given: Arguments, shape: Shape, pocket: Pocket, how: tuple[float, float, float, bool]) -> None:
    """Turns of at most _DP1 about the middle, then a full circle at the depth."""
    before, level, side, left = how
    radius, pitch = given.needed("_RAD1"), given.needed("_DP1")
    feed = given.number("_FFD") * state.feed_unit_mm
    if radius > pocket.room - side + SMALL_MM:
        raise RefusedError(
            f"{given.cycle} _RAD1", f"a helix of {radius:g} mm does not fit; up to {max(pocket.room - side, 0.0):g} mm does"
        )
    turns = math.ceil(abs(level - before) / pitch - SMALL_MM)
    if turns > HELIX_TURNS_MAX:
        raise RefusedError(f"{given.cycle} _DP1", "makes more than 10 000 turns")
    shape.rapid((radius, 0.0))
    to(state, before)
    for turn in range(1, turns + 1):
        shape.arc(circle_ring(radius, left)[0], feed, before + (level - before) * turn / turns)
    shape.arc(circle_ring(radius, left)[0], feed)
    shape.line((0.0, 0.0), feed)


def outwards(state: State, given: Arguments, shape: Shape, pocket: Pocket, how: tuple[float, float, float]) -> None:
    """From the middle: along the line that is left when rings fill the rest, then ring after ring, the last by the allowance."""
    radius, side, feed = how
    room = pocket.room - side
    count = rings(state, given, radius, room, pocket.corner < pocket.room - SMALL_MM)
    long_u, long_v = pocket.half_u - pocket.room, pocket.half_v - pocket.room
    if long_u > SMALL_MM:
        shape.along([Segment((long_u, 0.0)), Segment((-long_u, 0.0)), Segment((long_u, 0.0))], feed)
    elif long_v > SMALL_MM:
        shape.along([Segment((0.0, long_v)), Segment((0.0, -long_v)), Segment((0.0, 0.0))], feed)
    for ring in range(1, count + 1):
        inset = side + room * (count - ring) / count
        shape.line(pocket.start(inset), feed)
        shape.along(pocket.ring(inset), feed)


def finish(
    state: State, given: Arguments, heights: Levels, shape: Shape, pocket: Pocket, how: tuple[float, float, float, bool]
) -> None:
    """The wall where it has an allowance, then the base where it has one."""
    radius, side, floor, left = how
    feed, down_feed = given.number("_FFP1") * state.feed_unit_mm, given.number("_FFD") * state.feed_unit_mm
    if side > 0.0 and pocket.room > SMALL_MM:
        quarter = min(APPROACH_MM, pocket.room)
        begin: Point = (pocket.half_u - quarter, -quarter if left else quarter)
        centre: Point = (pocket.half_u - quarter, 0.0)
        turn = math.pi / 2.0 if left else -math.pi / 2.0
        for level in steps(state, given, heights.surface, floor, given.size("_MID")):
            shape.rapid(begin)
            shape.line(begin, down_feed, level)
            shape.arc(Segment((pocket.half_u, 0.0), centre, turn), feed)
            shape.along(pocket.ring(0.0), feed)
            shape.arc(Segment((begin[0], -begin[1]), centre, turn), feed)
        to(state, heights.start)
        shape.rapid((0.0, 0.0))
    if floor != heights.depth:
        to(state, floor - heights.down * (given.size("SDIS") or 1.0))
        shape.line((0.0, 0.0), down_feed, heights.depth)
        outwards(state, given, shape, pocket, (radius, 0.0, feed))
