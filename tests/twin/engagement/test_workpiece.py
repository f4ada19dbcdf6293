"""What is left of the stock is a value that goes from tool to tool, of a size that follows the path."""

import math

import numpy as np
import pytest
from numpy.typing import ArrayLike

from twin.engagement import EngagementError, Workpiece, cut, removal
from twin.errors import TwinError
from twin.machine import Stock

PLATE = Stock(min_mm=(0.0, 0.0, -10.0), max_mm=(60.0, 60.0, 0.0))
SLOT = [(10.0, 30.0, -2.0), (50.0, 30.0, -2.0)]


def test_cutting_leaves_the_workpiece_that_was_given_as_it_was() -> None:
    whole = Workpiece.of(PLATE, 0.4)
    once, _ = cut(whole, SLOT, 6.0)
    missing = whole.volume_mm3() - once.volume_mm3()
    cut(once, [(30, 10, -5), (30, 50, -5)], 6.0)
    assert whole.volume_mm3() == 36000.0
    assert whole.volume_mm3() - once.volume_mm3() == missing
    assert missing == pytest.approx(2.0 * (40 * 6 + math.pi * 9), rel=1e-3)


def test_the_surface_is_exact_up_to_the_wall() -> None:
    left, _ = cut(Workpiece.of(PLATE, 0.4), SLOT, 6.0)
    just = np.array([[30, 33 - 1e-6], [30, 33 + 1e-6], [53 - 1e-6, 30], [53 + 1e-6, 30], [-1, 30]])
    assert left.height_mm(just).tolist() == [-2.0, 0.0, -2.0, 0.0, -10.0]


def test_a_smaller_tool_finds_the_corners_that_a_larger_one_left() -> None:
    square = [(15, 15, -2), (45, 15, -2), (45, 45, -2), (15, 45, -2), (15, 15, -2)]
    left, _ = cut(Workpiece.of(PLATE, 0.4), square, 10.0)
    inner = [(12, 12, -2), (48, 12, -2), (48, 48, -2), (12, 48, -2), (12, 12, -2)]
    _, rows = cut(left, inner, 4.0)
    along = np.minimum(np.abs(rows.position_mm[:, :2] - 12), np.abs(rows.position_mm[:, :2] - 48)).max(axis=1)
    assert rows.engaged[(along < 1.0) & (rows.segment > 0)].any()
    assert not rows.engaged[along > 4.0].any()


def test_a_larger_tool_after_a_smaller_one_is_cut_free_in_the_middle() -> None:
    left, _ = cut(Workpiece.of(PLATE, 0.4), SLOT, 4.0)
    _, rows = cut(left, SLOT, 6.0)
    middle = slice(len(rows) // 4, len(rows) // 2)
    assert np.all(rows.arcs[middle] == 2)
    # Each side: from the wall of the slot, 2 mm from its middle, to 3 mm: 1 mm × 2 mm, on two sides.
    assert rows.section_mm2[middle] == pytest.approx(4.0, rel=1e-5)


def test_several_cuts_are_as_good_as_one() -> None:
    path = [(10, 10, -1), (50, 10, -1), (50, 14, -1), (10, 14, -1), (10, 18, -2), (50, 18, -2)]
    whole = Workpiece.of(PLATE, 0.4)
    together_left, together = cut(whole, path, 6.0)
    first_left, first = cut(whole, path[:4], 6.0)
    last_left, last = cut(first_left, path[3:], 6.0)
    assert np.concatenate((first.section_mm2, last.section_mm2)) == pytest.approx(together.section_mm2, abs=1e-6)
    assert last_left.volume_mm3() == pytest.approx(together_left.volume_mm3(), rel=1e-9)


def test_cells_are_laid_out_where_the_path_is_only() -> None:
    large = Stock(min_mm=(0.0, 0.0, -10.0), max_mm=(3000.0, 3000.0, 0.0))
    left, _ = cut(Workpiece.of(large, 0.4), SLOT, 6.0)
    assert left.cells.floor.size <= (46 / 0.4 + 2) * (6 / 0.4 + 2)
    again, _ = cut(left, [(60, 40, -2), (70, 40, -2)], 6.0)
    assert again.cells.floor.size <= (66 / 0.4 + 2) * (16 / 0.4 + 2)
    assert again.height_mm(np.array([[30.0, 30.0], [65.0, 40.0], [55.0, 36.0]])).tolist() == [-2.0, -2.0, 0.0]


def test_contours_layer_by_layer_do_not_add_up() -> None:
    angle = np.linspace(0.0, 2 * math.pi, 200)
    ring = np.column_stack((30 + 15 * np.cos(angle), 30 + 15 * np.sin(angle), np.zeros(200)))

    def pieces(layers: int) -> int:
        workpiece = Workpiece.of(PLATE, 0.4)
        for layer in range(layers):
            workpiece, _ = cut(workpiece, ring - [0, 0, 0.5 * (layer + 1)], 6.0)
        return int(workpiece.cells.used[1])

    assert pieces(8) < 1.5 * pieces(2)


@pytest.mark.parametrize(
    ("points", "diameter", "resolution", "cutting", "words"),
    [
        ([(0, 0, 0)], 6.0, 0.1, None, r"shape \(1, 3\)"),
        ([(0, 0), (1, 1)], 6.0, 0.1, None, r"shape \(2, 2\)"),
        ([(0, 0, 0), (1, math.nan, 0)], 6.0, 0.1, None, r"points_mm\[1\] is \[1.0, nan, 0.0\]"),
        (SLOT, 0.0, 0.1, None, "tool_diameter_mm 0.0"),
        (SLOT, math.inf, 0.1, None, "tool_diameter_mm inf"),
        (SLOT, 6.0, -1.0, None, "resolution_mm -1.0"),
        (SLOT, 6.0, 1e-7, None, "coarser resolution_mm"),
        (SLOT, 6.0, 0.1, [True, False], r"cutting has the shape \(2,\)"),
    ],
)
def test_what_is_wrong_is_named(
    points: ArrayLike, diameter: float, resolution: float, cutting: ArrayLike | None, words: str
) -> None:
    with pytest.raises(EngagementError, match=words):
        cut(Workpiece.of(PLATE, 0.4), points, diameter, resolution, cutting)


def test_too_many_cells_are_refused_with_a_size_that_will_do() -> None:
    with pytest.raises(TwinError, match=r"more than cells_max 1000; .*is coarse enough") as refused:
        cut(Workpiece.of(PLATE, 6.0 / 16, cells_max=1000), SLOT, 6.0)
    size = float(str(refused.value).split("cell_mm=")[1].split(")")[0])
    left, rows = cut(Workpiece.of(PLATE, size, cells_max=1000), SLOT, 6.0)
    assert left.cells.floor.size <= 1000
    assert np.all(rows.exit_angle_rad == math.pi)


def test_walls_of_too_many_pieces_are_refused(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(removal, "travel", lambda cells, *_: (cells, False))
    with pytest.raises(EngagementError, match="sample the arcs with longer chords"):
        cut(Workpiece.of(PLATE, 0.4), SLOT, 6.0)


@pytest.mark.parametrize("size", [0.0, -1.0, math.nan])
def test_a_cell_has_a_size(size: float) -> None:
    with pytest.raises(EngagementError, match="cell_mm"):
        Workpiece.of(PLATE, size)
