"""Rows of a run: means that keep what flowed, readings as they were, and rows that say that nothing has changed."""

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from cnctwin.composing.rows import thinned, unbroken, with_ambient
from twin.runlog import RunLog, run_log


def told(seconds: int, *, hole: tuple[int, int] = (0, 0)) -> RunLog:
    """Return a row every second but in a hole: a load that rises, a temperature that steps."""
    t_s = np.array([t for t in range(seconds) if not hole[0] <= t < hole[1]], dtype=float)
    columns = {"t_s": t_s, "feed_mm_min": t_s % 7.0, "spindle_load_pct": t_s % 5.0, "spindle_rpm": 100.0 * (t_s % 3.0)}
    return run_log(columns | {"spindle_temp_c": np.floor(t_s / 10.0)})


def test_a_short_run_stays_as_it_is() -> None:
    log = told(100)
    assert thinned(log, 100) == (log, None)


@given(st.integers(min_value=200, max_value=2000), st.integers(min_value=20, max_value=150))
def test_what_flowed_is_kept_and_readings_are_not_averaged(seconds: int, rows_max: int) -> None:
    log = told(seconds)
    thin, period_s = thinned(log, rows_max)
    assert period_s is not None and len(thin) <= rows_max
    lasts = np.minimum(np.diff(thin.t_s, append=thin.t_s[-1] + period_s), log.t_s[-1] - thin.t_s)
    for name in ("feed_mm_min", "spindle_rpm"):
        assert np.isclose(np.sum(thin[name] * lasts), np.sum(log[name][:-1]), rtol=1e-9), name
    assert np.array_equal(thin["spindle_temp_c"], np.floor(thin.t_s / 10.0))


def test_the_load_is_the_one_that_heats() -> None:
    t_s = np.arange(400.0)
    turning = t_s % 2.0 == 0.0
    log = run_log({"t_s": t_s, "spindle_load_pct": np.where(turning, 40.0, 0.0), "spindle_rpm": np.where(turning, 2000.0, 0.0)})
    thin, _ = thinned(log, 100)
    assert np.allclose(thin["spindle_load_pct"][:-1], 40.0) and np.isclose(np.mean(thin["spindle_rpm"][:-1]), 1000.0, rtol=0.2)


def test_where_nothing_changed_rows_say_so() -> None:
    log = told(1000, hole=(200, 700))
    whole = unbroken(log)
    assert set(log.t_s) < set(whole.t_s) and np.diff(whole.t_s).max() == 20.0
    quiet = (whole.t_s > 199.0) & (whole.t_s < 700.0)
    assert set(whole["spindle_load_pct"][quiet]) == {log["spindle_load_pct"][199]} and unbroken(told(10)).t_s[-1] == 9.0


def test_a_mean_over_what_was_mostly_not_known_is_not_known() -> None:
    log = told(400)
    log["spindle_load_pct"][:200] = np.nan
    thin, _ = thinned(log, 100)
    assert (
        np.isnan(thin["spindle_load_pct"][thin.t_s < 195.0]).all()
        and np.isfinite(thin["spindle_load_pct"][thin.t_s > 205.0]).all()
    )


def test_stated_surroundings_come_in_where_none_are_recorded_only() -> None:
    log = told(10)
    assert with_ambient(log, None) is log
    stated = with_ambient(log, 21.5)
    assert set(stated["ambient_temp_c"]) == {21.5}
    assert with_ambient(stated, 30.0) is stated
