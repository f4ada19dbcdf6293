"""Thinned rows: means that keep what flowed, readings as they were, and nothing where nothing was told."""

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from cnctwin.composing.rows import thinned, with_ambient
from twin.runlog import RunLog, run_log


def told(seconds: int, *, hole: tuple[int, int] = (0, 0)) -> RunLog:
    """Return a row every second but in a hole: a load that rises, a temperature that steps."""
    t_s = np.array([t for t in range(seconds) if not hole[0] <= t < hole[1]], dtype=float)
    return run_log({"t_s": t_s, "spindle_load_pct": t_s % 7.0, "spindle_temp_c": np.floor(t_s / 10.0)})


def test_a_short_run_stays_as_it_is() -> None:
    log = told(100)
    assert thinned(log, 100) == (log, None)


@given(st.integers(min_value=200, max_value=2000), st.integers(min_value=20, max_value=150))
def test_what_flowed_is_kept_and_readings_are_not_averaged(seconds: int, rows_max: int) -> None:
    log = told(seconds)
    thin, period_s = thinned(log, rows_max)
    assert period_s is not None and len(thin) <= rows_max
    lasts = np.minimum(np.diff(thin.t_s, append=thin.t_s[-1] + period_s), log.t_s[-1] - thin.t_s)
    assert np.isclose(np.sum(thin["spindle_load_pct"] * lasts), np.sum(log["spindle_load_pct"][:-1]), rtol=1e-9)
    assert np.array_equal(thin["spindle_temp_c"], np.floor(thin.t_s / 10.0))


def test_a_hole_gets_no_row() -> None:
    thin, period_s = thinned(told(1000, hole=(200, 700)), 200)
    assert period_s == 5.0 and not np.any((thin.t_s > 200.0) & (thin.t_s < 700.0))


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
