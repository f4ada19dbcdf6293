"""The trend of one tool: it finds an even wear, and a wild level pulls no more than a far one."""

import pytest

from twin.wear.curve import LINE
from twin.wear.trend import Trend, Wander, advanced, updated

START = Trend(0.0, 0.0, 0.01, 0.0, 0.01)


def test_an_even_wear_is_found() -> None:
    trend = START
    for use in range(1, 61):
        trend = updated(advanced(trend, 1.0, Wander(0.0, 0.0)), 0.3 * use / 100.0, 1e-4, 0.3, LINE)
    assert trend.share == pytest.approx(0.6, abs=0.03)
    assert trend.rate == pytest.approx(0.01, rel=0.1)


def test_a_wild_level_pulls_no_more_than_a_far_one() -> None:
    far, wild = (updated(START, level, 1e-4, 0.3, LINE).share for level in (1.0, 100.0))
    assert far == pytest.approx(wild)
