"""What runs of a machine differ by when nothing has changed."""

import numpy as np
import pytest

from tests.twin.gap import pushed_axis
from tests.twin.gap.small_case import MACHINE, air_case, axis_columns, case_of, columns_of, plant
from twin.gap.floors import Floors, lap_of, repeatability
from twin.gap.stages.disturbance import disturbance_of_repeats
from twin.gap.stages.plan import ground_of
from twin.runlog import RunLog, run_log
from twin.simulator.recorded import noise_of
from twin.simulator.simulation import simulate


def test_the_floor_is_what_repeated_runs_differ_by_over_the_root_of_two() -> None:
    columns = columns_of(air_case())
    apart = 0.02 * np.random.default_rng(1).standard_normal((2, len(columns["fit"]["t_s"])))
    for name, noise in zip(("fit", "fit again"), apart, strict=True):
        columns[name]["z_pos_mm"] = columns[name]["z_ref_mm"] + noise
    case = case_of(MACHINE, columns)
    floors = repeatability(case.runs, case.repeats(), MACHINE)
    of_position = [value for (signal, _), value in floors.repeated.items() if signal == "z_pos_mm"]
    assert of_position == pytest.approx([0.02] * len(of_position), rel=0.15)


def test_the_floor_is_never_below_the_noise_of_the_sensor() -> None:
    case = air_case()
    log = case.runs[0].log
    twice = {("z_pos_mm", regime): 1e-9 for regime in ("rest", "reversal", "acceleration", "constant speed +")}
    assert Floors(MACHINE, twice).of(log, "z_pos_mm").min() == pytest.approx(MACHINE.noise["position_mm"])


def test_runs_of_one_recording_twice_do_not_lower_the_floor_below_the_sensor() -> None:
    columns = columns_of(air_case())
    columns["fit again"] = columns["fit"]
    case = case_of(MACHINE, columns)
    floors = repeatability(case.runs, case.repeats(), MACHINE)
    assert floors.of(case.runs[0].log, "z_torque_a").min() == pytest.approx(MACHINE.noise["torque_a"])


def test_runs_that_were_read_at_other_times_say_nothing_of_each_other() -> None:
    columns = columns_of(air_case())
    rng = np.random.default_rng(1)
    columns["fit again"]["t_s"] = np.sort(rng.uniform(0.0, columns["fit"]["t_s"][-1], len(columns["fit"]["t_s"])))
    columns["fit again"]["t_s"] -= columns["fit again"]["t_s"][0]
    case = case_of(MACHINE, columns)
    floors = repeatability(case.runs, case.repeats(), MACHINE)
    assert not floors.repeated
    assert "no run was repeated" in floors.notes[0]


def test_laps_of_a_run_are_repeats() -> None:
    lap = "G1 Z10 F3000\nG4 P300\nG1 Z0 F3000\nG4 P300\n"
    log = simulate(plant(), "G4 P300\n" + 5 * lap + "M30\n", seed=3).run
    (run,) = case_of(MACHINE, {"fit": axis_columns(log)}).runs
    assert lap_of(run.log) > 0
    assert {signal for signal, _ in repeatability([run], [], MACHINE).repeated} == {"z_pos_mm", "z_torque_a", "z_table_mm"}


def laps(*logs: RunLog) -> Floors:
    """The floors of runs that go through their laps."""
    runs = case_of(pushed_axis.MACHINE, {f"run {i}": {"t_s": log.t_s} | dict(log.columns) for i, log in enumerate(logs)}).runs
    return repeatability(runs, [], pushed_axis.MACHINE)


@pytest.mark.parametrize("seed", [1, 2, 3])
@pytest.mark.parametrize("signal", ["x_pos_mm", "x_torque_a"])
def test_pushes_in_one_lap_of_several_are_gap_and_not_floor(signal: str, seed: int) -> None:
    pushed, free = (pushed_axis.recorded(5, laps, seed) for laps in ((2,), ()))
    floor, without = (float(np.sqrt(np.mean(laps(log).of(log, signal) ** 2))) for log in (pushed, free))
    assert floor == pytest.approx(without, rel=0.15)
    in_floors = (pushed[signal] - free[signal]) / laps(pushed).of(pushed, signal)
    assert np.sqrt(np.mean(in_floors**2)) > 5.0
    assert any("laps differ by far more than elsewhere" in note for note in laps(pushed).notes)


