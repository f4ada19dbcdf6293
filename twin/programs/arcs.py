"""The centre and sweep of a programmed arc.

R form: the centre lies on the perpendicular bisector of the chord, at √(R² − (chord/2)²) from it; R > 0 takes the arc of at most
180°, R < 0 the longer one. I, J, K form: the centre is given from the start; end on start is a full circle.
"""

import math
from typing import NamedTuple

from twin.programs.refusal import RefusedError

SAME_POINT_MM = 1e-6
"""Two points nearer than this are one: far below the least increment, far above the rounding of sums."""

Point = tuple[float, float]


class Sweep(NamedTuple):
    """Centre in the plane, and the signed angle from start to end: + counter-clockwise."""

    centre: Point
    sweep_rad: float


def sweep_about(start: Point, end: Point, centre: Point, clockwise: bool) -> float:
    """Signed angle from start to end about the centre; 2π where they are one point.

    >>> round(math.degrees(sweep_about((1.0, 0.0), (0.0, 1.0), (0.0, 0.0), clockwise=True)))
    -270
    """
    if math.hypot(end[0] - start[0], end[1] - start[1]) < SAME_POINT_MM:
        return -math.tau if clockwise else math.tau
    start_angle = math.atan2(start[1] - centre[1], start[0] - centre[0])
    end_angle = math.atan2(end[1] - centre[1], end[0] - centre[0])
    if clockwise:
        return -(((start_angle - end_angle) % math.tau) or math.tau)
    return ((end_angle - start_angle) % math.tau) or math.tau


def by_radius(start: Point, end: Point, radius: float, clockwise: bool, error_mm_max: float) -> Sweep:
    """The R form. RefusedError where the chord is longer than the diameter, or has no length.

    >>> by_radius((0.0, 0.0), (2.0, 0.0), 1.0, False, 0.01).centre
    (1.0, 0.0)
    """
    chord_a, chord_b = end[0] - start[0], end[1] - start[1]
    chord = math.hypot(chord_a, chord_b)
    if chord < SAME_POINT_MM:
        raise RefusedError("R", "start and end are one point: write I, J, K for a full circle")
    if radius == 0.0:
        raise RefusedError("R", "an arc of radius 0; write the radius, or G1")
    square = radius * radius - chord * chord / 4.0
    if square < 0.0:
        if chord / 2.0 - abs(radius) > error_mm_max:
            raise RefusedError("R", f"the end is {chord:g} mm away, more than the diameter {2 * abs(radius):g} mm")
        square = 0.0
    # The centre of a short counter-clockwise arc is to the left of its chord.
    height = math.sqrt(square) * (1.0 if (radius > 0) != clockwise else -1.0)
    centre = (
        start[0] + chord_a / 2.0 - chord_b / chord * height,
        start[1] + chord_b / 2.0 + chord_a / chord * height,
    )
    return Sweep(centre, sweep_about(start, end, centre, clockwise))


def by_centre(start: Point, end: Point, centre: Point, clockwise: bool, error_mm_max: float, pole: str = "") -> Sweep:
    """The I, J, K form. RefusedError where start and end are not equally far from the centre.

    pole: the word that sets the centre, in a language that has no I, J, K

    >>> round(by_centre((1.0, 0.0), (1.0, 0.0), (0.0, 0.0), False, 0.01).sweep_rad, 4)
    6.2832
    """
    start_radius = math.hypot(start[0] - centre[0], start[1] - centre[1])
    end_radius = math.hypot(end[0] - centre[0], end[1] - centre[1])
    if start_radius < SAME_POINT_MM:
        way_out = f"correct {pole} or the start" if pole else "write I, J or K of the plane, or R"
        raise RefusedError("", f"the centre of this arc is its start; {way_out}")
    if abs(start_radius - end_radius) > error_mm_max:
        raise RefusedError(
            "",
            f"the end of this arc is {end_radius:g} mm from its centre, its start {start_radius:g}; "
            f"correct {pole or 'I, J, K'} or the end",
        )
    return Sweep(centre, sweep_about(start, end, centre, clockwise))


def arc_length(start: Point, centre: Point, sweep_rad: float, rise: float) -> float:
    """Length of an arc or helix."""
    return math.hypot(math.hypot(start[0] - centre[0], start[1] - centre[1]) * sweep_rad, rise)
