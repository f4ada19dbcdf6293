"""The rate of false gates, and the threshold for one, from the peaks of a null stream."""

import numpy as np
import pytest

from twin.transient.extremes import false_rate, tail_of, threshold_for


def peaks(per_hour: float, hours: float, seed: int) -> np.ndarray:  # type: ignore[type-arg]
    """Exponential with scale 0.05 above 0.3: 0.3 + 0.05 ln(rate / r) is passed r times an hour."""
    rng = np.random.default_rng(seed)
    return 0.3 + rng.exponential(0.05, rng.poisson(per_hour * hours))


def test_the_threshold_is_that_of_the_law_that_the_peaks_come_from() -> None:
    truth = 0.3 + 0.05 * np.log(20.0 * 24.0)
    found = [threshold_for(peaks(20.0, 48.0, seed), 48.0, 1.0) for seed in range(40)]
    assert np.median([one for one in found if one is not None]) == pytest.approx(truth, abs=0.02)


def test_the_interval_holds_the_true_rate_about_as_often_as_it_says() -> None:
    at = 0.3 + 0.05 * np.log(20.0 * 24.0)
    hits = 0
    for seed in range(60):
        rate = false_rate(peaks(20.0, 24.0, seed), 24.0, at, np.random.default_rng(seed))
        hits += rate.low <= 1.0 <= rate.high
    assert hits >= 45, "a 90 % interval of a tail may be a little short, not wrong"


def test_what_the_null_is_too_short_for_is_said() -> None:
    assert tail_of(np.array([0.5, 0.6]), 1.0) is None
    assert threshold_for(np.array([0.5, 0.6]), 1.0, 1.0) is None
    rate = false_rate(np.array([]), 6.0, 0.8, np.random.default_rng(0))
    assert (rate.per_day, rate.low, rate.seen, rate.is_extrapolated) == (0.0, 0.0, 0, True)
    assert rate.high == pytest.approx(12.0), "none in 6 h: below 3 in 6 h, with 95 %"


def test_many_exceedances_are_counted_not_extrapolated() -> None:
    rate = false_rate(peaks(20.0, 100.0, 1), 100.0, 0.4, np.random.default_rng(0))
    assert not rate.is_extrapolated
    assert rate.per_day == pytest.approx(20.0 * 24.0 * np.exp(-2.0), rel=0.2)
