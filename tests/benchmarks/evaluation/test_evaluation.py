"""Measures of detections, each on cases whose answer is known."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from benchmarks.evaluation.baselines import constant_score, one_feature_score, random_score
from benchmarks.evaluation.events import Event, delays_s, detections, false_alerts_a_week, recall
from benchmarks.evaluation.intervals import rate, share
from benchmarks.evaluation.range_based import Bias, Range, ranges
from benchmarks.evaluation.range_based import range_based as measured
from benchmarks.evaluation.volume import area_pr, vus_pr

EVENTS = [Event(100.0, 200.0), Event(1000.0, 1100.0)]


@pytest.mark.parametrize(
    ("alerts", "delays", "false"),
    [
        ([], (None, None), 0),
        ([100.0, 1100.0], (0.0, 100.0), 0),
        ([99.0], (None, None), 1),
        ([110.0, 120.0, 130.0], (10.0, None), 0),
        ([230.0], (130.0, None), 0),
        ([270.0], (None, None), 0),
        ([600.0, 700.0], (None, None), 2),
    ],
    ids=["silence", "at both edges", "too early", "twice is once", "in the grace", "in the wake", "false"],
)
def test_what_an_alert_finds(alerts: list[float], delays: tuple, false: int) -> None:
    result = detections(EVENTS, alerts, 2000.0, grace_s=60.0, wake_s=100.0)
    assert (result.delays_s, result.false) == (delays, false)
    assert result.quiet_s == 1600.0


def test_parts_are_put_together() -> None:
    parts = [detections(EVENTS, [130.0, 600.0], 302_400.0, wake_s=0.0), detections([], [5.0], 302_400.0)]
    assert recall(parts).value == 0.5
    assert false_alerts_a_week(parts).value == pytest.approx(2.0, rel=1e-3)
    assert delays_s(parts) == [30.0]


def test_events_that_overlap_are_quiet_time_once() -> None:
    assert detections([Event(0.0, 50.0), Event(20.0, 80.0)], [], 100.0, wake_s=10.0).quiet_s == 10.0


@pytest.mark.parametrize(("hits", "count"), [(0, 5), (5, 5), (3, 10)])
def test_a_share_lies_within_its_interval(hits: int, count: int) -> None:
    estimate = share(hits, count)
    assert 0.0 <= estimate.low <= estimate.value <= estimate.high <= 1.0
    assert estimate.high - estimate.low > 0.1


@pytest.mark.parametrize(("truth", "count"), [(0.5, 40), (0.9, 40)])
def test_the_interval_of_a_share_has_its_coverage(truth: float, count: int) -> None:
    hits = np.random.default_rng(1).binomial(count, truth, 2000)
    inside = np.mean([share(int(one), count).low <= truth <= share(int(one), count).high for one in hits])
    assert inside == pytest.approx(0.9, abs=0.05)


def test_the_interval_of_a_rate_has_at_least_its_coverage() -> None:
    counts = np.random.default_rng(2).poisson(3.0, 2000)
    inside = np.mean([rate(int(one), 1.0).low <= 3.0 <= rate(int(one), 1.0).high for one in counts])
    assert 0.9 <= inside <= 0.97


def test_nothing_to_count_is_no_figure() -> None:
    assert math.isnan(share(0, 0).value)
    assert math.isnan(rate(0, 0.0).value)


# Worked by hand from the definitions of the paper.
RANGES = {
    # real, predicted, existence, bias: precision, recall
    "the same": ([(0, 10)], [(0, 10)], 0.5, Bias.FLAT, 1.0, 1.0),
    "half, flat": ([(0, 10)], [(5, 10)], 0.0, Bias.FLAT, 1.0, 0.5),
    "half, with existence": ([(0, 10)], [(5, 10)], 0.5, Bias.FLAT, 1.0, 0.75),
    "the last half, front: 15 of 55": ([(0, 10)], [(5, 10)], 0.0, Bias.FRONT, 1.0, 15 / 55),
    "the first half, front: 40 of 55": ([(0, 10)], [(0, 5)], 0.0, Bias.FRONT, 1.0, 40 / 55),
    "in two pieces": ([(0, 10)], [(0, 4), (6, 10)], 0.0, Bias.FLAT, 1.0, 0.4),
    "too long": ([(0, 10)], [(0, 40)], 0.5, Bias.FLAT, 0.25, 1.0),
    "one range over two events": ([(0, 10), (20, 30)], [(0, 30)], 0.0, Bias.FLAT, 1 / 3, 1.0),
    "one of two": ([(0, 10), (20, 30)], [(0, 10)], 0.5, Bias.FLAT, 1.0, 0.5),
    "beside it": ([(0, 10)], [(10, 20)], 0.5, Bias.FLAT, 0.0, 0.0),
}


@pytest.mark.parametrize("case", RANGES.values(), ids=RANGES.keys())
def test_range_based_precision_and_recall(case: tuple) -> None:
    real, predicted, existence, bias, precision, recalled = case
    result = measured([Range(*one) for one in real], [Range(*one) for one in predicted], existence, bias)
    assert result == pytest.approx((precision, recalled))


def test_without_ranges_there_is_no_mean() -> None:
    assert math.isnan(measured([Range(0, 1)], []).precision)
    assert math.isnan(measured([], [Range(0, 1)]).recall)


@given(flags=st.lists(st.booleans(), max_size=40))
def test_ranges_are_the_flags(flags: list[bool]) -> None:
    rebuilt = [any(one.start <= tick < one.end for one in ranges(flags)) for tick in range(len(flags))]
    assert rebuilt == flags


def test_a_perfect_score_has_the_whole_area_and_a_late_one_more_with_a_buffer() -> None:
    events, perfect, late = [Range(50, 60), Range(120, 130)], np.zeros(200), np.zeros(200)
    for one in events:
        perfect[one.start : one.end] = 1.0
        late[one.end : one.end + 10] = 1.0
    assert area_pr(perfect, events, 0) == 1.0
    assert area_pr(late, events, 0) <= 0.1
    assert area_pr(late, events, 40) > 0.3
    assert vus_pr(perfect, events, 40) > vus_pr(late, events, 40) > vus_pr(1.0 - perfect, events, 40)


def test_the_area_of_chance_is_the_share_of_events() -> None:
    events = [Range(1000 * k, 1000 * k + 100) for k in range(20)]
    random = [area_pr(random_score(20_000, np.random.default_rng(seed)), events, 0) for seed in range(5)]
    assert float(np.mean(random)) == pytest.approx(0.1, abs=0.02)
    assert area_pr(constant_score(20_000), events, 0) == pytest.approx(0.1)


def test_an_order_that_is_the_same_has_the_same_volume() -> None:
    scores = random_score(3000, np.random.default_rng(4))
    events = [Range(100, 200), Range(900, 1000)]
    assert vus_pr(scores, events, 60) == vus_pr(np.exp(3.0 * scores), events, 60)


def test_random_scores_are_not_made_look_good() -> None:
    """Point adjustment would give this chance alarm a recall near 1 and F1 above most detectors."""
    rng = np.random.default_rng(5)
    events = [Range(2000 * k, 2000 * k + 400) for k in range(25)]
    alarms = ranges((rng.random(50_000) < 0.01).tolist())
    result = measured(events, alarms, existence=0.0)
    assert result.recall < 0.02
    assert result.precision < 0.3


def test_one_feature_is_measured_in_its_own_scatter() -> None:
    training = np.random.default_rng(6).normal(10.0, 2.0, 10_000)
    assert one_feature_score(np.array([10.0, 16.0]), training) == pytest.approx((0.0, 3.0), abs=0.1)
