"""Measured against twin: the right signals, the right part of the run, and samples that come back as they were."""

import base64
import json
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from cnctwin.reports.gap.chart import envelope, frame_of, path, ticks
from cnctwin.reports.gap.page import report_html
from cnctwin.reports.gap.trace_choice import TRACES_MAX, at_own_samples, chosen, window_s
from cnctwin.reports.gap.trace_data import BYTES_MAX, MISSING, as_script, packed, rows_max, thinned
from tests.cnctwin.reports.gap.diagnosed import explained, traces, unknown, warming
from tests.cnctwin.reports.gap.page_reader import PageReader
from twin.gap.diagnosis import Trace


def trace(gap: np.ndarray, *, signal: str = "z_torque_a", period_s: float = 0.001, fitted: bool = False) -> Trace:
    """A recording of nothing beside a twin that is off by `gap`, and one that is not."""
    n = len(gap)
    zero = np.zeros(n)
    return Trace(
        "run", signal, "A", np.arange(n) * period_s, zero, gap, zero, np.ones(n), np.zeros(n, np.int8), ("rest",), fitted
    )


def unpacked(series: dict[str, object]) -> np.ndarray:
    whole = np.frombuffer(base64.b64decode(str(series["data"])), dtype="<u2").astype(float)
    return np.where(whole == MISSING, np.nan, float(str(series["low"])) + float(str(series["step"])) * whole)


def test_the_signal_with_the_largest_gap_comes_first_and_an_axis_only_once() -> None:
    names = [t.signal for t in chosen(traces())]
    assert names[0] == "z_torque_a"
    assert not {"z_pos_mm", "z_table_mm"} <= set(names)
    assert len(names) <= TRACES_MAX


def test_a_run_that_was_not_fitted_is_looked_at_even_if_its_gap_is_smaller() -> None:
    ones = np.ones(1000)
    assert not chosen([trace(9.0 * ones, fitted=True), trace(5.0 * ones)])[0].fitted


def test_a_healthy_machine_shows_one_signal() -> None:
    assert len(chosen([trace(0.9 * np.ones(1000), signal=s) for s in ("x_pos_mm", "y_pos_mm", "force_x_n")])) == 1


def test_the_signal_of_which_most_is_left_is_shown_however_small_its_gap_was() -> None:
    ones = np.ones(1000)
    large, other = trace(90.0 * ones), trace(50.0 * ones, signal="y_torque_a")
    left = replace(trace(3.0 * ones, signal="force_x_n"), after=3.0 * ones)
    small = trace(2.0 * ones, signal="force_y_n")
    assert [t.signal for t in chosen([large, other, left, small])] == ["z_torque_a", "y_torque_a", "force_x_n"]


@pytest.mark.parametrize("at", [0.7, 6.0, 18.3, 24.6])
def test_the_window_is_where_the_gap_is(at: float) -> None:
    t_s = np.arange(25_000) * 0.001
    low, high = window_s(trace(np.where(np.abs(t_s - at) < 0.3, 5.0, 0.0)))
    assert low <= at - 0.2 and high >= at + 0.2
    assert high - low < 3.0


def test_a_single_spike_does_not_decide_the_window() -> None:
    t_s = np.arange(25_000) * 0.001
    gap = np.where(np.abs(t_s - 18.0) < 1.0, 2.0, 0.0)
    gap[3000] = 5000.0
    low, high = window_s(trace(gap))
    assert low < 18.0 < high


def test_slow_and_short_recordings_are_looked_at_whole() -> None:
    assert window_s(warming().traces[0]) == (0.0, 7919.0)
    assert window_s(trace(np.ones(300))) == (0.0, 0.299)


def slow_meter(*, without: slice = slice(0)) -> Trace:
    """A meter that has a value at every hundredth row of ten seconds; `without` are rows without any."""
    given = trace(np.where(np.arange(10_000) % 100 == 50, 3.0, np.nan), signal="spindle_load_pct")
    given.before[without] = np.nan
    return replace(given, measured=given.before - 1.0, floor=np.where(np.isfinite(given.before), 1.0, np.nan))


def test_a_meter_that_is_slower_than_its_run_is_one_line_over_the_whole_run() -> None:
    given = at_own_samples(slow_meter())
    assert window_s(given) == (0.0, 9.999)
    page = PageReader(report_html(replace(explained(), traces=(slow_meter(),)), "machine"))
    for line in page.of("path", data_series="before"):
        assert line["d"].count("M") == 1 and len(line["d"].split("M")[1].split()) == 2 * 100
    assert json.loads(next(s for s in page.scripts if s.startswith("[")))[0]["n"] == 102


def test_a_hole_in_the_samples_of_a_slow_meter_breaks_its_line() -> None:
    given = at_own_samples(slow_meter(without=slice(4000, 4400)))
    x, y = given.t_s, given.before
    assert path(frame_of(x, [y], 100), x, y).count("M") == 2


def test_a_signal_at_every_row_of_its_run_stays_as_it_is() -> None:
    gap = np.ones(1000)
    gap[300:600] = np.nan
    given = trace(gap)
    assert at_own_samples(replace(given, measured=gap)).t_s is given.t_s


