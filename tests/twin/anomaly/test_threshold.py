"""Thresholds in alerts a machine-week: the rate that was asked for holds on data that were not seen, whatever the correlation."""

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.signal import lfilter

from twin.anomaly.alarm import AlarmRule, is_alarm, onsets
from twin.anomaly.errors import ModelError
from twin.anomaly.threshold import Threshold, fit_threshold

Floats = NDArray[np.float64]
TICK_S = 10.0
WEEK = 60_480
CORRELATIONS = [0.0, 0.5, 0.9, 0.99]


def stream(weeks: float, correlation: float, seed: int) -> Floats:
    """Scores of unit variance, each like the one before."""
    white = np.random.default_rng(seed).standard_normal(int(weeks * WEEK) + 2000)
    return np.asarray(lfilter([np.sqrt(1.0 - correlation**2)], [1.0, -correlation], white)[2000:])


def fitted(scores: Floats, alerts_per_week: float = 1.0, dwell_ticks: int = 3) -> Threshold:
    return fit_threshold([scores], [np.zeros(len(scores), dtype=bool)], TICK_S, dwell_ticks, 0.8, alerts_per_week)


def alerts_a_week(scores: Floats, threshold: float, dwell_ticks: int = 3) -> float:
    on = is_alarm(AlarmRule(threshold, dwell_ticks, 0.8), scores, np.zeros(len(scores), dtype=bool))
    return len(onsets(on)) / (len(scores) / WEEK)


@pytest.mark.parametrize("correlation", CORRELATIONS)
@pytest.mark.parametrize(("weeks", "asked"), [(1.0, 1.0), (1.0, 20.0), (0.2, 1.0)], ids=["peaks", "read off", "beyond"])
def test_the_rate_holds_on_what_was_not_seen(correlation: float, weeks: float, asked: float) -> None:
    """16 fits on a week (or on a fifth of one), each judged on 20 weeks; the interval has 90 %."""
    held, errors = 0, []
    for seed in range(16):
        fit = fitted(stream(weeks, correlation, seed), asked)
        rate = alerts_a_week(stream(20.0, correlation, 1000 + seed), fit.threshold)
        held += fit.low <= rate <= fit.high
        errors.append(rate / asked)
    assert held >= 12, "of 16 at 90 %, 11 or fewer come by chance once in two hundred times"
    assert float(np.median(errors)) < 1.5, "where it errs, it errs towards too few"


def test_a_quantile_is_no_rate() -> None:
    """The published recipe, 1 % quantile and dwell 3: same distribution, other correlation, hundreds of times the alerts."""
    rates = {}
    for correlation in (0.0, 0.9):
        scores = stream(1.0, correlation, 7)
        rates[correlation] = alerts_a_week(scores, float(np.quantile(scores, 0.99)))
    assert rates[0.9] > 100 * max(rates[0.0], 0.5)


def test_a_longer_dwell_needs_a_lower_threshold() -> None:
    scores = stream(1.0, 0.9, 3)
    thresholds = [fitted(scores, 5.0, dwell).threshold for dwell in (1, 3, 10, 30)]
    assert thresholds == sorted(thresholds, reverse=True)


def test_alarms_that_are_waited_for_need_a_lower_threshold_and_keep_their_rate() -> None:
    """Scores that stay alike for hours: half an hour's wait makes one alarm of several."""
    scores, shut = stream(4.0, 0.99, 5), np.zeros(4 * WEEK, dtype=bool)
    several, one = (fit_threshold([scores], [shut], TICK_S, 3, 0.8, 20.0, calm) for calm in (0, 180))
    assert one.threshold < several.threshold
    later = stream(20.0, 0.99, 1005)
    on = is_alarm(AlarmRule(one.threshold, 3, 0.8, 180), later, np.zeros(len(later), dtype=bool))
    assert len(onsets(on)) / 20.0 == pytest.approx(20.0, rel=0.4)


def test_a_short_stretch_is_fitted_as_if_no_alarm_were_waited_for() -> None:
    scores, shut = stream(0.05, 0.9, 6), np.zeros(int(0.05 * WEEK), dtype=bool)
    assert fit_threshold([scores], [shut], TICK_S, 3, 0.8, 1.0, 600) == fit_threshold([scores], [shut], TICK_S, 3, 0.8, 1.0)


