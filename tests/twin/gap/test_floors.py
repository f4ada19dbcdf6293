"""What runs of a machine differ by when nothing has changed."""

import numpy as np
import pytest

from tests.twin.gap.small_case import MACHINE, air_case, axis_columns, case_of, columns_of, plant
from twin.gap.floors import Floors, lap_of, repeatability
from twin.gap.stages.disturbance import disturbance_of_repeats
from twin.gap.stages.plan import ground_of
from twin.runlog import run_log
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


def test_laps_of_a_run_are_repeats() -> None:
    lap = "G1 Z10 F3000\nG4 P300\nG1 Z0 F3000\nG4 P300\n"
    log = simulate(plant(), "G4 P300\n" + 5 * lap + "M30\n", seed=3).run
    (run,) = case_of(MACHINE, {"fit": axis_columns(log)}).runs
    assert lap_of(run.log) > 0
    assert {signal for signal, _ in repeatability([run], [], MACHINE).repeated} == {"z_pos_mm", "z_torque_a", "z_table_mm"}


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
