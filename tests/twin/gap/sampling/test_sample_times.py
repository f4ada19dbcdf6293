"""The times at which a recording was sampled, and the way of its series from there to the ticks of the loops."""

import numpy as np
import pytest
from numpy.typing import NDArray

from twin.gap.sampling.sample_times import SampleTimes, sample_times
from twin.runlog import RunLog, run_log

Floats = NDArray[np.float64]
TICK_S = 0.001


def moved(at_s: Floats, stamps_s: Floats | None = None) -> RunLog:
    """An axis that swings, sampled at `at_s`, with other stamps where these are given."""
    reference = 50.0 * np.sin(4.0 * at_s)
    return run_log({"t_s": at_s if stamps_s is None else stamps_s, "z_ref_mm": reference, "z_pos_mm": reference - 0.1})


@pytest.mark.parametrize(
    ("sample_s", "every", "said"),
    [
        (0.001, 1.0, ""),
        (0.004, 4.0, "one tick in 4"),
        (0.00401, 4.0, "its clock is another one"),
        (0.00102, 1.0, "its samples are taken to be one a tick"),
        (0.0033, 3.3, "at the samples' own times"),
        (0.0012, 1.2, "at the samples' own times"),
        (0.0005, 0.5, "of the samples at one tick the nearest"),
    ],
)
def test_an_even_recording_tells_its_sample_period(sample_s: float, every: float, said: str) -> None:
    times = sample_times(moved(np.arange(1000) * sample_s), TICK_S)
    assert times.every == pytest.approx(every)
    assert np.diff(times.at) == pytest.approx(every)
    assert len(times.notes) == bool(said)
    assert said in " ".join(times.notes)


@pytest.mark.parametrize("sample_s", [0.001, 0.002, 0.0033])
def test_jittering_stamps_count_where_the_motion_is_smooth_over_them(sample_s: float) -> None:
    even_s = np.arange(2000) * sample_s
    at_s = np.sort(even_s + 0.3 * sample_s * np.random.default_rng(1).uniform(-1.0, 1.0, 2000))
    at_s -= at_s[0]
    own = sample_times(moved(at_s), TICK_S)
    assert own.at == pytest.approx(at_s / TICK_S)
    assert "at the time of its stamp" in own.notes[0]
    late = sample_times(moved(even_s, at_s), TICK_S)
    assert np.diff(late.at) == pytest.approx(late.every)
    assert any("time stamps jitter" in note for note in late.notes)


@pytest.mark.parametrize("sample_s", [0.001, 0.004, 0.0033])
def test_samples_that_are_missing_leave_the_others_where_they_were(sample_s: float) -> None:
    at_s = np.delete(np.arange(1500) * sample_s, np.arange(400, 450))
    times = sample_times(moved(at_s), TICK_S)
    assert times.at == pytest.approx(at_s / TICK_S)
    assert "50 samples are missing" in " ".join(times.notes)
    assert np.isnan(times.carried(np.ones(len(at_s)))[round(405 * sample_s / TICK_S) : round(445 * sample_s / TICK_S)]).all()


@pytest.mark.parametrize("every", [0.6, 1.2, 3.3, 4.0])
def test_a_smooth_series_is_carried_to_the_ticks_and_not_rounded_to_them(every: float) -> None:
    times = SampleTimes(np.arange(2000) * every, every)
    swing = np.sin(times.at / 60.0)
    ticks = np.arange(times.count)
    carried = times.carried(swing)
    known = np.isfinite(carried)
    assert known.sum() >= 0.98 * min(times.count, len(times.at))
    assert np.abs(carried - np.sin(ticks / 60.0))[known].max() < 1e-5
    assert np.abs(times.interpolated(swing) - np.sin(ticks / 60.0))[:-4].max() < 1e-5


def test_a_series_that_stands_stands_between_its_samples_too() -> None:
    times = SampleTimes(np.arange(100) * 4.0, 4.0)
    step = np.where(np.arange(100) < 50, 0.0, np.arange(100) - 49.0)
    assert (times.interpolated(step)[:197] == 0.0).all()


def test_what_the_loops_hold_is_read_at_the_tick_before_and_averaged_over_it() -> None:
    slow = SampleTimes(np.array([0.0, 1.7, 3.4]), 1.7)
    np.testing.assert_array_equal(slow.held(np.array([1.0, 2.0, 3.0])), [1.0, 2.0, np.nan, 3.0])
    fast = SampleTimes(np.array([0.0, 0.5, 1.0, 1.5]), 0.5)
    np.testing.assert_array_equal(fast.held(np.array([1.0, 3.0, np.nan, 5.0])), [2.0, 5.0])


def test_what_is_neither_is_read_from_the_nearest_sample() -> None:
    times = SampleTimes(np.array([0.0, 0.6, 1.2, 1.8]), 0.6)
    np.testing.assert_array_equal(times.nearest(np.array([1.0, 2.0, 3.0, 4.0])), [1.0, 3.0])


def test_a_kink_between_samples_leaves_a_doubt_that_passes() -> None:
    times = SampleTimes(np.arange(300) * 12.0, 12.0)
    kink = np.abs(times.at - 1200.0) * 0.02
    doubt = times.in_doubt(kink, 40.0, TICK_S)
    assert doubt[1200:1290].all()
    assert not doubt[:1150].any()
    assert not doubt[1400:].any()
    assert not times.in_doubt(0.02 * times.at, 40.0, TICK_S).any()
