"""Plunges, ramps, retractions and rapids, each with its figure."""

import math

import numpy as np
import pytest

from tests.twin.engagement.whole_stock import engagement
from twin.engagement import Workpiece, cut
from twin.engagement.along_path import PathRows
from twin.machine import Stock

R = 3.0
FACE = math.pi * R * R
PLATE = Stock(min_mm=(0.0, 0.0, -10.0), max_mm=(60.0, 60.0, 0.0))


def test_a_plunge_has_no_depth_and_the_whole_end_face() -> None:
    rows = engagement([(30, 30, 1), (30, 30, -2)], 2 * R, PLATE)
    inside = rows.start_mm + rows.length_mm > 1.0 + 1e-9
    assert not rows.engaged.any()
    assert np.all(rows.axial_depth_mm == 0.0)
    assert np.array_equal(rows.plunging, inside)
    assert rows.end_face_mm2[inside] == pytest.approx(FACE)
    assert rows.removed_mm3.sum() == pytest.approx(2 * FACE)


def test_a_plunge_half_beside_the_stock_has_half_the_end_face() -> None:
    rows = engagement([(0, 30, 0), (0, 30, -2)], 2 * R, PLATE)
    assert rows.end_face_mm2 == pytest.approx(FACE / 2, rel=0.03)


def test_a_retraction_meets_nothing_wherever_it_begins() -> None:
    rows = engagement([(10, 30, -2), (30, 30, -2), (30, 30, 5), (10, 30, 5)], 2 * R, PLATE, cutting=[True, False, False])
    assert not rows.engaged[rows.segment > 0].any()
    assert rows.collisions == ()


def test_a_ramp_cuts_with_rim_and_end_face() -> None:
    rows = engagement([(10, 30, 0), (50, 30, -4)], 2 * R, PLATE)
    middle = -rows.position_mm[:, 2]
    assert rows.axial_depth_mm == pytest.approx(middle)
    assert np.all(rows.entry_angle_rad == 0.0)
    assert np.all(rows.exit_angle_rad == math.pi)
    assert rows.end_face_mm2[1:] == pytest.approx(FACE)


def test_a_ramp_removes_what_is_missing() -> None:
    whole = Workpiece.of(PLATE, 0.4)
    left, rows = cut(whole, [(10, 30, 0), (50, 30, -4), (10, 30, -8), (50, 30, -8)], 2 * R)
    assert rows.removed_mm3.sum() == pytest.approx(whole.volume_mm3() - left.volume_mm3(), rel=0.005)


def test_after_a_ramp_the_way_back_up_meets_only_what_the_end_face_left() -> None:
    # Going back up the same line, the material in front is the ramp's own floor, lower than the end face everywhere.
    rows = engagement([(10, 30, -0.001), (50, 30, -4), (10, 30, -0.001)], 2 * R, PLATE)
    assert not rows.engaged[rows.segment == 1].any()


def test_a_ramp_into_air_begins_to_cut_where_it_passes_the_surface() -> None:
    rows = engagement([(10, 30, 2), (50, 30, -2)], 2 * R, PLATE)
    assert np.array_equal(rows.engaged, rows.position_mm[:, 2] < -1e-4)


def test_a_cut_below_the_stock_has_the_depth_of_the_stock() -> None:
    rows = engagement([(10, 30, -12), (50, 30, -12)], 2 * R, PLATE)
    assert rows.axial_depth_mm == pytest.approx(10.0)


def test_a_rapid_through_the_stock_is_a_collision_with_its_place() -> None:
    path = [(10, 30, 5), (10, 30, 0), (10, 30, -1), (20, 30, -1), (40, 30, -1), (40, 30, 5)]
    rows = engagement(path, 2 * R, PLATE, cutting=[False, True, True, False, False])
    (collision,) = rows.collisions
    assert collision.segment == 3
    assert collision.path_mm == pytest.approx(5 + 1 + 10)
    assert collision.position_mm == pytest.approx((20.05, 30, -1))


def test_a_rapid_down_into_the_stock_is_a_collision() -> None:
    rows = engagement([(30, 30, 2), (30, 30, -1)], 2 * R, PLATE, cutting=[False])
    assert [collision.segment for collision in rows.collisions] == [0]


def test_a_rapid_over_the_surface_and_in_a_cut_slot_is_none() -> None:
    path = [(10, 30, -1), (40, 30, -1), (10, 30, -1), (10, 30, 0), (50, 50, 0)]
    rows = engagement(path, 2 * R, PLATE, cutting=[True, False, False, False])
    assert rows.collisions == ()


def test_a_rapid_down_along_a_finished_wall_is_none() -> None:
    path = [(10, 30, -4), (40, 30, -4), (40, 30, 5), (20, 30, 5), (20, 30, -4)]
    rows = engagement(path, 2 * R, PLATE, cutting=[True, False, False, False])
    assert rows.collisions == ()


def test_without_a_stock_nothing_is_engaged() -> None:
    rows = engagement([(10, 30, -1), (40, 30, -1), (40, 30, -3)], 2 * R, None, cutting=[True, False])
    assert not rows.engaged.any()
    assert not rows.plunging.any()
    assert rows.collisions == ()


def test_a_move_of_no_length_has_a_row_of_nothing() -> None:
    rows = engagement([(10, 30, -1), (10, 30, -1), (20, 30, -1)], 2 * R, PLATE)
    assert rows.length_mm[0] == 0.0
    assert not rows.engaged[0]
    assert rows.engaged[1:].all()


def test_rows_are_found_by_segment_and_share_of_its_length() -> None:
    rows = engagement([(10, 30, -1), (20, 30, -1), (20, 31, -1)], 2 * R, PLATE, resolution_mm=1.0)
    assert len(rows) == 11
    arc = rows.entry_angle_rad, rows.exit_angle_rad
    of_path = PathRows(rows.first_row, rows.segment, rows.axial_depth_mm, *arc, rows.length_mm, rows.end_face_mm2, ())
    there = of_path.row_at(np.array([0, 0, 0, 1, 1]), np.array([0.0, 0.55, 1.0, 0.0, 1.0]))
    assert there.tolist() == [0, 5, 9, 10, 10]
    assert rows.start_mm.tolist() == [float(k) for k in range(11)]
