"""Engagement whose angles are known in closed form. R = 3 mm throughout, angles in rad.

Tolerances: heights are exact for the polyline, so along straight lines an angle is good to 1e-6 rad (0.0001°). On an arc the
chords of 0.05 mm put a wall off by c² / 8ρ, which is an angle of that over R sin φ.
"""

import math

import numpy as np
import pytest
from numpy.typing import NDArray

from tests.twin.engagement.whole_stock import engagement
from twin.engagement import Engagement, Workpiece, cut
from twin.machine import Stock

R = 3.0
DIAMETER = 2 * R
PLATE = Stock(min_mm=(0.0, 0.0, -10.0), max_mm=(60.0, 60.0, 0.0))
EXACT = 1e-6
CHORD = 0.05


def circle(radius: float, z: float, start: float = 0.0, sweep: float = 2 * math.pi, chord: float = CHORD) -> NDArray[np.float64]:
    """An arc about the centre of the plate."""
    angle = start + np.linspace(0.0, sweep, 1 + math.ceil(abs(sweep) * radius / chord))
    return np.column_stack((30 + radius * np.cos(angle), 30 + radius * np.sin(angle), np.full(len(angle), z)))


def between(rows: Engagement, axis: int, low: float, high: float) -> NDArray[np.bool_]:
    return (rows.position_mm[:, axis] > low) & (rows.position_mm[:, axis] < high)


def test_a_slot_is_zero_to_pi_all_along() -> None:
    rows = engagement([(10, 15, -2), (30, 15, -2)], DIAMETER, PLATE)
    assert len(rows) == 200
    assert np.all(rows.axial_depth_mm == 2.0)
    assert np.all(rows.entry_angle_rad == 0.0)
    assert np.all(rows.exit_angle_rad == math.pi)
    assert rows.section_mm2 == pytest.approx(np.full(200, 12.0))
    assert rows.exact.all()
    assert rows.engaged.all()


@pytest.mark.parametrize("degrees", [0.0, 17.0, 45.0, 90.0, 133.0, 180.0, 270.0])
def test_a_slot_is_zero_to_pi_in_every_direction(degrees: float) -> None:
    heading = np.array([math.cos(math.radians(degrees)), math.sin(math.radians(degrees)), 0.0])
    rows = engagement(np.array([30.0, 30.0, -1.0]) + np.array([[0.0], [15.0]]) * heading, DIAMETER, PLATE)
    assert np.all(rows.entry_angle_rad == 0.0)
    assert np.all(rows.exit_angle_rad == math.pi)


@pytest.mark.parametrize("radius", [3.5, 5.0, 10.0, 20.0])
@pytest.mark.parametrize("turn", [1.0, -1.0], ids=["counter-clockwise", "clockwise"])
@pytest.mark.parametrize("chord", [0.05, 0.5])
def test_a_slot_on_an_arc_is_zero_to_pi(radius: float, turn: float, chord: float) -> None:
    rows = engagement(circle(radius, -1.0, sweep=turn * math.pi, chord=chord), DIAMETER, PLATE, resolution_mm=chord)
    assert np.all(rows.entry_angle_rad == 0.0)
    assert np.all(rows.exit_angle_rad == math.pi)


@pytest.mark.parametrize("width", [0.03, 0.3, 1.0, 3.0, 4.5, 5.9])
def test_a_shoulder_on_the_left_is_up_milling(width: float) -> None:
    rows = engagement([(-10, width - R, -2), (70, width - R, -2)], DIAMETER, PLATE, resolution_mm=0.5)
    inside = between(rows, 0, 5.0, 55.0)
    assert rows.entry_angle_rad[inside] == pytest.approx(0.0, abs=0)
    assert rows.exit_angle_rad[inside] == pytest.approx(math.acos(1 - width / R), abs=EXACT)
    assert rows.section_mm2[inside] == pytest.approx(2.0 * width, rel=1e-6)


@pytest.mark.parametrize("width", [0.03, 0.3, 1.0, 3.0, 4.5, 5.9])
def test_a_shoulder_on_the_right_is_down_milling(width: float) -> None:
    rows = engagement([(70, width - R, -2), (-10, width - R, -2)], DIAMETER, PLATE, resolution_mm=0.5)
    inside = between(rows, 0, 5.0, 55.0)
    assert rows.entry_angle_rad[inside] == pytest.approx(math.pi - math.acos(1 - width / R), abs=EXACT)
    assert np.all(rows.exit_angle_rad[inside] == math.pi)
    assert rows.section_mm2[inside] == pytest.approx(2.0 * width, rel=1e-6)


