"""The geometry that milling cycles share: a shape's own coordinates, equal infeeds, the direction of milling, and rings around a
shape.

The way inside a shape is the control's own, and only described in words: from the middle outwards, in steps of equal width. The
rings here follow that description; the last one is the contour itself, exact.
"""

import math
from collections.abc import Iterator
from dataclasses import dataclass
from typing import Final, NamedTuple

from twin.programs.arcs import Point, arc_length
from twin.programs.canonical import Arc
from twin.programs.planes import PLANES
from twin.programs.refusal import RefusedError
from twin.programs.sinumerik import motion
from twin.programs.sinumerik.cycles.arguments import Arguments
from twin.programs.sinumerik.state import State

SMALL_MM: Final = 1e-9
WIDTH_SHARE: Final = 0.8
"""Part of the tool's diameter that is the width of a cut where _MIDA is 0."""
CORNER_SHARE: Final = 1.7
"""Widest step between rings with corners that leaves no island there, in radii of the tool: just under 1 + 1/√2."""


class Segment(NamedTuple):
    """A line or an arc of a ring, to `end`; an arc has its centre and its angle, + counter-clockwise."""

    end: Point
    centre: Point | None = None
    sweep_rad: float = 0.0


@dataclass(frozen=True, slots=True)
class Shape:
    """The coordinates of one shape in the plane: its middle, and the angle of its length. Points in them are (u, v), mm."""

    state: State
    middle: Point
    angle_rad: float

    def program(self, point: Point, height: float | None = None) -> tuple[float, ...]:
        """Program coordinates of a point; the height stays where none is given."""
        first, second, normal = PLANES[self.state.plane]
        sine, cosine = math.sin(self.angle_rad), math.cos(self.angle_rad)
        place = list(self.state.frames.to_program(self.state.position))
        place[first] = self.middle[0] + point[0] * cosine - point[1] * sine
        place[second] = self.middle[1] + point[0] * sine + point[1] * cosine
        if height is not None:
            place[normal] = height
        return tuple(place)

    def machine(self, point: Point, height: float | None = None) -> tuple[float, ...]:
        if height is not None and self.state.normal == motion.Z:
            self.state.take_length()
        return self.state.checked(self.state.frames.to_machine(self.program(point, height)))

    def rapid(self, point: Point, height: float | None = None) -> None:
        end = self.machine(point, height)
        if end != self.state.position:
            motion.rapid(self.state, end)

    def line(self, point: Point, feed: float, height: float | None = None) -> None:
        """Cut straight to a point with a feed of the cycle's own; 0 = that in force."""
        end = self.machine(point, height)
        if math.dist(end, self.state.position) <= SMALL_MM:
            return
        self.state.block_feed = feed or None
        motion.linear(self.state, end)
        self.state.block_feed = None

    def arc(self, segment: Segment, feed: float, height: float | None = None) -> None:
        """Cut along an arc, a helix where it ends at another height."""
        state = self.state
        assert segment.centre is not None
        first, second, normal = PLANES[state.plane]
        end, start, centre = self.machine(segment.end, height), state.position, self.machine(segment.centre)
        sweep = -segment.sweep_rad if state.frames.mirrors(state.plane) else segment.sweep_rad
        middle = list(start[:3])
        middle[first], middle[second] = centre[first], centre[second]
        state.block_feed = feed or None
        length = arc_length((start[first], start[second]), (centre[first], centre[second]), sweep, end[normal] - start[normal])
        mm_min, per_rev = state.feed(length)
        state.block_feed = None
        full = (middle[0], middle[1], middle[2])
        motion.add(state, Arc(state.line, end, full, state.plane, sweep, mm_min, per_rev, state.program))

    def along(self, segments: list[Segment], feed: float) -> None:
        """Cut along a ring."""
        for segment in segments:
            if segment.centre is None:
                self.line(segment.end, feed)
            else:
                self.arc(segment, feed)


def steps(state: State, given: Arguments, top: float, bottom: float, most: float) -> Iterator[float]:
    """Heights from `top` to `bottom` in equal steps of at most `most`; 0 = in one."""
    total = abs(bottom - top)
    many = max(math.ceil(total / most - SMALL_MM), 1) if most > 0.0 else 1
    if many > state.settings.pecks_max:
        raise RefusedError(
            given.cycle, f"makes more than {state.settings.pecks_max} infeeds; a larger one, or Settings.pecks_max"
        )
    for place in range(1, many):
        yield top + (bottom - top) * place / many
    yield bottom


def turns_left(state: State, given: Arguments, name: str = "_CDIR", *, outside: bool = False) -> bool:
    """Return True where the cutter goes round counter-clockwise: 0 climb, 1 up-cut by the spindle, 2 G2, 3 G3.

    outside: round a spigot, where climb is the other way than in a pocket
    """
    code = given.whole(name, 0, 3)
    if code >= 2:
        return code == 3
    return ((code == 0) == (state.spindle_direction >= 0)) != outside


def rings(state: State, given: Arguments, radius: float, room: float, has_corners: bool) -> int:
    """Return how many rings fill the room, in steps of equal width of at most _MIDA, or 80 % of the diameter.

    has_corners: at a corner the inner ring is √2 times as far from what the outer one just misses, so steps are narrower
    """
    most = given.size("_MIDA") or WIDTH_SHARE * 2.0 * radius
    most = min(most, CORNER_SHARE * radius if has_corners else 2.0 * radius)
    many = max(math.ceil(room / most - SMALL_MM), 1) if room > SMALL_MM else 0
    if many > state.settings.pecks_max:
        raise RefusedError(f"{given.cycle} _MIDA", f"makes more than {state.settings.pecks_max} rings; a larger one")
    return many


def rounded_ring(half_u: float, half_v: float, corner: float, left: bool) -> list[Segment]:
    """A rectangle with rounded corners, from (half_u, 0) once round.

    >>> [segment.end for segment in rounded_ring(2.0, 1.0, 0.0, left=True)]
    [(2.0, 1.0), (-2.0, 1.0), (-2.0, -1.0), (2.0, -1.0), (2.0, 0.0)]
    """
    corner = min(corner, half_u, half_v)
    flip = 1.0 if left else -1.0
    found: list[Segment] = []
    for at, (u, v) in enumerate(((1.0, 1.0), (-1.0, 1.0), (-1.0, -1.0), (1.0, -1.0))):
        outer, inner = (half_u * u, (half_v - corner) * v), ((half_u - corner) * u, half_v * v)
        first, last = (outer, inner) if at % 2 == 0 else (inner, outer)
        found.append(Segment((first[0], first[1] * flip)))
        if corner > SMALL_MM:
            centre = ((half_u - corner) * u, (half_v - corner) * v * flip)
            found.append(Segment((last[0], last[1] * flip), centre, flip * math.pi / 2.0))
    found.append(Segment((half_u, 0.0)))
    return found


def circle_ring(radius: float, left: bool) -> list[Segment]:
    """A circle about the middle, from (radius, 0)."""
    return [Segment((radius, 0.0), (0.0, 0.0), math.tau if left else -math.tau)]
