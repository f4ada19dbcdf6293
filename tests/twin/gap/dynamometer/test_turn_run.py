"""A long recording of forces becomes a few mean turns: where it cuts, at the speed and phase that the forces have."""

from dataclasses import replace

import numpy as np
import pytest
from numpy.typing import NDArray

from tests.twin.gap.dynamometer.dynamometer_case import ARC, machine, run_at_hand
from tests.twin.gap.dynamometer.milled import Bench, Cutter, forces, recorded
from twin.case import Run
from twin.gap.dynamometer.cutting import is_of_forces_alone
from twin.gap.dynamometer.turn_run import TurnRun, turn_run
from twin.runlog import RunLog, run_log

Floats = NDArray[np.float64]
CUTTER = Cutter(runout_mm=0.01)
QUIET = Bench(resonance_hz=0.0, noise_n=0.5, vibration_n=0.0, drift_n_per_s=2.0)


def turned(columns: dict[str, Floats], cutter: Cutter = CUTTER) -> tuple[Run | None, list[str]]:
    notes: list[str] = []
    log = run_log(columns)
    return turn_run(run_at_hand("cut", "fit", log), log, machine(cutter), notes), notes


def of_turns(columns: dict[str, Floats], cutter: Cutter = CUTTER) -> TurnRun:
    run, _ = turned(columns, cutter)
    assert isinstance(run, TurnRun)
    return run


def mean_turn(log: RunLog, run: TurnRun, stretch: int) -> Floats:
    here = log["stretch"] == stretch
    return np.stack([log[name][here].reshape(-1, run.points).mean(axis=0) for name in ("force_x_n", "force_y_n")])


@pytest.mark.parametrize("with_angle", [False, True])
def test_the_mean_turn_is_that_of_the_tool_whatever_the_speed_does(with_angle: bool) -> None:
    run = of_turns(recorded(CUTTER, (600.0,), arc=ARC, bench=QUIET, with_angle=with_angle))
    assert run.knows_phase is with_angle and run.knows_mean
    found = mean_turn(run.log, run, 0)
    angle = np.arange(2880) * 2.0 * np.pi / 2880
    true = forces(CUTTER, angle, np.full(2880, 600.0), 3012.0, np.full(2880, 2.0), ARC)
    orders = np.fft.rfft(true, axis=1)[:, :13] / 2880
    shape = np.fft.rfft(found, axis=1)[:, :13] / run.points
    assert np.abs(shape) == pytest.approx(np.abs(orders), abs=0.02 * np.abs(orders).max())


def test_the_speed_is_found_where_it_is_stated_wrongly() -> None:
    run = of_turns(recorded(CUTTER, (600.0,), arc=ARC, bench=replace(QUIET, speed_off=0.013, flutter=0.0)))
    assert run.log["spindle_rpm"][0] == pytest.approx(3039.0, rel=3e-4)


def test_a_recorded_angle_that_runs_away_is_replaced() -> None:
    columns = recorded(CUTTER, (600.0,), arc=ARC, bench=QUIET, with_angle=True)
    columns["spindle_angle_rad"] = columns["spindle_angle_rad"] * 1.003
    run, notes = turned(columns)
    assert isinstance(run, TurnRun) and not run.knows_phase
    assert any("spindle_angle_rad runs away" in note for note in notes)


def test_drift_is_taken_out_by_what_the_air_shows() -> None:
    still, drifting = (of_turns(recorded(CUTTER, (600.0,), arc=ARC, bench=replace(QUIET, drift_n_per_s=d))) for d in (0.0, 12.0))
    for name in ("force_x_n", "force_y_n"):
        assert drifting.log[name].mean() == pytest.approx(still.log[name].mean(), abs=0.5)


def test_without_air_the_mean_force_is_not_taken_for_known() -> None:
    run, notes = turned(recorded(CUTTER, (600.0,), arc=ARC, bench=QUIET, air_s=0.0))
    assert isinstance(run, TurnRun) and not run.knows_mean
    assert run.log["force_y_n"].mean() == pytest.approx(0.0, abs=1e-9)
    assert any("the mean force is not known" in note for note in notes)


