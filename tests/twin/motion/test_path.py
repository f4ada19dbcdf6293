"""Geometry of segments: points, tangents, curvature, and what lies between them."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from twin.motion.path import EventKind, Kind, Path, path_from_moves
from twin.programs import canonical

COORDINATE = st.floats(-200.0, 200.0)


def circle(plane: int, sweep: float, height: float = 0.0) -> Path:
    """An arc of radius 10 about the origin, from its first axis."""
    u, v = {17: (0, 1), 18: (2, 0), 19: (1, 2)}[plane]
    w = 3 - u - v
    start, end = [0.0, 0.0, 0.0], [0.0, 0.0, 0.0]
    start[u] = 10.0
    end[u], end[v], end[w] = 10.0 * math.cos(sweep), 10.0 * math.sin(sweep), height
    return path_from_moves([canonical.Arc(0, tuple(end), (0.0, 0.0, 0.0), plane, sweep, 600.0)], tuple(start))


@pytest.mark.parametrize("plane", [17, 18, 19])
@pytest.mark.parametrize("sweep", [0.5 * math.pi, -1.5 * math.pi, 2.0 * math.pi, -4.0 * math.pi])
def test_an_arc_keeps_its_centre_and_its_radius(plane: int, sweep: float) -> None:
    path = circle(plane, sweep)
    s = np.linspace(0.0, path.length_mm[0], 50)
    points = path.at(np.zeros(50, dtype=np.int64), s)
    assert np.linalg.norm(points, axis=1) == pytest.approx(10.0, abs=1e-12)
    assert path.length_mm[0] == pytest.approx(10.0 * abs(sweep))
    assert path.curvature_per_mm()[0] == pytest.approx(0.1)
    assert points[-1].tolist() == path.end_mm[0].tolist()


def test_planes_turn_counter_clockwise_seen_from_their_normal() -> None:
    quarter = [circle(plane, math.pi / 2.0).end_mm[0].round(9).tolist() for plane in (17, 18, 19)]
    assert quarter == [[0.0, 10.0, 0.0], [10.0, 0.0, 0.0], [0.0, 0.0, 10.0]]


def test_a_helix_climbs_evenly() -> None:
    path = circle(17, 2.0 * math.pi, 5.0)
    assert path.length_mm[0] == pytest.approx(math.hypot(20.0 * math.pi, 5.0))
    half = path.at(np.array([0]), np.array([path.length_mm[0] / 2.0]))[0]
    assert half.tolist() == pytest.approx([-10.0, 0.0, 2.5])


@given(st.lists(st.tuples(COORDINATE, COORDINATE, COORDINATE), min_size=1, max_size=10), st.floats(0.0, 1.0))
def test_a_tangent_is_the_derivative_of_the_point(ends: list[tuple[float, float, float]], share: float) -> None:
    path = path_from_moves([canonical.Linear(k, end, 100.0) for k, end in enumerate(ends)])
    every = np.arange(len(path))
    s, step = share * path.length_mm * 0.99, 1e-3 * path.length_mm
    slope = (path.at(every, s + step) - path.at(every, s)) / step[:, None]
    assert np.allclose(slope, path.tangents(every, s), atol=1e-6)
    assert np.linalg.norm(path.tangents(every, s), axis=1) == pytest.approx(1.0)


def test_an_arc_whose_ends_differ_by_rounding_meets_both() -> None:
    path = path_from_moves([canonical.Arc(0, (0.0, 10.004, 0.0), (0.0, 0.0, 0.0), 17, math.pi / 2, 600.0)], (10.0, 0.0, 0.0))
    points = path.at(np.zeros(2, dtype=np.int64), np.array([0.0, path.length_mm[0]]))
    assert points.tolist() == [[10.0, 0.0, 0.0], [0.0, 10.004, 0.0]]


def test_a_move_to_where_one_is_leaves_no_segment() -> None:
    assert len(path_from_moves([canonical.Linear(0, (0.0, 0.0, 0.0), 100.0)])) == 0


def test_the_feed_counts_the_linear_axes_and_the_rotary_one_where_it_turns_alone() -> None:
    moves = [canonical.Linear(0, (3.0, 4.0, 0.0, 90.0), 100.0), canonical.Linear(1, (3.0, 4.0, 0.0, 180.0), 100.0)]
    path = path_from_moves(moves, axes=("x", "y", "z", "c"))
    assert path.length_mm.tolist() == [5.0, 90.0]
    assert path.at(np.array([0]), np.array([2.5]))[0].tolist() == [1.5, 2.0, 0.0, 45.0]


def test_events_stand_before_the_segment_that_follows_them() -> None:
    moves = [
        canonical.ToolChange(0, 5),
        canonical.Spindle(1, 1000.0, -1),
        canonical.Rapid(1, (1.0, 0.0, 0.0)),
        canonical.ExactStop(2, True),
        canonical.Linear(2, (2.0, 0.0, 0.0), 60.0),
        canonical.ExactStop(2, False),
        canonical.Linear(3, (3.0, 0.0, 0.0), 60.0),
        canonical.ProgramEnd(4),
    ]
    path = path_from_moves(moves, tool_change_mm=(None, 7.0, None))
    assert [(event.segment, event.kind, event.value) for event in path.events] == [
        (1, EventKind.TOOL_CHANGE, 5.0),
        (1, EventKind.SPINDLE, -1000.0),
        (4, EventKind.PROGRAM_END, 0.0),
    ]
    assert path.kind.tolist() == [Kind.RAPID, Kind.RAPID, Kind.LINE, Kind.LINE]
    assert path.end_mm[0].tolist() == [0.0, 7.0, 0.0]
    assert path.exact_stop.tolist() == [False, False, True, False]
