"""Whatever is wrong with the recordings of a case is mended and said, left out and said, or one line."""

from collections.abc import Callable
from functools import cache

import numpy as np
import pytest
from numpy.typing import NDArray

from tests.twin.gap.small_case import HOT, MACHINE, air_case, case_of, columns_of, warm_case
from twin.case import Case, RunKind
from twin.errors import CaseError, TwinError
from twin.gap.inspection import inspected, slow_effects
from twin.machine import Tool

Floats = NDArray[np.float64]
Columns = dict[str, dict[str, Floats]]
NOT_WHEN_SLOW = frozenset(
    {
        *("presliding", "acceleration_feedforward", "payload", "velocity_feedback_delay", "torque_ripple"),
        *("friction_compensation", "position_integral", "reference_filter"),
        *("torque_limit", "lead_error", "sensor_lag", "runout", "helix", "load_peak_hold"),
    }
)


@cache
def good() -> Case:
    """Simulated when the first test asks for it, and not in each worker that collects."""
    return air_case()


def mutilated(change: Callable[[dict[str, Floats]], object], only: str = "") -> Case:
    """The good case with a change in the columns of its runs, or of one of them."""
    columns = columns_of(good())
    for name, own in columns.items():
        if only in ("", name):
            change(own)
    return case_of(MACHINE, columns)


def rows(pick: Callable[[int], NDArray[np.intp]]) -> Callable[[dict[str, Floats]], object]:
    """Only these rows."""

    def cut(own: dict[str, Floats]) -> None:
        kept = pick(len(own["t_s"]))
        own.update({name: values[kept] for name, values in own.items()})

    return cut


def test_a_good_case_is_used_as_it_is() -> None:
    looked, notes = inspected(good())
    assert notes == ()
    for before, after in zip(good().runs, looked.runs, strict=True):
        assert after.entry == before.entry
        assert np.allclose(after.log.t_s, before.log.t_s, atol=1e-9)
        for name, values in before.log.columns.items():
            np.testing.assert_array_equal(after.log[name], values)


def test_looking_twice_is_looking_once() -> None:
    once, _ = inspected(mutilated(rows(lambda n: np.r_[0:1000, 1200:n])))
    again, notes = inspected(once)
    assert not any("gaps" in note for note in notes)
    np.testing.assert_array_equal(again.runs[0].log["z_pos_mm"], once.runs[0].log["z_pos_mm"])


def test_rows_that_are_missing_are_not_compared_and_the_loops_run_through() -> None:
    looked, notes = inspected(mutilated(rows(lambda n: np.r_[0:1000, 1200:n])))
    assert "has gaps, 200 samples are missing" in notes[0]
    log = looked.runs[0].log
    assert len(log) == len(good().runs[0].log)
    assert np.isnan(log["z_pos_mm"][1000:1200]).all()
    assert np.isfinite(log["z_ref_mm"]).all()
    np.testing.assert_array_equal(log["z_pos_mm"][1400:], good().runs[0].log["z_pos_mm"][1400:])


def test_where_the_reference_was_not_recorded_nobody_knows_where_the_axis_went() -> None:
    def lost(own: dict[str, Floats]) -> None:
        own["z_ref_mm"][1000:1050] = np.nan

    log = inspected(mutilated(lost))[0].runs[0].log
    assert np.isnan(log["z_pos_mm"][1000:1200]).all()
    assert np.isfinite(log["z_pos_mm"][:1000]).all()
    assert np.isfinite(log["z_pos_mm"][1300:]).all()


def test_stamps_that_jitter_move_no_sample() -> None:
    def shaken(own: dict[str, Floats]) -> None:
        own["t_s"] = np.sort(own["t_s"] + 3e-4 * np.random.default_rng(1).standard_normal(len(own["t_s"])))

    looked, notes = inspected(mutilated(shaken))
    assert "time stamps jitter by up to" in notes[0]
    np.testing.assert_array_equal(looked.runs[0].log["z_pos_mm"], good().runs[0].log["z_pos_mm"])


def test_one_missing_sample_is_no_jitter() -> None:
    looked, _ = inspected(mutilated(rows(lambda n: np.delete(np.arange(n), 1500))))
    assert np.flatnonzero(np.isnan(looked.runs[0].log["z_pos_mm"])).tolist() == [1500]


def test_a_clock_that_goes_wrong_is_said_when_it_can_be_seen() -> None:
    faster = mutilated(lambda own: own.update(t_s=1.02 * own["t_s"]))
    looked, notes = inspected(faster)
    assert "sampled every 1.02 ms" in notes[0]
    assert looked.runs[0].log.t_s[-1] == pytest.approx(good().runs[0].log.t_s[-1])


