"""Coordinate systems, rotation, scaling, polar coordinates, lengths: figures worked out by hand."""

from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from twin.errors import PartProgramError, TwinError
from twin.programs import Arc, Linear, Move, Rapid, Settings, ToolOffset
from twin.programs.fanuc.interpreter import interpret

WORK = Settings(
    work_offsets_mm={"G54": (10.0, 0.0, 0.0), "G55": (0.0, 20.0, 0.0), "G54.1 P7": (0.0, 0.0, 30.0), "external": (0.0, 0.0, 1.0)},
    tool_offsets={3: ToolOffset(length_mm=50.0, length_wear_mm=-0.5)},
    references_mm=((0.0, 0.0, 100.0), (7.0, 8.0, 90.0)),
)


def ends(text: str, settings: Settings | None = None) -> list[tuple[float, ...]]:
    moves: list[Move] = interpret(text, settings)
    return [tuple(round(a, 6) + 0.0 for a in move.end_mm) for move in moves if isinstance(move, Rapid | Linear | Arc)]


@pytest.mark.parametrize(
    ("text", "expected"),
    [
        ("G54 G0 X1 Y1 Z1\nG55 X1 Y1\nG54.1 P7 X1 Z1", [(11, 1, 2), (1, 21, 2), (1, 21, 32)]),
        ("G43 H3 G0 Z5\nG49 Z5\nG44 H3 Z5\nH0 Z5", [(0, 0, 55.5), (0, 0, 6), (0, 0, -43.5), (0, 0, 6)]),
        ("G0 X1\nG52 X5 Y5\nX1 Y1\nG55 X1\nG52 X0 Y0\nG54 X1 Y1", [(11, 0, 0), (16, 6, 0), (6, 6, 0), (11, 1, 0)]),
        ("G0 X5\nG92 X0\nX1\nG55 X1\nG92.1 X0\nX1", [(15, 0, 0), (16, 0, 0), (6, 0, 0), (1, 0, 0)]),
        ("G10 L2 P1 X3\nG0 X1\nG91 G10 L2 P1 X2\nG90 X1", [(4, 0, 0), (6, 0, 0)]),
        ("G10 L20 P2 Y9\nG54.1 P2 G0 Y1\nG10 L2 P0 Z0\nZ0", [(0, 10, 0), (0, 10, 0)]),
        ("G10 L10 P4 R20\nG10 L11 P4 R-1\nG43 H4 G0 Z0\nG91 G10 L11 P4 R3\nG90 Z0", [(0, 0, 20), (0, 0, 23)]),
        ("G91 G28 Z5\nG90 G53 X0\nG30 P2 X0 Y0", [(0, 0, 5), (0, 0, 100), (0, 0, 100), (10, 0, 100), (7, 8, 100)]),
    ],
    ids=["work", "length", "local", "declared", "G10 L2", "G10 L20", "G10 L10", "references"],
)
def test_offsets_add_up(text: str, expected: list[tuple[float, ...]]) -> None:
    assert ends(text, WORK) == [tuple(map(float, wanted)) for wanted in expected]


def test_a_length_that_the_table_has_not_got_is_refused_and_without_a_table_it_is_none() -> None:
    with pytest.raises(PartProgramError, match="no number 9"):
        interpret("G43 H9 G0 Z5", WORK)
    assert ends("G43 H9 G0 Z5") == [(0, 0, 5)]


def test_a_rotation_turns_positions_and_arcs_about_its_centre() -> None:
    # (20, 10) is 10 to the right of the centre (10, 10); turned by 90° it is 10 above it.
    assert ends("G68 X10. Y10. R90.\nG0 X20. Y10.\nG69\nG0 X20. Y10.") == [(10, 20, 0), (20, 10, 0)]
    assert ends("G68 X0 Y0 R30.\nG91 G0 X10.") == [(8.660254, 5, 0)]
    arc = next(move for move in interpret("G68 X0 Y0 R90.\nG2 X10. Y10. I10. F100.") if isinstance(move, Arc))
    assert arc.end_mm == pytest.approx((-10.0, 10.0, 0.0))
    assert arc.centre_mm == pytest.approx((0.0, 10.0, 0.0))
    assert arc.sweep_rad < 0