@pytest.mark.parametrize("radius", [4.0, 8.0, 20.0])
@pytest.mark.parametrize("width", [0.2, 1.0, 2.5])
def test_a_concave_wall_takes_more_of_the_rim_than_a_straight_one(radius: float, width: float) -> None:
    # A round pocket of radius W, widened on a circle of radius ρ counter-clockwise: the material, on the right, is where the rim
    # is more than W from the centre. ρ² + R² − 2 ρ R cos φ > W².
    left, _ = cut(Workpiece.of(PLATE, 0.4), circle(radius - width, -2.0), DIAMETER)
    clear = radius - width + R
    _, rows = cut(left, circle(radius, -2.0, sweep=math.pi, chord=0.1), DIAMETER)
    expected = math.acos((radius**2 + R**2 - clear**2) / (2 * radius * R))
    assert expected < math.pi - math.acos(1 - width / R)
    assert rows.entry_angle_rad[20:] == pytest.approx(expected, abs=math.radians(0.2))
    assert np.all(rows.exit_angle_rad[20:] == math.pi)


@pytest.mark.parametrize("radius", [6.0, 10.0, 20.0])
@pytest.mark.parametrize("width", [0.2, 1.0, 2.5])
def test_a_convex_wall_takes_less_of_the_rim_than_a_straight_one(radius: float, width: float) -> None:
    # Round an island of radius W = ρ + a_e − R, counter-clockwise: the material, on the left, is where the rim is nearer than W.
    left, _ = cut(Workpiece.of(PLATE, 0.4), circle(radius + width, -2.0), DIAMETER)
    island = radius + width - R
    _, rows = cut(left, circle(radius, -2.0, sweep=math.pi, chord=0.1), DIAMETER)
    expected = math.acos((radius**2 + R**2 - island**2) / (2 * radius * R))
    assert expected < math.acos(1 - width / R)
    assert np.all(rows.entry_angle_rad[20:] == 0.0)
    assert rows.exit_angle_rad[20:] == pytest.approx(expected, abs=math.radians(0.2))


def test_on_a_circle_tighter_than_the_tool_the_rim_meets_its_own_way_after_half_a_turn() -> None:
    # A rim point ahead by β = atan2(R sin φ, ρ − R cos φ) was reached before if the turn θ is past 2π − 2β.
    radius = 2.0
    path = circle(radius, -1.0, sweep=1.5 * math.pi)
    rows = engagement(path, DIAMETER, PLATE)
    turn = rows.start_mm[-1] / radius + rows.length_mm[-1] / 2 / radius
    entry = rows.entry_angle_rad[-1]
    ahead = math.atan2(R * math.sin(entry), radius - R * math.cos(entry))
    assert turn == pytest.approx(2 * math.pi - 2 * ahead, abs=math.radians(0.5) + CHORD / radius)
    assert rows.exit_angle_rad[-1] == math.pi


def test_coming_in_from_air_the_arc_opens_from_the_front() -> None:
    rows = engagement([(-5, 30, -2), (5, 30, -2)], DIAMETER, PLATE)
    x = rows.position_mm[:, 0]
    outside = x < -R
    assert not rows.engaged[outside].any()
    opening = (x > -R + 0.06) & (x < 0)
    expected = np.arcsin(-x[opening] / R)
    assert rows.entry_angle_rad[opening] == pytest.approx(expected, abs=EXACT)
    assert rows.exit_angle_rad[opening] == pytest.approx(math.pi - expected, abs=EXACT)
    assert np.all(rows.exit_angle_rad[x > 0] == math.pi)


def test_going_out_the_front_is_free_first_and_two_arcs_are_left() -> None:
    rows = engagement([(50, 30, -2), (65, 30, -2)], DIAMETER, PLATE)
    x = rows.position_mm[:, 0]
    leaving = (x > 57.06) & (x < 59.95)
    arc = np.arcsin((60 - x[leaving]) / R)
    assert np.all(rows.arcs[leaving] == 2)
    assert not rows.exact[leaving].any()
    assert rows.section_mm2[leaving] == pytest.approx(2.0 * 2 * R * (1 - np.cos(arc)), rel=1e-4)
    assert not rows.engaged[x > 60].any()


def test_a_second_pass_over_a_slot_meets_nothing() -> None:
    rows = engagement([(10, 15, -2), (30, 15, -2), (10, 15, -2), (30, 15, -2)], DIAMETER, PLATE)
    assert not rows.engaged[rows.segment > 0].any()


def test_a_second_round_of_a_circle_meets_nothing_although_its_chords_are_others() -> None:
    left, _ = cut(Workpiece.of(PLATE, 0.4), circle(10.0, -2.0), DIAMETER)
    _, rows = cut(left, circle(10.0, -2.0, start=0.7, chord=0.03), DIAMETER)
    assert not rows.engaged.any()