def test_a_slow_recording_is_compared_where_the_reference_goes_on_evenly() -> None:
    slow = mutilated(rows(lambda n: np.arange(0, n, 40)))
    looked, notes = inspected(slow)
    assert "is sampled every 40 ms" in notes[0]
    log = looked.runs[0].log
    compared = np.isfinite(log["z_pos_mm"])
    assert 0 < compared.sum() <= len(slow.runs[0].log)
    true = good().runs[0].log
    np.testing.assert_array_equal(log["z_pos_mm"][compared], true["z_pos_mm"][: len(log)][compared])
    assert np.abs(log["z_ref_mm"][compared] - true["z_ref_mm"][: len(log)][compared]).max() < 1e-6
    assert slow_effects(looked) == NOT_WHEN_SLOW


def test_one_slow_run_among_others_hides_no_effect() -> None:
    looked, _ = inspected(mutilated(rows(lambda n: np.arange(0, n, 100)), only="check"))
    assert slow_effects(looked) == frozenset()


def test_the_last_samples_of_a_rest_are_kept_since_a_motion_starts_from_them() -> None:
    looked, _ = inspected(mutilated(rows(lambda n: np.arange(0, n, 40))))
    log = looked.runs[0].log
    begins = np.flatnonzero(np.diff(log["z_ref_mm"]) != 0)
    begins = begins[np.concatenate([[True], np.diff(begins) > 300])]
    assert np.isfinite(log["z_torque_a"][begins]).any()


@pytest.mark.parametrize("count", [1, 2, 5])
def test_a_few_samples_are_one_line_or_nothing_to_compare(count: int) -> None:
    try:
        looked, _ = inspected(mutilated(rows(lambda n: np.arange(count))))
    except TwinError as error:
        assert len(str(error).splitlines()) == 1
    else:
        assert all(len(run.log) == count for run in looked.runs)


def test_what_is_infinite_is_left_out() -> None:
    def spoilt(own: dict[str, Floats]) -> None:
        own["z_torque_a"][50:60] = np.inf

    looked, notes = inspected(mutilated(spoilt))
    assert "z_torque_a is infinite in 10 samples" in notes[0]
    assert np.isnan(looked.runs[0].log["z_torque_a"][50:60]).all()


def test_a_column_without_a_value_is_not_recorded() -> None:
    looked, notes = inspected(mutilated(lambda own: own.update(z_table_mm=np.full(len(own["t_s"]), np.nan))))
    assert "z_table_mm has no value at all" in notes[0]
    assert "z_table_mm" not in looked.runs[0].log.columns


def test_a_signal_that_is_slower_than_its_run_misses_nothing() -> None:
    def seldom(own: dict[str, Floats]) -> None:
        own["z_torque_a"][np.arange(len(own["t_s"])) % 10 != 0] = np.nan

    assert inspected(mutilated(seldom))[1] == ()

    def lost(own: dict[str, Floats]) -> None:
        own["z_torque_a"][200:500] = np.nan

    assert "z_torque_a has no value in 300 of" in inspected(mutilated(lost))[1][0]


def test_a_sensor_that_says_the_same_all_the_time_is_mentioned() -> None:
    _, notes = inspected(mutilated(lambda own: own.update(z_torque_a=np.zeros(len(own["t_s"])))))
    assert "z_torque_a is 0 throughout" in notes[0]


@pytest.mark.parametrize("factor", [1e3, 1 / 25.4, -1.0])
def test_an_axis_whose_reference_has_another_unit_is_left_out(factor: float) -> None:
    with pytest.raises(CaseError, match="z_ref_mm has another unit or sign, and axis z is left out"):
        inspected(mutilated(lambda own: own.update(z_ref_mm=factor * own["z_ref_mm"])))


def test_one_position_in_another_unit_is_mentioned_and_kept() -> None:
    looked, notes = inspected(mutilated(lambda own: own.update(z_pos_mm=own["z_pos_mm"] / 25.4)))
    assert "z_pos_mm goes 0.039" in notes[0]
    assert "mm for each mm of z_ref_mm" in notes[0]
    assert looked.runs[0].log.has("z_pos_mm")


def test_a_repeat_of_another_program_is_no_repeat() -> None:
    columns = columns_of(good())
    count = min(len(own["t_s"]) for own in columns.values())
    columns = {name: {n: v[:count] for n, v in own.items()} for name, own in columns.items()}
    columns["fit again"] = {name: values.copy() for name, values in columns["check"].items()}
    looked, notes = inspected(case_of(MACHINE, columns))
    assert "said to repeat fit, but their z_ref_mm are up to" in notes[0]
    assert looked.repeats() == ()


