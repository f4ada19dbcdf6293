"""LONGHOLE, SLOT1 and SLOT2: long holes and slots on a circle ("Cycles", chapter "Milling cycles").

LONGHOLE is as wide as the tool: it goes to and fro along the hole, an infeed at each end. SLOT1 lies along the radius: its near
end is on the circle RAD. SLOT2 lies on the circle itself; AFSL is the angle between the centres of its round ends. A slot is cut
out in equal infeeds up to the allowance FAL, then its wall is finished with FFP2 and SSF.
"""

import math
from typing import Final, NamedTuple

from twin.programs.arcs import Point
from twin.programs.refusal import RefusedError
from twin.programs.sinumerik.cycles.arguments import Arguments
from twin.programs.sinumerik.cycles.levels import Levels, levels, to
from twin.programs.sinumerik.cycles.milling import SMALL_MM, Segment, Shape, steps, turns_left
from twin.programs.sinumerik.cycles.patterns import many
from twin.programs.sinumerik.spindle import turn
from twin.programs.sinumerik.state import State
from twin.programs.sinumerik.tool import cutter_radius

COMPLETE: Final = 0
ROUGH: Final = 1
FINISH: Final = 2


class Way(NamedTuple):
    """The middle line of one slot in the coordinates of its circle: its ends, and for a curved one the radius (0 = straight)."""

    begin: Point
    end: Point
    radius: float

    def centre(self) -> Point | None:
        return (0.0, 0.0) if self.radius > 0.0 else None


def shapes(state: State, given: Arguments) -> list[Shape]:
    """The coordinates of each slot: about the centre of the circle, turned to where the slot is."""
    count = many(given, "NUM")
    step = given.number("INDA") or 360.0 / count
    middle = (given.length("CPA"), given.length("CPO"))
    return [Shape(state, middle, math.radians(given.number("STA1") + step * place)) for place in range(count)]


def long_holes(state: State, given: Arguments) -> None:
    """LONGHOLE"""
    heights = levels(state, given)
    spinning(state, given)
    radius = cutter_radius(state, "LONGHOLE")
    near, far = given.size("RAD") + radius, given.size("RAD") + given.needed("LENG") - radius
    if far < near - SMALL_MM:
        raise RefusedError("LONGHOLE LENG", f"is less than the diameter of the tool, {2.0 * radius:g} mm (61105)")
    down_feed, feed = given.number("FFD") * state.feed_unit_mm, given.number("FFP1") * state.feed_unit_mm
    for shape in shapes(state, given):
        ends: list[Point] = [(near, 0.0), (far, 0.0)]
        to(state, heights.back)
        if distance(shape, ends[1]) < distance(shape, ends[0]):
            ends.reverse()
        shape.rapid(ends[0])
        to(state, heights.start)
        at = 0
        for level in steps(state, given, heights.surface, heights.depth, given.size("MID")):
            shape.line(ends[at], down_feed, level)
            at = 1 - at
            shape.line(ends[at], feed)
        to(state, heights.back)


def distance(shape: Shape, point: Point) -> float:
    return math.dist(shape.machine(point), shape.state.position)


def spinning(state: State, given: Arguments) -> None:
    if state.spindle_direction == 0:
        raise RefusedError(given.cycle, "needs a turning spindle; write S and M3 before")
    given.older_form("_UMODE", "_GMODE", "_AMODE")


def along_radius(state: State, given: Arguments) -> None:
    """SLOT1"""
    half = given.needed("WID") / 2.0
    near, far = given.size("RAD") + half, given.size("RAD") + given.needed("LENG") - half
    if far < near - SMALL_MM:
        raise RefusedError("SLOT1 LENG", "is less than the width of the slot")
    slots(state, given, Way((near, 0.0), (far, 0.0), 0.0), half)


def along_circle(state: State, given: Arguments) -> None:
    """SLOT2"""
    half, radius, angle = given.needed("WID") / 2.0, given.needed("RAD"), given.number("AFSL")
    if not 0.0 < angle < 360.0:
        raise RefusedError("SLOT2 AFSL", "is the angle of the slot, more than 0° and less than 360°")
    turned = math.radians(angle)
    end = (radius * math.cos(turned), radius * math.sin(turned))
    if half >= radius:
        raise RefusedError("SLOT2 WID", "half the slot is wider than the radius of its circle")
    slots(state, given, Way((radius, 0.0), end, radius), half)