def test_layers_have_the_depth_of_the_step() -> None:
    rows = engagement([(10, 15, -1), (40, 15, -1), (40, 15, -3), (10, 15, -3)], DIAMETER, PLATE)
    assert np.all(rows.axial_depth_mm[rows.segment == 0] == 1.0)
    assert rows.axial_depth_mm[rows.segment == 2] == pytest.approx(2.0)
    assert np.all(rows.exit_angle_rad[rows.segment == 2] == math.pi)


def test_a_pattern_with_a_stepover_goes_up_and_down_in_turn() -> None:
    stepover = 2.0
    path = [(10, 10, -1.5)]
    for lane in range(1, 7):
        path += [(50 if lane % 2 else 10, path[-1][1], -1.5), (50 if lane % 2 else 10, 10 + lane * stepover, -1.5)]
    rows = engagement(path, DIAMETER, PLATE, resolution_mm=0.5)
    inside, arc = between(rows, 0, 14.0, 46.0), math.acos(1 - stepover / R)
    for lane in range(1, 6):
        along = inside & (rows.segment == 2 * lane)
        left_of_heading = lane % 2 == 0
        assert rows.entry_angle_rad[along] == pytest.approx(0.0 if left_of_heading else math.pi - arc, abs=EXACT)
        assert rows.exit_angle_rad[along] == pytest.approx(arc if left_of_heading else math.pi, abs=EXACT)
        assert rows.axial_depth_mm[along] == pytest.approx(1.5)


def test_towards_the_corner_of_a_pocket_the_arc_grows() -> None:
    # The pocket ends at y = 20 − R below and x = 40 + R on the right, with the tool's radius in its corner; the pass 1 mm outside
    # of it, heading +x, has material at its right and, near the corner, in front.
    left, _ = cut(Workpiece.of(PLATE, 0.4), [(10, 20, -2), (40, 20, -2), (40, 50, -2)], DIAMETER)
    _, rows = cut(left, [(15, 19, -2), (41, 19, -2), (41, 50, -2)], DIAMETER)
    along = rows.segment == 0
    far = along & (rows.position_mm[:, 0] < 36.0)
    assert rows.entry_angle_rad[far] == pytest.approx(math.pi - math.acos(1 - 1 / R), abs=EXACT)
    # Past x = 40 the rim is cut off by the circle of radius R about (40, 20): two equal circles cross on the middle line of their
    # centres, at ±acos(d / 2R) from the line through them, and by the wall x = 43 above it.
    last = int(np.flatnonzero(along)[-1])
    x, y = rows.position_mm[last, 0], rows.position_mm[last, 1]
    away = math.atan2(y - 20, x - 40)
    ends = [away + side * math.acos(math.hypot(x - 40, y - 20) / (2 * R)) for side in (1, -1)]
    crossing = max(ends)
    point = (x + R * math.cos(crossing), y + R * math.sin(crossing))
    if point[1] < 20:  # on the quarter of the circle that the pocket's corner is
        assert rows.entry_angle_rad[last] == pytest.approx(math.pi / 2 - crossing, abs=EXACT)
    else:
        assert rows.entry_angle_rad[last] == pytest.approx(math.pi / 2 - math.acos((43 - x) / R), abs=EXACT)
    assert rows.exit_angle_rad[last] == math.pi


def test_a_step_beside_the_tool_keeps_mean_power_and_force() -> None:
    # The right half of the rim finds 1 mm, the left half 2 mm: ∫ a sin = 3, ∫ a sin cos = 1/2, ∫ a sin² = 3π/4 (rectangle.py: the
    # last one is out of reach for one arc here, and 7 % off).
    left, _ = cut(Workpiece.of(PLATE, 0.4), [(10, 20, -1), (50, 20, -1)], DIAMETER)
    _, rows = cut(left, [(20, 23, -2), (40, 23, -2)], DIAMETER)
    row = 100
    depth, entry, leave = rows.axial_depth_mm[row], rows.entry_angle_rad[row], rows.exit_angle_rad[row]
    assert not rows.exact[row]
    assert rows.arcs[row] == 1
    assert rows.deepest_mm[row] == pytest.approx(2.0)
    assert rows.section_mm2[row] == pytest.approx(3.0 * R, rel=1e-5)
    assert depth * (math.cos(entry) - math.cos(leave)) == pytest.approx(3.0, rel=1e-5)
    assert depth * (math.sin(leave) ** 2 - math.sin(entry) ** 2) / 2 == pytest.approx(0.5, rel=1e-5)
    assert depth * (leave - entry - (math.sin(2 * leave) - math.sin(2 * entry)) / 2) / 2 == pytest.approx(
        0.75 * math.pi, rel=0.07
    )
