"""What holds for every path: an independent computation, symmetry, refinement, balance of volume."""

import math
from itertools import pairwise

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray

from tests.depth import examples
from tests.twin.engagement.whole_stock import engagement
from twin.engagement import Engagement, Workpiece, cut
from twin.machine import Stock

R = 3.0
PLATE = Stock(min_mm=(-20.0, -20.0, -8.0), max_mm=(20.0, 20.0, 0.0))
PHI = (np.arange(3600) + 0.5) * math.pi / 3600

Points = list[tuple[float, float, float]]
some = settings(max_examples=examples(25, 15), deadline=None, suppress_health_check=[HealthCheck.too_slow])


@st.composite
def level_paths(draw: st.DrawFn) -> Points:
    """Straight cuts in up to three layers, plunging between them."""
    grid = st.integers(-22, 22).map(float)
    points: Points = [(draw(grid), draw(grid), -1.0)]
    for _ in range(draw(st.integers(2, 8))):
        x, y, z = points[-1]
        if draw(st.integers(0, 4)) == 0 and z > -3.0:
            points.append((x, y, z - 1.0))
        else:
            points.append((draw(grid), draw(grid), z))
    return points


@st.composite
def ramping_paths(draw: st.DrawFn) -> Points:
    """Straight cuts, up and down."""
    grid = st.integers(-22, 22).map(float)
    height = st.sampled_from([-1.0, -2.0, -3.5, 0.5])
    return [(draw(grid), draw(grid), draw(height)) for _ in range(draw(st.integers(2, 6)))]


def rim_depths(points: Points, segment: int, start: NDArray[np.float64], place: NDArray[np.float64]) -> NDArray[np.float64]:
    """Depth around the rim at `place` in a level segment, from the distances to all that was cut before: no cells, no sweeps."""
    path = np.array(points)
    heading = (path[segment + 1] - path[segment])[:2]
    heading = heading / np.hypot(*heading)
    rim = place[:2] + R * (np.sin(PHI)[:, None] * heading + np.cos(PHI)[:, None] * np.array([-heading[1], heading[0]]))
    inside = (np.abs(rim) < 20.0).all(axis=1)
    height = np.where(inside, 0.0, -8.0)
    done = [(path[k], path[k + 1]) for k in range(segment)] + [(path[segment], start)]
    for a, b in done:
        along = (b - a)[:2]
        share = np.clip((rim - a[:2]) @ along / max(along @ along, 1e-300), 0.0, 1.0)
        reached = np.hypot(*(rim - a[:2] - share[:, None] * along).T) < R - 1e-7
        height = np.where(reached, np.minimum(height, max(a[2], b[2]) if along.any() else b[2]), height)
    return np.maximum(height - place[2], 0.0)


@some
@given(level_paths())
def test_the_section_is_that_of_the_distances_to_all_former_cuts(points: Points) -> None:
    rows = engagement(points, 2 * R, PLATE, resolution_mm=2.0)
    moves = np.diff(np.array(points), axis=0)
    for k in range(len(rows)):
        segment = int(rows.segment[k])
        if not moves[segment, :2].any():
            assert not rows.engaged[k]
            continue
        half = moves[segment] / np.linalg.norm(moves[segment]) * rows.length_mm[k] / 2
        depths = rim_depths(points, segment, rows.position_mm[k] - half, rows.position_mm[k])
        expected = R * np.sum(depths * np.sin(PHI)) * math.pi / 3600
        # A sliver of material narrower than 1° of the rim may be missed.
        assert rows.section_mm2[k] == pytest.approx(expected, abs=R * max(depths.max(), 1.0) * 0.02)


def angles(rows: Engagement) -> NDArray[np.float64]:
    return np.column_stack((rows.axial_depth_mm, rows.entry_angle_rad, rows.exit_angle_rad, rows.section_mm2))


@some
@given(ramping_paths(), st.sampled_from([1, 2, 3]))
def test_turning_path_and_stock_by_quarters_changes_nothing(points: Points, quarters: int) -> None:
    cosine, sine = ((0, 1), (-1, 0), (0, -1))[quarters - 1]
    turned = [(cosine * x - sine * y, sine * x + cosine * y, z) for x, y, z in points]
    here, there = (engagement(path, 2 * R, PLATE, resolution_mm=0.7) for path in (points, turned))
    # Where tool and wall are tangent, rounding decides on a sliver; its section is nothing, its angles are.
    assert there.section_mm2 == pytest.approx(here.section_mm2, abs=1e-4)
    same = np.isclose(angles(here), angles(there), atol=1e-5).all(axis=1)
    assert same.mean() > 0.97


@some
@given(ramping_paths(), st.sampled_from([0.15, 0.6, 1.7]))
def test_the_size_of_the_cells_changes_nothing(points: Points, cell_mm: float) -> None:
    here, there = (cut(Workpiece.of(PLATE, size), points, 2 * R, 0.7)[1] for size in (0.4, cell_mm))
    assert angles(there) == pytest.approx(angles(here), abs=1e-9)


@some
@given(level_paths(), st.integers(2, 5))
def test_more_points_on_the_same_lines_change_nothing(points: Points, parts: int) -> None:
    fine = [points[0]]
    for a, b in pairwise(points):
        fine += [tuple(p + (q - p) * k / parts for p, q in zip(a, b, strict=True)) for k in range(1, parts + 1)]  # type: ignore[misc]
    here, there = (engagement(path, 2 * R, PLATE, resolution_mm=0.25) for path in (points, fine))
    assert there.removed_mm3.sum() == pytest.approx(here.removed_mm3.sum(), rel=0.01, abs=1.0)


def test_more_chords_on_an_arc_change_the_angle_as_their_sagitta_does() -> None:
    def entry(chords: int) -> float:
        angle = np.linspace(0.0, math.pi, chords + 1)
        rounds = [np.column_stack((r * np.cos(angle), r * np.sin(angle), np.full(len(angle), -1.0))) for r in (8.0, 9.0)]
        left, _ = cut(Workpiece.of(PLATE, 0.4), rounds[0], 2 * R)
        return float(np.median(cut(left, rounds[1], 2 * R)[1].entry_angle_rad[chords // 4 : -chords // 4]))

    exact = math.acos((9.0**2 + R**2 - 11.0**2) / (2 * 9.0 * R))
    errors = [abs(entry(chords) - exact) for chords in (50, 100, 200)]
    assert errors[0] < math.radians(1.0)
    assert errors[2] < math.radians(0.1)
    assert errors[2] < errors[0] / 4


@some
@given(level_paths())
def test_what_is_removed_is_what_is_missing(points: Points) -> None:
    whole = Workpiece.of(PLATE, 0.4)
    # Where the path begins the tool has cut already: that disc is missing too.
    begun, _ = cut(whole, [points[0], points[0]], 2 * R)
    left, rows = cut(begun, points, 2 * R, resolution_mm=0.05)
    assert rows.removed_mm3.sum() == pytest.approx(begun.volume_mm3() - left.volume_mm3(), rel=0.01, abs=1.0)


def test_a_helix_into_the_solid_removes_what_is_missing() -> None:
    angle = np.linspace(0.0, 8 * math.pi, 1500)
    path = np.column_stack((4 * np.cos(angle), 4 * np.sin(angle), -angle / 8))
    whole = Workpiece.of(PLATE, 0.4)
    left, rows = cut(whole, path, 2 * R)
    missing = whole.volume_mm3() - left.volume_mm3()
    assert missing > 100.0
    assert rows.removed_mm3.sum() == pytest.approx(missing, rel=0.02)
    assert rows.plunging.mean() > 0.99