def test_samples_come_back_as_they_were() -> None:
    values = np.random.default_rng(1).normal(0.0, 40.0, 5000)
    values[100:140] = np.nan
    back = unpacked(packed(trace(values), 1000.0, (0.0, 1.0))["before"])
    assert np.nanmax(np.abs(back - 1000.0 * values)) < 1000.0 * np.ptp(values[np.isfinite(values)]) / 60_000
    assert np.array_equal(np.isnan(back), np.isnan(values))


def test_thinning_keeps_every_peak_and_invents_no_sample() -> None:
    rng = np.random.default_rng(2)
    whole = trace(rng.normal(0.0, 1.0, 400_000))
    whole.before[123_456] = 99.0
    whole.measured[200_000] = -77.0
    thin = thinned(whole, 20_000)
    assert len(thin.t_s) <= 20_000
    assert thin.before.max() == 99.0 and thin.measured.min() == -77.0
    rows = np.searchsorted(whole.t_s, thin.t_s)
    assert np.array_equal(whole.t_s[rows], thin.t_s) and np.array_equal(whole.before[rows], thin.before)
    assert thin.t_s[0] == whole.t_s[0] and thin.t_s[-1] == whole.t_s[-1]
    assert thinned(thin, 20_000) is thin


def test_five_minutes_at_a_kilohertz_still_makes_a_small_page() -> None:
    given = explained()
    rng = np.random.default_rng(3)
    long = tuple(trace(rng.normal(0.0, 5.0, 300_000), signal=s) for s in ("x_torque_a", "y_torque_a", "z_torque_a", "force_x_n"))
    text = report_html(replace(given, traces=long), "machine")
    assert len(text.encode()) < 1_500_000
    samples = json.loads(next(s for s in PageReader(text).scripts if s.startswith("[")))
    assert len(samples) == 4 and all(0 < s["n"] <= rows_max(4) and "t" in s for s in samples)
    assert sum(len(s[k]["data"]) for s in samples for k in ("measured", "before", "after")) <= BYTES_MAX


def test_floor_and_regimes_travel_as_where_they_change() -> None:
    given = replace(trace(np.ones(1000)), floor=np.repeat([1.0, np.nan, 3.0], [400, 100, 500]))
    sent = packed(given, 2.0, (0.0, 1.0))
    assert sent["floor"] == [[0, 2.0], [400, None], [500, 6.0]]
    assert sent["regime"] == [[0, 0]]
    assert json.loads(as_script([sent])) == [sent]


def test_a_floor_that_changes_all_the_time_is_sent_in_blocks() -> None:
    floor = 1.0 + np.random.default_rng(5).random(20_000)
    steps = packed(replace(trace(np.ones(20_000)), floor=floor), 1.0, (0.0, 1.0))["floor"]
    assert 100 < len(steps) <= 500
    assert all(1.0 < value < 2.0 for _, value in steps)


def test_a_recording_without_a_sample_draws_nothing_and_breaks_nothing() -> None:
    empty = np.full(1000, np.nan)
    given = replace(trace(empty), measured=empty, after=empty, floor=empty)
    page = PageReader(report_html(replace(explained(), traces=(given,)), "machine"))
    assert len(page.of("figure")) == 1


def test_a_twin_without_causes_is_one_line() -> None:
    page = PageReader(report_html(unknown(), "machine"))
    assert not page.of("path", data_series="after")
    assert page.of("path", data_series="before")
    assert "twin after" not in page.text


def test_a_gap_of_position_is_shown_in_micrometres_and_of_temperature_in_kelvin() -> None:
    assert "twin − measured, µm" in PageReader(report_html(explained(), "machine")).text
    warm = PageReader(report_html(warming(), "machine")).text
    assert "twin − measured, K" in warm and "measured and twin, °C" in warm


@given(
    st.lists(st.floats(-1e6, 1e6) | st.just(float("nan")), min_size=2, max_size=60),
    st.integers(2, 40),
)
@settings(max_examples=60, deadline=None)
def test_an_envelope_keeps_least_and_greatest_and_a_path_only_numbers(values: list[float], columns: int) -> None:
    y = np.array(values)
    x = np.linspace(0.0, 1000.0, len(y))
    _, kept = envelope(x, y, columns)
    if np.isfinite(y).any():
        assert np.nanmin(kept) == np.nanmin(y) and np.nanmax(kept) == np.nanmax(y)
    drawn = path(frame_of(x, [y], 100), x, y, columns)
    assert "nan" not in drawn and "inf" not in drawn


@pytest.mark.parametrize(("low", "high"), [(0.0, 1.0), (-3e-5, 8e-5), (1e6, 1e6 + 3), (-7.0, 123.0)])
def test_ticks_are_few_even_and_within(low: float, high: float) -> None:
    at = ticks(low, high, 5)
    assert 2 <= len(at) <= 9
    assert low - 1e-9 <= min(at) and max(at) <= high + 1e-9
    assert np.ptp(np.diff(at)) < 1e-9 * max(abs(high), 1.0)