def test_air_that_the_plan_does_not_know_of_is_seen_in_the_force() -> None:
    columns = recorded(CUTTER, (600.0,), arc=ARC, bench=QUIET)
    planned = of_turns(columns)
    unplanned = of_turns(columns | {"axial_depth_mm": np.full_like(columns["t_s"], 2.0)})
    assert unplanned.knows_mean
    assert mean_turn(unplanned.log, unplanned, 0).mean() == pytest.approx(mean_turn(planned.log, planned, 0).mean(), rel=0.02)


def test_each_feed_is_a_stretch_of_its_own() -> None:
    run = of_turns(recorded(CUTTER, (300.0, 600.0, 900.0), arc=ARC, bench=QUIET))
    assert np.unique(run.log["feed_mm_min"]).tolist() == [300.0, 600.0, 900.0]
    assert (np.diff(run.log.t_s) > 0.0).all()


def test_the_feed_may_come_from_references_and_then_has_a_direction() -> None:
    columns = recorded(CUTTER, (600.0,), arc=ARC, bench=QUIET)
    del columns["feed_mm_min"]
    run, notes = turned(columns | {"x_ref_mm": np.zeros_like(columns["t_s"]), "y_ref_mm": -10.0 * columns["t_s"]})
    assert isinstance(run, TurnRun)
    assert run.log["heading_rad"][0] == pytest.approx(-np.pi / 2.0)
    assert not any("direction of the feed" in note for note in notes)


def test_a_feed_along_another_axis_is_seen_in_the_forces() -> None:
    columns = recorded(CUTTER, (600.0,), arc=ARC, bench=QUIET)
    run, notes = turned(columns | {"force_x_n": -columns["force_y_n"], "force_y_n": columns["force_x_n"]})
    assert isinstance(run, TurnRun)
    assert run.log["heading_rad"][0] == pytest.approx(np.pi / 2.0)
    assert any("it is taken to go along y" in note for note in notes)


@pytest.mark.parametrize("lost", ["axial_depth_mm", "entry_angle_rad", "feed_mm_min", "spindle_rpm"])
def test_what_is_missing_is_said_in_one_line(lost: str) -> None:
    columns = recorded(CUTTER, (600.0,), arc=ARC, bench=QUIET, seconds=0.4)
    del columns[lost]
    assert turned(columns) == (None, [f"cut: the forces are not compared without {lost}"])


def test_too_few_samples_a_turn_are_refused() -> None:
    columns = {name: values[::20] for name, values in recorded(CUTTER, (600.0,), arc=ARC, bench=QUIET).items()}
    run, notes = turned({name: values[::3] for name, values in columns.items()})
    assert run is None
    assert "samples a turn do not carry the passing of 4 teeth" in notes[0]


def test_a_recording_with_axes_that_answer_is_left_alone() -> None:
    columns = recorded(CUTTER, (600.0,), arc=ARC, bench=QUIET, seconds=0.4)
    log = run_log(columns | {"x_ref_mm": columns["t_s"], "x_pos_mm": columns["t_s"] + 0.001})
    assert not is_of_forces_alone(log, "x")
    assert is_of_forces_alone(log, "z")


def test_a_depth_that_is_null_is_no_cut_and_one_that_is_sampled_slowly_is() -> None:
    columns = recorded(CUTTER, (600.0,), arc=ARC, bench=QUIET)
    planned = of_turns(columns)
    null = of_turns(columns | {"axial_depth_mm": np.where(columns["axial_depth_mm"] > 0.0, 2.0, np.nan)})
    slow = np.where(np.arange(len(columns["t_s"])) % 40 == 0, columns["axial_depth_mm"], np.nan)
    sparse = of_turns(columns | {"axial_depth_mm": slow})
    for run in (null, sparse):
        assert run.knows_mean
        assert mean_turn(run.log, run, 0) == pytest.approx(mean_turn(planned.log, planned, 0), abs=1.0)