def slots(state: State, given: Arguments, way: Way, half: float) -> None:
    """Cut each slot."""
    heights = levels(state, given)
    spinning(state, given)
    tool = cutter_radius(state, given.cycle)
    work = given.whole("VARI", 0, 39)
    if work % 10 > FINISH or work // 10 not in (0, 1):
        raise RefusedError(
            f"{given.cycle} VARI", "is 0 complete, 1 roughing, 2 finishing; the tool goes in straight (0 or 1 in the tens)"
        )
    side = given.size("FAL")
    room = half - tool
    if room < side - SMALL_MM or 3.0 * tool < half - SMALL_MM:
        reason = f"the tool, {tool:g} mm in radius, is too large for the slot, or leaves its middle standing (61105, 61106)"
        raise RefusedError(f"{given.cycle} WID", reason)
    for shape in shapes(state, given):
        to(state, heights.back)
        shape.rapid(way.begin)
        to(state, heights.start)
        if work % 10 in (COMPLETE, ROUGH):
            rough(state, given, heights, shape, (way, room - side, work // 10 == 0))
        if work % 10 == FINISH or (work % 10 == COMPLETE and side > 0.0):
            finish(state, given, heights, shape, (way, room))
        to(state, heights.back)


def rough(state: State, given: Arguments, heights: Levels, shape: Shape, how: tuple[Way, float, bool]) -> None:
    """Every depth: straight down at the near end, along the middle, and once round at the allowance."""
    way, reach, by_feed = how
    down_feed, feed = given.number("FFD") * state.feed_unit_mm, given.number("FFP1") * state.feed_unit_mm
    left = turns_left(state, given, "CDIR")
    for level in steps(state, given, heights.surface, heights.depth, given.size("MID")):
        shape.line(way.begin, feed)
        shape.line(way.begin, down_feed if by_feed or down_feed else feed, level)
        middle(shape, way, feed, back=False)
        if reach > SMALL_MM:
            middle(shape, way, feed, back=True)
            shape.line(sides(way, reach, left)[0].end, feed)
            shape.along(sides(way, reach, left)[1:], feed)
            shape.line(way.begin, feed)
        elif level != heights.depth:
            middle(shape, way, feed, back=True)


def finish(state: State, given: Arguments, heights: Levels, shape: Shape, how: tuple[Way, float]) -> None:
    """The wall, in infeeds of MIDF, with FFP2 and the speed SSF; what is not given is as in roughing."""
    way, reach = how
    feed = (given.number("FFP2") or given.number("FFP1")) * state.feed_unit_mm
    down_feed, speed = given.number("FFD") * state.feed_unit_mm, state.rpm
    left = turns_left(state, given, "CDIR")
    if given.number("SSF") > 0.0:
        state.rpm = given.number("SSF")
        turn(state, state.spindle_direction)
    most = given.size("MIDF") or given.size("MID")
    to(state, heights.start)
    shape.rapid(way.begin)
    for level in steps(state, given, heights.surface, heights.depth, most):
        shape.line(way.begin, down_feed, level)
        if reach > SMALL_MM:
            shape.line(sides(way, reach, left)[0].end, feed)
            shape.along(sides(way, reach, left)[1:], feed)
            shape.line(way.begin, feed)
        else:
            middle(shape, way, feed, back=False)
            middle(shape, way, feed, back=True)
    if state.rpm != speed:
        state.rpm = speed
        turn(state, state.spindle_direction)


def middle(shape: Shape, way: Way, feed: float, back: bool) -> None:
    """Along the middle line of the slot."""
    end = way.begin if back else way.end
    centre = way.centre()
    if centre is None:
        shape.line(end, feed)
        return
    angle = math.atan2(way.end[1], way.end[0]) % math.tau
    shape.arc(Segment(end, centre, -angle if back else angle), feed)


def sides(way: Way, reach: float, left: bool) -> list[Segment]:
    """Once round the slot at `reach` from its middle line, from beside the near end; the first segment only leads there."""
    centre = way.centre()
    angle = 0.0 if centre is None else math.atan2(way.end[1], way.end[0]) % math.tau
    side = 1.0 if left else -1.0
    near, far = way.radius + reach * side, way.radius - reach * side
    if centre is None:
        begin, over = (way.begin[0], -reach * side), (way.end[0], -reach * side)
        across, back = (way.end[0], reach * side), (way.begin[0], reach * side)
        out, home = Segment(over), Segment(back)
    else:
        begin, over = (near, 0.0), (near * math.cos(angle), near * math.sin(angle))
        across, back = (far * math.cos(angle), far * math.sin(angle)), (far, 0.0)
        out, home = Segment(over, centre, angle), Segment(back, centre, -angle)
    half_turn = math.pi * side
    return [Segment(begin), out, Segment(across, way.end, half_turn), home, Segment(begin, way.begin, half_turn)]
