"""Each figure against a truth that is known."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.signal import lfilter

from cnctwin.validation.block_bootstrap import block_samples, block_sums, bootstrapped
from cnctwin.validation.budgets import Budgets
from cnctwin.validation.evidence import Evidence, of_run, with_truth
from cnctwin.validation.figure import Figure, Verdict
from cnctwin.validation.force import judged_force
from cnctwin.validation.model import Twin
from cnctwin.validation.night import worst
from cnctwin.validation.temperature import judged_temperature
from cnctwin.validation.track import Track
from cnctwin.validation.validate import still_missing
from cnctwin.validation.vibration import judged_vibration
from tests.cnctwin.validation.made_night import START_S, changed_twin, told_twin, warm_night, working_spindle
from twin.machine import SpindleDrive
from twin.runlog import RunLog, run_log

BUDGETS = Budgets()


@pytest.fixture(scope="module")
def night() -> RunLog:
    return warm_night(4.0)


def test_the_interval_of_a_mean_covers_it_in_correlated_noise_as_often_as_it_says() -> None:
    covered, count = 0, 100
    for seed in range(count):
        rng = np.random.default_rng(seed)
        series = np.asarray(lfilter([1.0], [1.0, -0.9], rng.standard_normal(2000)))
        sums = block_sums(np.column_stack([series, np.ones(2000)]), block_samples(series))
        found = bootstrapped(sums, lambda s: s[:, 0] / s[:, 1], draws=400)
        assert found.low is not None and found.high is not None
        covered += found.low <= 0.0 <= found.high
    assert 0.90 * count <= covered <= 0.99 * count


def by_measure(figures: list[Figure]) -> dict[str, Figure]:
    return {one.measure: one for one in figures}


def test_the_twin_of_a_machine_that_differs_by_a_few_per_cent_is_within_its_budget(night: RunLog) -> None:
    found = by_measure(judged_temperature(told_twin(), of_run(night, "vmc"), BUDGETS))
    assert {one.verdict for one in found.values()} == {Verdict.WITHIN}
    assert 0.2 < (found["mae"].value or 0.0) < (found["rmse"].value or 0.0) < 0.8
    assert (found["mae_worst_hour"].value or 0.0) > (found["mae"].value or 0.0)
    assert found["mae"].hours == pytest.approx(4.0, abs=0.01) and found["mae_worst_hour"].hours == pytest.approx(1.0)
    assert found["mae"].low is not None and found["mae"].high is not None
    assert found["mae"].low < (found["mae"].value or 0.0) < found["mae"].high
    assert "begun with the measured temperature" in found["mae"].basis


def test_a_twin_whose_heat_is_wrong_is_over_its_budget(night: RunLog) -> None:
    found = by_measure(judged_temperature(changed_twin(resistance_k_per_w=0.24), of_run(night, "vmc"), BUDGETS))
    assert {one.verdict for one in found.values()} == {Verdict.OVER}


def test_one_bad_hour_is_over_though_all_hours_together_are_within(night: RunLog) -> None:
    wrong = night["spindle_temp_c"] + np.where((night.t_s >= 7200.0) & (night.t_s < 10_800.0), 4.0, 0.0)
    log = replace(night, columns={**night.columns, "spindle_temp_c": wrong})
    found = by_measure(judged_temperature(told_twin(), of_run(log, "vmc"), BUDGETS))
    assert (found["mae"].verdict, found["rmse"].verdict) == (Verdict.WITHIN, Verdict.WITHIN)
    assert (found["mae_worst_hour"].verdict, found["rmse_worst_hour"].verdict) == (Verdict.OVER, Verdict.OVER)
    assert found["mae_worst_hour"].value == pytest.approx(4.0, abs=0.6)


def test_less_than_an_hour_is_not_judged(night: RunLog) -> None:
    kept = night.t_s < 1800.0
    short = run_log({"t_s": night.t_s[kept], **{n: v[kept] for n, v in night.columns.items()}}, "short")
    found = judged_temperature(told_twin(), of_run(short, "vmc"), BUDGETS)
    assert {one.verdict for one in found} == {Verdict.TOO_LITTLE}
    assert all(one.value is None and "1 h are needed" in (one.reason or "") for one in found)
    (plan,) = still_missing(found, 0.0, 1800.0)
    keys = "temperature_mae, temperature_mae_worst_hour, temperature_rmse, temperature_rmse_worst_hour"
    assert plan == f"{keys}: 29.8 min of 1 h seen in 30 min; 30.2 min more, at the present rate in 30.3 min"


def test_what_was_not_recorded_is_in_the_plan_with_its_reason(night: RunLog) -> None:
    blind = run_log({"t_s": night.t_s, **{n: v for n, v in night.columns.items() if n != "spindle_temp_c"}}, "blind")
    (plan,) = still_missing(judged_temperature(told_twin(), of_run(blind, "vmc"), BUDGETS), 0.0, 1800.0)
    assert plan.endswith(": spindle_temp_c was not measured")


@pytest.mark.parametrize(
    ("missing", "reason"),
    [("spindle_temp_c", "was not measured"), ("spindle_rpm", "are not recorded"), ("ambient_temp_c", "neither recorded nor")],
)
def test_what_is_not_recorded_is_not_observable(missing: str, reason: str, night: RunLog) -> None:
    log = replace(night, columns={name: values for name, values in night.columns.items() if name != missing})
    found = judged_temperature(told_twin(), of_run(log, "vmc"), BUDGETS)
    assert {one.verdict for one in found} == {Verdict.UNSEEN}
    assert all(one.value is None and reason in (one.reason or "") for one in found)


def shaking(estimate_noise: float, seconds: int = 1800) -> tuple[Evidence, RunLog]:
    """A spindle that turns now and then; the estimate, and an accelerometer whose clock is 100 s behind."""
    rng = np.random.default_rng(4)
    t_s = np.arange(float(seconds))
    turning = np.cumsum(rng.random(seconds) < 0.03) % 2 == 1
    wander = np.convolve(rng.standard_normal(seconds + 40), np.ones(10) / 10**0.5, mode="valid")[:seconds]
    true_g = np.where(turning, 0.5 + 0.05 * wander, 0.01) + 0.002 * rng.standard_normal(seconds)
    estimate = np.where(turning, true_g + estimate_noise * rng.standard_normal(seconds), 0.01 + 1e-4 * rng.random(seconds))
    told = run_log({"t_s": t_s, "vibration_rms_g": estimate, "spindle_rpm": np.where(turning, 8500.0, 0.0)}, "told")
    truth = run_log({"t_s": t_s[100:] - 100.0, "vibration_rms_g": true_g[100:]}, "accelerometer")
    return of_run(told, "vmc"), truth


def test_vibration_that_goes_with_its_reference_is_within_and_its_clock_is_found() -> None:
    evidence, truth = shaking(0.01)
    placed = with_truth(evidence, truth, 60.0)
    assert placed.clock is not None and placed.clock.offset_s == pytest.approx(100.0, abs=0.2)
    (found,) = judged_vibration(placed, BUDGETS)
    assert found.verdict is Verdict.WITHIN and (found.value or 0.0) > 0.9
    assert found.low is not None and found.high is not None and found.low < (found.value or 0.0) < found.high <= 1.0
    assert 500 < found.samples < 1300 and "while the spindle turns" in found.basis


def test_that_a_standing_spindle_shakes_less_is_no_correlation() -> None:
    evidence, truth = shaking(0.2)
    placed = with_truth(evidence, truth, 60.0)
    assert placed.clock is not None and placed.clock.r > 0.6  # by standing and turning, which tells the time well
    (found,) = judged_vibration(placed, BUDGETS)
    assert found.verdict is Verdict.OVER and abs(found.value or 0.0) < 0.6


def test_a_reference_that_does_not_change_has_no_correlation() -> None:
    evidence, _ = shaking(0.01)
    flat = replace(evidence, truth={"vibration_rms_g": Track(np.arange(900.0), np.full(900, 0.5))})
    (found,) = judged_vibration(flat, BUDGETS)
    assert (found.verdict, found.value) == (Verdict.UNSEEN, None)
    assert found.reason == "the reference does not change, so nothing goes with it"


def test_without_a_reference_nothing_is_made_up() -> None:
    evidence, _ = shaking(0.01)
    (vibration,), (force,) = judged_vibration(evidence, BUDGETS), judged_force(told_twin(), evidence, BUDGETS)
    assert (vibration.verdict, vibration.value) == (Verdict.UNSEEN, None) and "no reference" in (vibration.reason or "")
    assert (force.verdict, force.value) == (Verdict.UNSEEN, None) and "the force was not measured" in (force.reason or "")


def cutting(scale: float, floor_n: float = 5.0) -> tuple[Evidence, RunLog]:
    """Parts that are cut, and a dynamometer beside them that sees `scale` times what spindle power makes of it."""
    spindle = working_spindle(0.5)
    drive = SpindleDrive(rated_power_kw=7.5, efficiency=0.85, idle_power_kw=0.22)
    power_kw = np.maximum(drive.efficiency * (spindle["spindle_load_pct"] / 100.0 * 7.5 - 0.22), 0.0)
    tangential = np.where(spindle["spindle_rpm"] > 0.0, 1000.0 * power_kw / (np.pi * 0.012 * 8500.0 / 60.0), 0.0)
    size = scale * tangential * np.hypot(1.0, 0.35) + floor_n
    size, t_s = np.repeat(size, 10), np.arange(10 * len(size)) * 0.1
    turn = 5.0 * t_s
    truth = run_log({"t_s": t_s, "force_x_n": size * np.cos(turn), "force_y_n": size * np.sin(turn)}, "dynamometer")
    return replace(of_run(run_log(spindle, "told"), "vmc"), run=None), truth


@pytest.mark.parametrize(("scale", "verdict"), [(1.0, Verdict.WITHIN), (1.15, Verdict.WITHIN), (1.4, Verdict.OVER)])
def test_force_by_spindle_power_is_judged_where_it_cuts(scale: float, verdict: Verdict) -> None:
    evidence, truth = cutting(scale)
    placed = with_truth(evidence, truth, 60.0)
    assert placed.clock is not None and placed.clock.offset_s == pytest.approx(0.0, abs=0.2)
    (found,) = judged_force(told_twin(), placed, BUDGETS)
    assert found.verdict is verdict and found.samples > 600
    assert "times √(1 + 0.35²)" in found.basis and "above 20 N" in found.basis


def test_a_few_seconds_of_cutting_are_not_judged() -> None:
    evidence, truth = cutting(1.0)
    (found,) = judged_force(told_twin(), with_truth(evidence, truth, 60.0), replace_budget(force_floor_n=5000.0))
    assert found.verdict is Verdict.TOO_LITTLE and found.value is None


def replace_budget(**values: float) -> Budgets:
    return Budgets(**{**BUDGETS.model_dump(), **values})


def test_a_truth_that_cannot_be_placed_gives_no_figure() -> None:
    evidence, _ = cutting(1.0)
    noise = np.random.default_rng(8).standard_normal((2, 600))
    truth = run_log({"t_s": np.arange(600.0), "force_x_n": noise[0], "force_y_n": noise[1]}, "elsewhere")
    (found,) = judged_force(told_twin(), with_truth(evidence, truth, 60.0), BUDGETS)
    assert found.verdict is Verdict.UNSEEN and "the truth's clock cannot be placed" in (found.reason or "")


def test_of_several_runs_the_worst_counts() -> None:
    one = Figure("temperature", "mae", "K", 2.0, Verdict.WITHIN, 1.0)
    other = Figure("temperature", "mae", "K", 2.0, Verdict.OVER, 2.5)
    none = Figure("temperature", "mae", "K", 2.0, Verdict.UNSEEN, reason="nothing")
    assert worst([[one], [none], [other]]) == [other] and worst([[none], [one]]) == [one]
    good, bad = (Figure("vibration", "r", "", 0.85, Verdict.WITHIN, value) for value in (0.95, 0.9))
    assert worst([[good], [bad]]) == [bad]
    axis = Figure("following_error", "rms_pct", "%", 5.0, Verdict.WITHIN, 1.0, on="x")
    unseen = Figure("following_error", "rms_pct", "%", 5.0, Verdict.UNSEEN, reason="no reference")
    assert worst([[unseen], [axis]]) == [axis]


def test_the_start_of_the_night_is_midnight() -> None:
    assert START_S % 86_400.0 == 0.0


def test_a_machine_may_have_constants_of_its_own_in_the_configuration(night: RunLog) -> None:
    tables = told_twin().tables
    apart = {**tables["thermal"], "machines": {"mill": {"resistance_k_per_w": 0.3}}}
    bare = Twin(None, {"thermal": apart})
    found = {name: by_measure(judged_temperature(bare, of_run(night, name), BUDGETS))["mae"] for name in ("vmc", "mill")}
    assert (found["vmc"].verdict, found["mill"].verdict) == (Verdict.WITHIN, Verdict.OVER)
