"""Parts left: what is known exactly is given exactly, and what is known less has a wider band."""

import pytest
from hypothesis import given
from hypothesis import strategies as st

from twin.wear.left import left
from twin.wear.trend import Trend


@given(st.floats(0.0, 0.9), st.floats(0.002, 0.1))
def test_a_trend_that_is_known_exactly_ends_when_it_is_due(share: float, rate: float) -> None:
    found = left(Trend(share, rate, 1e-12, 0.0, 1e-16), 1e-12, 0.0)
    assert found is not None
    assert found.middle == pytest.approx((1.0 - share) / rate, abs=0.2, rel=0.01)
    assert found.low <= found.middle <= found.high


def test_a_band_widens_with_what_is_not_known() -> None:
    sure = left(Trend(0.5, 0.01, 1e-4, 0.0, 1e-6), 1e-4, 0.0)
    unsure = left(Trend(0.5, 0.01, 1e-4, 0.0, 1e-5), 1e-2, 1e-8)
    assert sure is not None and unsure is not None
    assert unsure.high - unsure.low > sure.high - sure.low > 0.0


def test_a_load_that_does_not_rise_has_no_end() -> None:
    assert left(Trend(0.5, 0.0, 1e-4, 0.0, 1e-6), 0.0, 0.0) is None
    assert left(Trend(0.5, -0.01, 1e-4, 0.0, 1e-6), 0.0, 0.0) is None


def test_a_tool_that_is_spent_has_none_left() -> None:
    assert left(Trend(1.5, 0.01, 1e-6, 0.0, 1e-8), 1e-6, 0.0) == (0.0, 0.0, 0.0)
