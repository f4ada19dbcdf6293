"""Cutter compensation: corners by hand, and what holds for any contour."""

import math
import random
from itertools import pairwise

import pytest
from hypothesis import given
from hypothesis import strategies as st

from tests.twin.programs.fanuc.contours import contour
from twin.errors import PartProgramError
from twin.programs import Arc, LeadIn, Linear, OutsideCorner, Rapid, Settings, ToolOffset
from twin.programs.fanuc.interpreter import interpret

TOOLS = {1: ToolOffset(radius_mm=5.0), 2: ToolOffset(radius_mm=4.0, radius_wear_mm=1.0), 3: ToolOffset(radius_mm=-5.0)}
LINES = Settings(tool_offsets=TOOLS)
ARCS = Settings(tool_offsets=TOOLS, outside_corner=OutsideCorner.ARC)


def ends(text: str, settings: Settings = LINES) -> list[tuple[float, ...]]:
    return [
        tuple(round(a, 4) + 0.0 for a in m.end_mm[:2]) for m in interpret(text, settings) if isinstance(m, Rapid | Linear | Arc)
    ]


SQUARE = "G0 X-20 Y-20\n{} G1 X0 Y0 F100\nY40\nX40\nY0\nX0\nG40 {}\nM30"


def test_outside_of_a_square_goes_by_the_crossings_of_its_tangents() -> None:
    found = ends(SQUARE.format("G41 D1", "X-20"))
    assert found == [(-20, -20), (-5, 0), (-5, 45), (45, 45), (45, -5), (0, -5), (-20, 0)]


def test_inside_of_a_square_ends_where_the_parallels_cross() -> None:
    assert ends(SQUARE.format("G42 D1", "Y-20")) == [(-20, -20), (5, 0), (5, 35), (35, 35), (35, 5), (0, 5), (0, -20)]


def test_outside_corners_may_be_arcs_about_the_corner() -> None:
    moves = interpret(SQUARE.format("G41 D1", "X-20"), ARCS)
    corner = next(move for move in moves if isinstance(move, Arc))
    assert corner.centre_mm == (0.0, 40.0, 0.0)
    assert corner.end_mm == pytest.approx((0.0, 45.0, 0.0))
    assert corner.sweep_rad == pytest.approx(-math.pi / 2)


def test_a_sharp_outside_corner_is_rounded_on_two_points() -> None:
    # Along x to (40, 0), then back at 180° - 2 · 22.5°: each tangent is followed by one radius, then a straight line.
    text = "G0 X-20\nG42 D1 G1 X0 Y0 F100\nX40\nX0 Y40\nG40 X0 Y60"
    slanted = (40 + 5 * math.sqrt(0.5) + 5 * math.sqrt(0.5), 0.0)
    assert ends(text)[2:4] == [(45.0, -5.0), pytest.approx(slanted, abs=1e-4)]


def test_wear_counts_and_a_negative_radius_is_the_other_side() -> None:
    assert ends(SQUARE.format("G41 D2", "X-20")) == ends(SQUARE.format("G41 D1", "X-20"))
    assert ends(SQUARE.format("G42 D3", "X-20")) == ends(SQUARE.format("G41 D1", "X-20"))


def test_an_arc_keeps_its_centre_and_changes_its_radius() -> None:
    text = "G0 X-40\nG41 D1 G1 X-20 Y0 F100\nG2 X-20 Y0 I20 J0\nG40 G1 X-40"
    (arc,) = (move for move in interpret(text, LINES) if isinstance(move, Arc))
    assert arc.centre_mm == (0.0, 0.0, 0.0)
    assert arc.end_mm == pytest.approx((-25.0, 0.0, 0.0))
    assert arc.sweep_rad == pytest.approx(-math.tau)


def test_a_line_meets_an_arc_inside() -> None:
    # A tool 5 mm in radius between the line y = 0 and the circle of radius 20 about the origin, from inside: y = 5, 15 from it.
    text = "G0 X-10 Y-5\nG41 D1 G1 X-10 Y0 F100\nX20\nG3 X0 Y20 I-20\nG40 G1 X0 Y0"
    assert ends(text)[2] == pytest.approx((math.sqrt(15**2 - 5**2), 5.0), abs=1e-4)


def test_the_lead_in_may_be_square_to_itself() -> None:
    text = "G0 X-20 Y0\nG41 D1 G1 X0 Y0 F100\nY-40\nG40 X20"
    assert ends(text)[1] == (5, 0)
    assert ends(text, Settings(tool_offsets=TOOLS, lead_in=LeadIn.OWN))[1] == (5, 5)


