"""One arc in place of several: what it keeps."""

import math

import pytest
from hypothesis import assume, given
from hypothesis import strategies as st

from twin.engagement.rectangle import rectangle

angle = st.floats(0.0, math.pi)
depth = st.floats(0.1, 20.0)


def moments(pieces: list[tuple[float, float, float]]) -> tuple[float, float, float]:
    """∫ a sin, ∫ a sin², ∫ a sin cos of pieces (depth, start, end)."""
    power = sum(a * (math.cos(p) - math.cos(q)) for a, p, q in pieces)
    across = sum(a * (q - p - (math.sin(2 * q) - math.sin(2 * p)) / 2) / 2 for a, p, q in pieces)
    along = sum(a * (math.sin(q) ** 2 - math.sin(p) ** 2) / 2 for a, p, q in pieces)
    return power, across, along


@given(depth, angle, angle)
def test_one_arc_is_itself(deep: float, one: float, other: float) -> None:
    entry, leave = sorted((one, other))
    assume(leave - entry > 0.05)
    found = rectangle(*moments([(deep, entry, leave)]))
    assert found[0] == pytest.approx(deep, rel=1e-4)
    assert found[1:] == pytest.approx((entry, leave), abs=1e-4)


@given(depth, depth, st.lists(angle, min_size=4, max_size=4))
def test_power_and_mean_force_along_are_kept_and_the_arc_lies_in_front(first: float, second: float, edges: list[float]) -> None:
    a, b, c, d = sorted(edges)
    assume(b - a > 0.05 and d - c > 0.05)
    power, across, along = moments([(first, a, b), (second, c, d)])
    deep, entry, leave = rectangle(power, across, along)
    assert 0.0 <= entry < leave <= math.pi
    kept = moments([(deep, entry, leave)])
    assert kept[0] == pytest.approx(power, rel=1e-6)
    assert kept[2] == pytest.approx(along, rel=1e-6, abs=1e-6 * power)
    # Across: kept as well, or the arc has come to an end of the rim and can spread no further.
    at_an_end = entry < 1e-6 or leave > math.pi - 1e-6
    assert at_an_end or kept[1] == pytest.approx(across, rel=1e-6)
    assert kept[1] >= across * (1 - 1e-6)


def test_a_slot_with_its_middle_cut_free_is_spread_over_the_whole_rim() -> None:
    walls = [(1.0, 0.0, math.pi / 6), (1.0, math.pi * 5 / 6, math.pi)]
    deep, entry, leave = rectangle(*moments(walls))
    assert (entry, leave) == pytest.approx((0.0, math.pi), abs=1e-6)
    assert deep == pytest.approx(1 - math.cos(math.pi / 6))