def test_repeats_that_contradict_each_other_are_no_repeats() -> None:
    looked, notes = inspected(mutilated(lambda own: own.update(z_torque_a=own["z_torque_a"] + 5.0), only="fit again"))
    assert "said to repeat fit, but their z_torque_a differ by 5" in notes[0]
    assert looked.repeats() == ()


def test_a_repeat_that_ended_a_little_earlier_is_one() -> None:
    looked, notes = inspected(mutilated(rows(lambda n: np.arange(n - 40)), only="fit again"))
    assert "the first" in notes[0]
    one, other = looked.repeats()[0]
    assert len(one.log) == len(other.log)


@pytest.mark.parametrize("missing", ["spindle_rpm", "spindle_load_pct", "ambient_temp_c", "spindle_temp_c"])
def test_heat_without_what_drives_it_is_one_line_that_names_it(missing: str) -> None:
    columns = columns_of(warm_case())
    for own in columns.values():
        del own[missing]
    with pytest.raises(CaseError, match=missing):
        inspected(case_of(HOT, columns, RunKind.WARMUP))


def test_heat_that_goes_undriven_and_odd_units_are_mentioned() -> None:
    columns = columns_of(warm_case())
    columns["fit"]["spindle_load_pct"][500:700] = np.nan
    columns["check"]["spindle_rpm"] /= 60.0
    _, notes = inspected(case_of(HOT, columns, RunKind.WARMUP))
    assert any("spindle_load_pct has no value for 402 s from 998 s on" in note for note in notes)
    assert any("spindle_rpm is at most" in note and "rev/min" in note for note in notes)


@pytest.mark.parametrize(("column", "unit"), [("spindle_temp_c", "°F"), ("ambient_temp_c", "°F"), ("spindle_temp_c", "K")])
def test_a_temperature_that_starts_as_the_other_one_in_another_unit_is_mentioned(column: str, unit: str) -> None:
    columns = columns_of(warm_case())
    for own in columns.values():
        own[column] = 1.8 * own[column] + 32.0 if unit == "°F" else own[column] + 273.15
    _, notes = inspected(case_of(HOT, columns, RunKind.WARMUP))
    assert f"{column} starts at" in notes[0]
    assert notes[0].endswith(f"is it in {unit}?")


def cutting(own: dict[str, Floats]) -> None:
    """Adds a cut from 1 s to 2 s, 3000 rev/min, and the load of it."""
    t_s = own["t_s"]
    own["spindle_rpm"] = np.full(len(t_s), 3000.0)
    own["spindle_angle_rad"] = (100.0 * np.pi * t_s) % (2.0 * np.pi)
    own["axial_depth_mm"] = np.where((t_s > 1.0) & (t_s < 2.0), 2.0, 0.0)
    own["entry_angle_rad"], own["exit_angle_rad"] = np.zeros(len(t_s)), np.full(len(t_s), np.pi)
    own["spindle_load_pct"] = 5.0 + 20.0 * (own["axial_depth_mm"] > 0.0)


TOOL = Tool(diameter_mm=10.0, teeth=2, tangential_coefficient_n_per_mm2=900.0, radial_ratio=0.4)


@pytest.mark.parametrize(
    ("change", "said"),
    [
        (lambda own: own.pop("entry_angle_rad"), "without entry_angle_rad"),
        (lambda own: own.update(exit_angle_rad=np.degrees(own["exit_angle_rad"])), "exit_angle_rad goes up to 180"),
        (lambda own: own.update(spindle_angle_rad=np.degrees(own["spindle_angle_rad"])), "do not turn together"),
        (lambda own: own.update(axial_depth_mm=-own["axial_depth_mm"]), "axial_depth_mm is negative"),
    ],
)
def test_what_a_cut_of_unknown_force_shows_is_not_compared(change: Callable[[dict[str, Floats]], object], said: str) -> None:
    columns = columns_of(good())
    for own in columns.values():
        cutting(own)
        change(own)
    machine = MACHINE.model_copy(update={"tool": TOOL})
    looked, notes = inspected(case_of(machine, columns, RunKind.CUT))
    assert any(said in note for note in notes)
    assert np.isnan(looked.runs[0].log["spindle_load_pct"][1100:1900]).all()
    assert np.isfinite(looked.runs[0].log["z_pos_mm"]).all()