@pytest.mark.parametrize("seed", [1, 2, 5, 6])
def test_pushes_in_all_laps_of_two_runs_are_in_no_regimes_floor(seed: int) -> None:
    runs = [[pushed_axis.recorded(2, of, one, times=2) for one in (seed, seed + 50)] for of in ((0, 1), ())]
    pushed, free = (laps(*logs).repeated for logs in runs)
    assert max(pushed[key] / free[key] for key in free) < 1.6


def test_an_axis_that_repeats_badly_throughout_has_the_floor_of_that() -> None:
    log = pushed_axis.recorded(6)
    shaken = dict(log.columns) | {"x_torque_a": log["x_torque_a"] + 0.1 * np.random.default_rng(1).standard_normal(len(log))}
    floors = laps(run_log({"t_s": log.t_s} | shaken))
    assert [v for (s, _), v in floors.repeated.items() if s == "x_torque_a"] == pytest.approx([0.1] * 5, rel=0.15)


def test_more_laps_say_the_floor_better() -> None:
    few, many = (laps(pushed_axis.recorded(count)).error for count in (2, 9))
    assert set(few) == set(many)
    assert np.mean(list(many.values())) < 0.6 * np.mean(list(few.values()))


def test_a_run_without_laps_or_repeats_has_the_noise_of_its_sensors_and_says_so() -> None:
    log = pushed_axis.recorded(1)
    floors = laps(log)
    assert floors.repeated == floors.error == {}
    assert floors.of(log, "x_pos_mm") == pytest.approx(np.full(len(log), 3e-5), rel=0.2)
    assert any("no run was repeated" in note and "noise of the sensors alone" in note for note in floors.notes)


def test_a_sensor_that_reads_in_steps_has_a_noise_of_its_resolution() -> None:
    place = pushed_axis.lap_mm()
    log = run_log({"t_s": 0.001 * np.arange(len(place)), "x_ref_mm": place, "x_pos_mm": 0.5 * np.round(place / 0.5)})
    assert noise_of(pushed_axis.MACHINE, log, "x_pos_mm") == pytest.approx(0.5 / np.sqrt(12.0))


def test_without_repeats_the_disturbance_that_the_machine_states_counts() -> None:
    columns = columns_of(air_case())
    noise = dict(MACHINE.noise) | {"disturbance_force_n": 40.0, "disturbance_correlation_s": 0.03}
    told = MACHINE.model_copy(update={"noise": noise})
    one, other = (ground_of(case_of(m, {"fit": columns["fit"]}), frozenset()) for m in (MACHINE, told))
    assert one.disturbance is None and other.disturbance is not None
    assert other.disturbance.force_n == 40.0
    torque = [v for (signal, _), v in other.floors.expected.items() if signal == "z_torque_a"]
    assert one.floors.expected == {} and max(torque) > 2.0 * MACHINE.noise["torque_a"]


@pytest.mark.parametrize("rows", [1, 100, 3000])
def test_a_run_that_stands_has_no_laps(rows: int) -> None:
    assert lap_of(run_log({"t_s": np.arange(rows) * 0.001, "x_ref_mm": np.full(rows, 5.0)})) == 0


def test_the_disturbance_of_repeated_runs_has_the_size_of_the_one_that_was_there() -> None:
    ground = ground_of(air_case(), frozenset())
    assert ground.disturbance is not None
    assert 0.3 <= ground.disturbance.force_n <= 2.4  # 1 N
    assert ground.machine.noise["disturbance_force_n"] == ground.disturbance.force_n


def test_without_repeats_there_is_no_disturbance() -> None:
    assert disturbance_of_repeats(MACHINE, [], Floors(MACHINE, {})) == (None, {})
