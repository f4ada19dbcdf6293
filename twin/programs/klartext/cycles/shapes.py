"""The outlines of pockets and slots, seen from inside: closed contours at any distance from the wall.

Coordinates are those of the working plane, mm, with the outline's own centre and turn in. A contour runs counter-clockwise and
begins in the middle of its side at +X; of a circular slot where its outer arc begins. From the point where roughing begins a
straight line leads to the beginning of every contour without touching the wall.
"""

import math
from dataclasses import dataclass
from typing import Protocol

from twin.programs.arcs import Point
from twin.programs.planar import Piece

LEAST_MM = 1e-9


class Shape(Protocol):
    """The outline of a pocket.

    width_mm: of the widest tool that fits; reach_mm: distance from the wall to the innermost line or point
    """

    @property
    def reach_mm(self) -> float: ...

    def contour(self, inset_mm: float) -> list[Piece]:
        """The closed contour at that distance from the wall; without a width it is a line there and back, or nothing."""

    def core(self) -> list[Piece]:
        """An open way along the innermost line, for plunging to and fro; empty where that is a point."""

    @property
    def start(self) -> Point:
        """The point where roughing begins."""


@dataclass(frozen=True, slots=True)
class Turn:
    """A turn about the origin, then a shift."""

    centre: Point
    angle_rad: float

    def point(self, a: float, b: float) -> Point:
        cosine, sine = math.cos(self.angle_rad), math.sin(self.angle_rad)
        return (self.centre[0] + cosine * a - sine * b, self.centre[1] + sine * a + cosine * b)


def line(turn: Turn, first: Point, last: Point) -> list[Piece]:
    if math.dist(first, last) < LEAST_MM:
        return []
    return [Piece(turn.point(*first), turn.point(*last))]


def arc(turn: Turn, centre: Point, radius: float, begin_rad: float, sweep_rad: float) -> list[Piece]:
    if radius * abs(sweep_rad) < LEAST_MM:
        return []
    end = begin_rad + sweep_rad
    first = (centre[0] + radius * math.cos(begin_rad), centre[1] + radius * math.sin(begin_rad))
    last = (centre[0] + radius * math.cos(end), centre[1] + radius * math.sin(end))
    return [Piece(turn.point(*first), turn.point(*last), turn.point(*centre), sweep_rad)]


@dataclass(frozen=True, slots=True)
class Rectangle:
    """Cycle 251: half lengths, the radius of the corners, centre and turn."""

    half_a_mm: float
    half_b_mm: float
    corner_mm: float
    turn: Turn

    @property
    def reach_mm(self) -> float:
        return min(self.half_a_mm, self.half_b_mm)

    @property
    def start(self) -> Point:
        return self.turn.point(0.0, 0.0)

    def contour(self, inset_mm: float) -> list[Piece]:
        a, b = max(self.half_a_mm - inset_mm, 0.0), max(self.half_b_mm - inset_mm, 0.0)
        r = min(max(self.corner_mm - inset_mm, 0.0), a, b)
        quarter, turn = math.pi / 2.0, self.turn
        return [
            *line(turn, (a, 0.0), (a, b - r)),
            *arc(turn, (a - r, b - r), r, 0.0, quarter),
            *line(turn, (a - r, b), (r - a, b)),
            *arc(turn, (r - a, b - r), r, quarter, quarter),
            *line(turn, (-a, b - r), (-a, r - b)),
            *arc(turn, (r - a, r - b), r, 2.0 * quarter, quarter),
            *line(turn, (r - a, -b), (a - r, -b)),
            *arc(turn, (a - r, r - b), r, 3.0 * quarter, quarter),
            *line(turn, (a, r - b), (a, 0.0)),
        ]

    def core(self) -> list[Piece]:
        """Along the longer half, from the centre; in a square there is none."""
        a, b = self.half_a_mm - self.reach_mm, self.half_b_mm - self.reach_mm
        return line(self.turn, (0.0, 0.0), (a, b))


@dataclass(frozen=True, slots=True)
class Circle:
    """Cycle 252."""

    radius_mm: float
    turn: Turn

    @property
    def reach_mm(self) -> float:
        return self.radius_mm

    @property
    def start(self) -> Point:
        return self.turn.point(0.0, 0.0)

    def contour(self, inset_mm: float) -> list[Piece]:
        return arc(self.turn, (0.0, 0.0), max(self.radius_mm - inset_mm, 0.0), 0.0, math.tau)

    def core(self) -> list[Piece]:
        return []


@dataclass(frozen=True, slots=True)
class Slot:
    """Cycle 253: half the distance of the centres of its two ends, and half its width."""

    half_mm: float
    radius_mm: float
    turn: Turn

    @property
    def reach_mm(self) -> float:
        return self.radius_mm

    @property
    def start(self) -> Point:
        return self.turn.point(-self.half_mm, 0.0)

    def contour(self, inset_mm: float) -> list[Piece]:
        h, r, quarter = self.half_mm, max(self.radius_mm - inset_mm, 0.0), math.pi / 2.0
        return [
            *arc(self.turn, (h, 0.0), r, 0.0, quarter),
            *line(self.turn, (h, r), (-h, r)),
            *arc(self.turn, (-h, 0.0), r, quarter, 2.0 * quarter),
            *line(self.turn, (-h, -r), (h, -r)),
            *arc(self.turn, (h, 0.0), r, -quarter, quarter),
        ]

    def core(self) -> list[Piece]:
        return line(self.turn, (-self.half_mm, 0.0), (self.half_mm, 0.0))


@dataclass(frozen=True, slots=True)
class RoundSlot:
    """Cycle 254: radius of the pitch circle, half the width, and the angles of the centres of its two ends."""

    pitch_mm: float
    radius_mm: float
    begin_rad: float
    opening_rad: float
    turn: Turn

    @property
    def reach_mm(self) -> float:
        return self.radius_mm

    @property
    def start(self) -> Point:
        return self.turn.point(*self.end_centre(self.begin_rad))

    def end_centre(self, angle_rad: float) -> Point:
        return (self.pitch_mm * math.cos(angle_rad), self.pitch_mm * math.sin(angle_rad))

    def contour(self, inset_mm: float) -> list[Piece]:
        r, begin, end = max(self.radius_mm - inset_mm, 0.0), self.begin_rad, self.begin_rad + self.opening_rad
        turn = self.turn
        return [
            *arc(turn, (0.0, 0.0), self.pitch_mm + r, begin, self.opening_rad),
            *arc(turn, self.end_centre(end), r, end, math.pi),
            *arc(turn, (0.0, 0.0), self.pitch_mm - r, end, -self.opening_rad),
            *arc(turn, self.end_centre(begin), r, begin + math.pi, math.pi),
        ]

    def core(self) -> list[Piece]:
        return arc(self.turn, (0.0, 0.0), self.pitch_mm, self.begin_rad, self.opening_rad)
