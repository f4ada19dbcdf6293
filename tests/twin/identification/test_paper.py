"""The reference paper's identifications, beside least squares, on a machine whose constants are known."""

import math
from itertools import count
from pathlib import Path

import numpy as np
import pytest

from twin.case import Case, Run, RunEntry, RunKind
from twin.identification.paper import (
    CUTTING_LIMIT,
    FRICTION_LIMIT,
    GENETIC,
    GENETIC_ALL,
    LEAST_SQUARES,
    FrictionObjective,
    PaperIdentification,
    PaperRow,
    identify_paper,
)
from twin.machine import Axis, MachineFile, machine_from_toml
from twin.process.milling import Milling, milling_force, tool_constants
from twin.runlog import run_log, write_run
from twin.servo.constants import axis_constants
from twin.servo.run import AxisInput, run_axes

MACHINE = """
[machine]
name = "small"
[axes.x]
mass_kg = 320.0
screw_lead_mm = 12.0
torque_constant_nm_per_a = 1.2
position_gain_per_s = 40.0
velocity_gain_a_s_per_mm = 0.30
velocity_integral_gain_a_per_mm = 9.0
torque_limit_a = 60.0
friction = {coulomb_n = 380.0, static_n = 520.0, stribeck_velocity_mm_s = 6.0, viscous_n_s_per_mm = 2.4}
[tool]
diameter_mm = 6.0
teeth = 2
tangential_coefficient_n_per_mm2 = 1230.0
radial_ratio = 0.50
"""
STATED = machine_from_toml(MACHINE)
TRUE_SCALES = {"S_pp": 1.1, "S_vp": 0.9, "S_vi": 1.2}
SPEEDS = (3.0, 6.0, 12.0, 30.0, 90.0)


def true_axis() -> Axis:
    axis = STATED.axes["x"]
    return axis.model_copy(
        update={
            "position_gain_per_s": axis.position_gain_per_s * TRUE_SCALES["S_pp"],
            "velocity_gain_a_s_per_mm": axis.velocity_gain_a_s_per_mm * TRUE_SCALES["S_vp"],
            "velocity_integral_gain_a_per_mm": axis.velocity_integral_gain_a_per_mm * TRUE_SCALES["S_vi"],
        }
    )


def air_run(path: Path) -> None:
    parts = [np.zeros(200)]
    for speed in SPEEDS:
        for sign in (1.0, -1.0):
            ramp = np.linspace(0.0, sign * speed, 60)
            parts += [ramp, np.full(350, sign * speed), ramp[::-1], np.zeros(80)]
    reference = 0.001 * np.cumsum(np.concatenate(parts))
    constants = {name: np.array([value]) for name, value in axis_constants(true_axis()).items()}
    run = run_axes(constants, AxisInput(reference[None, :], np.zeros(1, dtype=np.intp)))
    chance = np.random.default_rng(1)
    noise = 0.0002 * chance.standard_normal(len(reference)), 0.005 * chance.standard_normal(len(reference))
    columns = {
        "t_s": 0.001 * np.arange(len(reference)),
        "x_ref_mm": reference,
        "x_pos_mm": run.outputs["position_mm"][0] + noise[0],
        "x_torque_a": run.outputs["torque_a"][0] + noise[1],
    }
    write_run(run_log(columns, "air"), path)


def cut_run(path: Path, machine: MachineFile) -> None:
    assert machine.tool is not None
    ticks = 1500
    t_s = 0.001 * np.arange(ticks)
    angle = np.mod(2.0 * np.pi * 3777.0 / 60.0 * t_s, 2.0 * np.pi)
    steady = [np.full(ticks, value) for value in (3777.0, 5.0, 0.0, 0.8, 0.0, math.pi)]
    truth = machine.tool.model_copy(update={"tangential_coefficient_n_per_mm2": 1100.0, "radial_ratio": 0.42})
    force = milling_force(tool_constants(truth), truth.teeth, Milling(angle, *steady))
    noise = np.random.default_rng(2).standard_normal((2, ticks))
    columns = {
        "t_s": t_s,
        "x_ref_mm": 0.005 * np.arange(ticks),
        "y_ref_mm": np.zeros(ticks),
        "spindle_rpm": steady[0],
        "spindle_angle_rad": angle,
        "axial_depth_mm": steady[3],
        "entry_angle_rad": steady[4],
        "exit_angle_rad": steady[5],
        "force_x_n": force.force_x_n[0] + noise[0],
        "force_y_n": force.force_y_n[0] + noise[1],
    }
    write_run(run_log(columns, "cut"), path)