def test_scaling_is_about_its_centre_and_a_mirror_turns_arcs_round() -> None:
    assert ends("G51 X10. Y0 Z0 P2000\nG0 X20. Y5.\nG50\nG0 X20. Y5.") == [(30, 10, 0), (20, 5, 0)]
    assert ends("G51 X0 Y0 Z0 P.5\nG0 X20. Y5.") == [(10, 2.5, 0)]
    mirrored = next(m for m in interpret("G51 X0 Y0 I-1000 J1000 K1000\nG3 X10. Y10. R10. F100.") if isinstance(m, Arc))
    # Without the mirror the centre is (0, 10) and the arc counter-clockwise.
    assert mirrored.end_mm == pytest.approx((-10.0, 10.0, 0.0))
    assert mirrored.centre_mm == pytest.approx((0.0, 10.0, 0.0))
    assert mirrored.sweep_rad < 0


def test_a_circle_that_scaling_would_make_an_ellipse_is_refused() -> None:
    with pytest.raises(PartProgramError, match="ellipse"):
        interpret("G51 X0 Y0 I2000 J1000 K1000\nG3 X10. Y10. R10. F100.")


def test_scaling_is_done_before_rotation() -> None:
    # (10, 0) scaled by 2 is (20, 0), turned by 90° about the origin (0, 20).
    assert ends("G51 X0 Y0 Z0 P2000\nG68 X0 Y0 R90.\nG0 X10. Y0") == [(0, 20, 0)]


def test_polar_coordinates_take_radius_and_angle() -> None:
    text = "G16\nG0 X100. Y30.\nY150.\nG91 Y120.\nG15 G90\nG0 X1. Y1."
    assert ends(text) == [(86.60254, 50, 0), (-86.60254, 50, 0), (0, -100, 0), (1, 1, 0)]


def test_an_incremental_polar_radius_has_its_pole_at_the_tool() -> None:
    # The pole is (10, 10); the angle counts on from that of the tool, 45°.
    reach = round(5 * 2**-0.5, 6)
    assert ends("G0 X10. Y10.\nG16\nG91 X5. Y90.") == [(10, 10, 0), (10 - reach, 10 + reach, 0)]


@pytest.mark.parametrize(
    ("changes", "reason"),
    [
        ({"axes": ("x", "z")}, "axes are"),
        ({"axes": ("x", "y", "z", "a", "a")}, "axes are"),
        ({"start_mm": (1.0,)}, "start_mm is"),
        ({"work_offsets_mm": {"G54": (1.0, 2.0)}}, "G54 is"),
        ({"work_offsets_mm": {"G53": (1.0, 2.0, 3.0)}}, "'G53' is not known"),
        ({"references_mm": ((0.0, 0.0, float("nan")),)}, "references_mm"),
    ],
)
def test_settings_that_do_not_fit_the_axes_are_refused(changes: dict[str, Any], reason: str) -> None:
    with pytest.raises(TwinError, match=reason):
        Settings(**changes)


POINTS = st.lists(st.tuples(st.integers(-999, 999), st.integers(-999, 999)), min_size=1, max_size=8)


def path(points: list[tuple[int, int]]) -> str:
    return "\n".join(f"G0 X{x}. Y{y}." for x, y in points)


@given(POINTS, st.integers(-360, 360))
def test_a_rotation_there_and_back_is_none(points: list[tuple[int, int]], angle: int) -> None:
    turned = ends(f"G68 X1. Y2. R{angle}.\n{path(points)}\nG69\nG0 X{points[-1][0]}. Y{points[-1][1]}.")
    assert turned[-1] == tuple(map(float, (*points[-1], 0)))
    for (x, y), end in zip(points, turned, strict=False):
        assert (x - 1) ** 2 + (y - 2) ** 2 == pytest.approx((end[0] - 1) ** 2 + (end[1] - 2) ** 2, abs=0.01)


@given(POINTS)
def test_incremental_and_absolute_programs_of_one_path_are_one(points: list[tuple[int, int]]) -> None:
    steps, (x, y) = ["G91"], (0, 0)
    for next_x, next_y in points:
        steps.append(f"G0 X{next_x - x}. Y{next_y - y}.")
        x, y = next_x, next_y
    assert ends("\n".join(steps)) == ends(path(points))


@given(POINTS, st.integers(-500, 500), st.integers(-500, 500))
def test_a_work_offset_shifts_every_end_by_itself(points: list[tuple[int, int]], shift_x: int, shift_y: int) -> None:
    shifted = ends(path(points), Settings(work_offsets_mm={"G54": (float(shift_x), float(shift_y), 0.0)}))
    assert shifted == [(x + shift_x, y + shift_y, z) for x, y, z in (tuple(end) for end in ends(path(points)))]