def test_a_move_along_the_tool_stays_at_the_corner() -> None:
    moves = interpret("G0 X-20\nG42 D1 G1 X0 Y0 F100\nX40\nZ-3\nY40\nG40 X0 Y60", LINES)
    assert [move.end_mm for move in moves if isinstance(move, Linear)][1:4] == [
        pytest.approx(end) for end in ((45.0, -5.0, 0.0), (45.0, -5.0, -3.0), (45.0, 40.0, -3.0))
    ]


def test_the_side_may_change_on_the_way() -> None:
    found = ends("G0 X-20\nG41 D1 G1 X0 Y0 F100\nX40\nG42 X80\nG40 X100")
    assert found == [(-20, 0), (0, 5), (40, 5), (40, -5), (80, -5), (100, 0)]


def test_a_cancelled_compensation_without_a_move_leaves_the_tool_where_it_is() -> None:
    assert ends("G0 X-20\nG41 D1 G1 X0 Y0 F100\nX40\nG40\nG91 G28 Z0\nM30")[2:] == [(40, 5), (40, 5), (40, 5)]


@pytest.mark.parametrize(
    ("text", "line", "reason"),
    [
        ("G0 X-20\nG42 D1 G1 X0 Y0 F100\nY40\nX8\nY0\nG40 X0", 5, "gouge"),
        ("G0 X-20\nG41 D1 G1 X0 F100\nG3 X8 I4\nG40 G1 X20", 3, "does not fit"),
        ("G0 X-20\nG41 D1\nG2 X0 R30 F100", 3, "straight"),
        ("G0 X-20\nG41 D1 G1 X0 F100\nX20\nG40 G2 X40 R30", 4, "straight"),
        ("G41 D9 G1 X0 F100", 1, "no number 9"),
        ("G41 D1 G1 X10 F100\nD2", 2, "cannot change"),
        ("G41 D1 G1 X10 F100\nG28 X0", 2, "cancel with G40"),
        ("G41 D1 G1 X10 F100\nG18 X20", 2, "plane cannot change"),
        ("G41 D1 G1 X10 F100\nG81 X20 Z-1 R1", 2, "cancel with G40"),
    ],
)
def test_what_the_tool_cannot_do_is_refused(text: str, line: int, reason: str) -> None:
    with pytest.raises(PartProgramError, match=reason) as caught:
        interpret(text, LINES)
    assert caught.value.line == line


@given(st.randoms(use_true_random=False), st.sampled_from(OutsideCorner), st.sampled_from(LeadIn))
def test_every_arc_of_a_compensated_contour_begins_and_ends_on_its_circle(
    chance: random.Random, corner: OutsideCorner, lead_in: LeadIn
) -> None:
    here: tuple[float, ...] = (0.0, 0.0, 0.0)
    for move in interpret(contour(chance), Settings(tool_offsets=TOOLS, outside_corner=corner, lead_in=lead_in)):
        if isinstance(move, Arc):
            radius = math.dist(here[:2], move.centre_mm[:2])
            angle = math.atan2(here[1] - move.centre_mm[1], here[0] - move.centre_mm[0]) + move.sweep_rad
            end = (move.centre_mm[0] + radius * math.cos(angle), move.centre_mm[1] + radius * math.sin(angle))
            assert math.dist(end, move.end_mm[:2]) < 1e-3
        if isinstance(move, Rapid | Linear | Arc):
            here = move.end_mm


@given(st.integers(3, 12), st.floats(30.0, 80.0), st.booleans(), st.sampled_from([LINES, ARCS]))
def test_the_tool_keeps_its_distance_from_a_polygon(sides: int, size: float, left: bool, settings: Settings) -> None:
    corners = [(size * math.cos(math.tau * k / sides), size * math.sin(math.tau * k / sides)) for k in range(sides)]
    middle = ((corners[0][0] + corners[1][0]) / 2, (corners[0][1] + corners[1][1]) / 2)
    corners = [(round(x, 4), round(y, 4)) for x, y in (middle, *corners[1:], corners[0], middle)]
    path = "\n".join(f"G1 X{x:.4f} Y{y:.4f} F100" for x, y in corners)
    moves = interpret(f"G0 X200\nG{41 if left else 42} D1 {path}\nG40 X200", settings)
    cuts = [move for move in moves if isinstance(move, Linear | Arc)][1:-1]
    for move in cuts:
        x, y, _ = move.end_mm
        nearest = min(distance_to((x, y), a, b) for a, b in pairwise(corners))
        assert nearest > 5.0 - 1e-3


def distance_to(point: tuple[float, float], a: tuple[float, float], b: tuple[float, float]) -> float:
    along = ((point[0] - a[0]) * (b[0] - a[0]) + (point[1] - a[1]) * (b[1] - a[1])) / math.dist(a, b) ** 2
    along = min(max(along, 0.0), 1.0)
    return math.dist(point, (a[0] + along * (b[0] - a[0]), a[1] + along * (b[1] - a[1])))