def small_case(folder: Path, kinds: tuple[RunKind, ...] = (RunKind.AIR, RunKind.CUT)) -> Case:
    machine = STATED.model_copy(update={"axes": STATED.axes | {"y": STATED.axes["x"]}})
    air_run(folder / "air.parquet")
    cut_run(folder / "cut.parquet", machine)
    runs = tuple(Run(RunEntry(file=f"{kind}.parquet", kind=kind, role="fit"), folder) for kind in kinds)
    return Case("small", machine, runs)


@pytest.fixture(scope="module")
def found(tmp_path_factory: pytest.TempPathFactory) -> PaperIdentification:
    ticks = count()
    return identify_paper(small_case(tmp_path_factory.mktemp("paper")), 1, clock=lambda: float(next(ticks)))


def rows_of(found: PaperIdentification, what: str) -> dict[str, PaperRow]:
    return {row.method: row for row in found.rows if row.what == what}


def test_friction_by_least_squares_is_never_worse_than_by_the_search(found: PaperIdentification) -> None:
    for side in "-+":
        rows = rows_of(found, f"friction x {side}")
        best = rows[LEAST_SQUARES]
        assert all(best.objective <= row.objective * 1.0001 for row in rows.values())
        assert best.values["coulomb_n"] == pytest.approx(380.0, rel=0.03)
        assert best.evaluations < 100
        assert rows[GENETIC].objective <= FRICTION_LIMIT
        assert rows[GENETIC_ALL].objective <= rows[GENETIC].objective


def test_the_controller_is_found_by_all(found: PaperIdentification) -> None:
    rows = rows_of(found, "controller x")
    for method in (f"{LEAST_SQUARES} on the control law", f"{LEAST_SQUARES} on the closed loop", GENETIC_ALL):
        assert rows[method].values == pytest.approx(TRUE_SCALES, rel=0.05)
    closed, searched = rows[f"{LEAST_SQUARES} on the closed loop"], rows[GENETIC_ALL]
    assert closed.objective < 1.05 * searched.objective
    assert closed.evaluations < searched.evaluations / 20


def test_cutting_agrees_in_what_the_resultant_tells(found: PaperIdentification) -> None:
    rows = rows_of(found, "cutting")
    assert rows[LEAST_SQUARES].values["tangential_coefficient_n_per_mm2"] == pytest.approx(1100.0, rel=0.02)
    assert rows[LEAST_SQUARES].values["radial_ratio"] == pytest.approx(0.42, rel=0.05)
    tells = [
        row.values["tangential_coefficient_n_per_mm2"] * math.hypot(1.0, row.values["radial_ratio"]) for row in rows.values()
    ]
    assert tells == pytest.approx([1100.0 * math.hypot(1.0, 0.42)] * len(tells), rel=0.02)
    assert rows[GENETIC].limit == CUTTING_LIMIT


def test_one_tooth_in_a_slot_does_not_tell_the_ratio_from_the_coefficient(found: PaperIdentification) -> None:
    assert any("does not tell K_t from K_e" in note for note in found.notes)


def test_an_axis_that_no_run_records_is_named(found: PaperIdentification) -> None:
    assert any(note.startswith("y: no air run") for note in found.notes)


def test_seconds_come_from_the_callers_clock_alone(found: PaperIdentification, tmp_path: Path) -> None:
    assert all(row.seconds == 1.0 for row in found.rows)
    without = identify_paper(small_case(tmp_path, (RunKind.CUT,)), 1)
    assert all(math.isnan(row.seconds) for row in without.rows)


def test_a_limit_of_100_n_rms_lets_a_poor_curve_pass(tmp_path: Path) -> None:
    case = small_case(tmp_path, (RunKind.AIR,))
    loose = identify_paper(case, 1, friction_objective=FrictionObjective.RMS)
    row = rows_of(loose, "friction x +")[GENETIC]
    assert row.unit == "N"
    assert row.evaluations == 64
    assert row.objective > 10.0 * rows_of(loose, "friction x +")[LEAST_SQUARES].objective