def test_fewer_alerts_need_a_higher_threshold() -> None:
    scores = stream(1.0, 0.5, 4)
    thresholds = [fitted(scores, asked).threshold for asked in (100.0, 20.0, 10.0, 1.0, 0.1)]
    assert thresholds == sorted(thresholds)


def test_what_lies_beyond_the_scores_says_so_and_is_wide() -> None:
    scores = stream(0.2, 0.5, 5)
    beyond, within = fitted(scores, 1.0), fitted(scores, 200.0)
    assert beyond.is_extrapolated
    assert beyond.threshold > scores.max() * 0.5
    assert not within.is_extrapolated
    assert beyond.high / beyond.alerts_per_week > 3.0 > within.high / within.alerts_per_week


def test_what_is_gated_makes_no_threshold() -> None:
    scores, gated = stream(1.0, 0.5, 6), np.zeros(WEEK, dtype=bool)
    scores[1000:1100], gated[1000:1100] = 50.0, True
    shut = fit_threshold([scores], [gated], TICK_S, 3, 0.8, 1.0)
    assert shut.threshold < 10.0
    assert shut.hours == pytest.approx((WEEK - 100) * TICK_S / 3600.0)
    assert fitted(scores, 1.0).threshold > shut.threshold


def test_a_hole_is_bridged_by_no_alarm() -> None:
    scores = stream(1.0, 0.5, 8)
    no_gate = [np.zeros(WEEK // 2, dtype=bool)] * 2
    two = fit_threshold([scores[: WEEK // 2], scores[WEEK // 2 :]], no_gate, TICK_S, 3, 0.8, 20.0)
    assert two.threshold == pytest.approx(fitted(scores, 20.0).threshold, rel=0.02)
    unknown = scores.copy()
    unknown[: WEEK // 2] = np.nan
    assert fitted(unknown, 20.0).hours == pytest.approx(84.0)


def test_alarms_that_come_in_bunches_tell_less() -> None:
    even = stream(2.0, 0.5, 9)
    bunched = even * np.repeat(np.exp(np.random.default_rng(1).normal(0.0, 0.5, 56)), len(even) // 56)
    wide, narrow = fitted(bunched, 20.0), fitted(even, 20.0)
    assert wide.high / wide.low > 1.5 * narrow.high / narrow.low


@pytest.mark.parametrize(
    ("scores", "asked", "reason"),
    [
        (stream(0.005, 0.5, 1), 1.0, "cannot tell of 1 alerts a week"),
        (np.zeros(WEEK), 0.5, "no score .* is above 0"),
        (np.where(np.arange(WEEK) % 10_000 < 5, 1.0, 0.0), 0.5, "20 are needed"),
        (stream(1.0, 0.5, 1), 0.0, "cannot tell of 0 alerts"),
    ],
    ids=["too short", "never above 0", "too few clusters", "never an alert"],
)
def test_what_cannot_be_known_is_no_threshold(scores: Floats, asked: float, reason: str) -> None:
    with pytest.raises(ModelError, match=reason):
        fitted(scores, asked)


def test_few_alarms_are_read_off_where_an_alert_is_asked_for_in_the_stretch() -> None:
    scores = np.zeros(WEEK)
    for place, height in enumerate((1.0, 2.0, 3.0)):
        scores[10_000 * (place + 1) :][:5] = height
    fit = fitted(scores, 1.0)
    assert 2.0 < fit.threshold <= 3.0
    assert (fit.estimate, fit.clusters) == (1.0, 1)
    assert (fit.low, fit.high) == pytest.approx((0.05, 4.74), abs=0.01)


def test_where_no_score_was_above_0_any_above_it_is_news() -> None:
    fit = fitted(np.full(WEEK, -0.1), 1.0)
    assert 0.0 < fit.threshold < 1e-3
    assert (fit.estimate, fit.low) == (0.0, 0.0)
    assert fit.high == pytest.approx(3.0, abs=0.01), "none seen in a week: at most three a week"
