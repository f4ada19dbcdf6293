"""Following error and cycle time: simulated, and against recordings of real machines."""

from pathlib import Path

import numpy as np
import pytest

from benchmarks.programs.columns import program_columns
from cnctwin.errors import UsageError
from cnctwin.validation.budgets import Budgets
from cnctwin.validation.cycle_time import Cycle, Cycles, judged_cycle_time, texts_of
from cnctwin.validation.evidence import of_run
from cnctwin.validation.figure import Figure, Verdict
from cnctwin.validation.following_error import judged_following_error
from cnctwin.validation.force import judged_force
from cnctwin.validation.model import Twin
from tests.recordings import recording
from tests.twin.gap.programs.written import made, plate_runs, shop_program
from twin.machine import MachineFile, machine_from_toml
from twin.motion.sampling import sampled
from twin.runlog import RunLog, run_log
from twin.simulator.simulation import simulate

BUDGETS = Budgets()
MILL = """
[machine]
name = "mill"
servo_period_s = 0.001
[axes.x]
mass_kg = 320.0
screw_lead_mm = 16.0
torque_constant_nm_per_a = 1.2
position_gain_per_s = 50.0
velocity_gain_a_s_per_mm = 0.30
velocity_integral_gain_a_per_mm = 9.0
torque_limit_a = 30.0
[axes.x.friction]
coulomb_n = 280.0
static_n = 360.0
stribeck_velocity_mm_s = 6.0
viscous_n_s_per_mm = 1.6
[tool]
diameter_mm = 12.0
teeth = 3
tangential_coefficient_n_per_mm2 = 780.0
radial_ratio = 0.35
[stock]
min_mm = [0.0, 0.0, -20.0]
max_mm = [100.0, 40.0, 0.0]
[program]
rapid_mm_min = 20000.0
acceleration_mm_s2 = 2500.0
tool_change_s = 4.0
"""
SLOT = "G21 G90 G17\nS6000 M3\nG0 X-10 Y10 Z5\nG0 Z-2\nG1 X12 F1500\nG1 X16 F900\nG0 Z5\nM5\nM30\n"


def mill(**changes: float) -> MachineFile:
    """The mill, with other figures for its X axis or its material."""
    told = machine_from_toml(MILL)
    axis, tool = told.axes["x"], told.tool
    assert tool is not None
    own = {name: value for name, value in changes.items() if name in type(axis).model_fields}
    cut = {name: value for name, value in changes.items() if name in type(tool).model_fields}
    return told.model_copy(update={"axes": {"x": axis.model_copy(update=own)}, "tool": tool.model_copy(update=cut)})


@pytest.fixture(scope="module")
def slot() -> RunLog:
    """Return what the mill records of a slot: it differs by a few per cent from what the twin is told."""
    return simulate(mill(mass_kg=335.0, tangential_coefficient_n_per_mm2=814.0), SLOT, seed=1).run


def followed(machine: MachineFile, log: RunLog) -> Figure:
    (found,) = judged_following_error(Twin(machine, {}), of_run(log, "mill"), BUDGETS)
    return found


def test_a_twin_with_the_right_gains_follows_and_one_with_wrong_ones_does_not(slot: RunLog) -> None:
    right, wrong = followed(mill(), slot), followed(mill(position_gain_per_s=45.0), slot)
    assert right.verdict is Verdict.WITHIN and right.on == "x" and (right.value or 99.0) < 1.0
    assert wrong.verdict is Verdict.OVER and 5.0 < (wrong.value or 0.0) < 20.0


def test_force_of_a_recorded_cut_is_that_of_the_milling_model(slot: RunLog) -> None:
    def judged(machine: MachineFile, **more: float) -> Figure:
        budgets = Budgets(**{**BUDGETS.model_dump(), "force_cutting_s_min": 0.5, **more})
        (found,) = judged_force(Twin(machine, {}), of_run(slot, "mill"), budgets)
        return found

    right, wrong = judged(mill()), judged(mill(tangential_coefficient_n_per_mm2=1100.0))
    assert right.verdict is Verdict.WITHIN and right.value == pytest.approx(100 * (1 - 780 / 814), abs=0.5)
    assert wrong.verdict is Verdict.OVER and "milling model over the recorded cut" in wrong.basis
    assert judged(mill(), force_cutting_s_min=10.0).verdict is Verdict.TOO_LITTLE


def test_without_a_reference_or_a_described_axis_it_is_not_observable(slot: RunLog) -> None:
    bare = run_log({"t_s": slot.t_s, "spindle_rpm": slot["spindle_rpm"]}, "bare")
    assert followed(mill(), bare).reason == "position references are not recorded; a store has none, a servo trace does"
    (none,) = judged_following_error(Twin(None, {}), of_run(slot, "mill"), BUDGETS)
    assert none.verdict is Verdict.UNSEEN and "no machine.toml describes the axes" in (none.reason or "")


def test_the_following_error_of_a_real_axis() -> None:
    """EMPS: a published model, of a second half of the recording that it was fitted without; 578 µm rms."""
    from scipy.io import loadmat

    data = loadmat(recording("emps/DATA_EMPS.mat"))
    t_s, ref, pos, force = (np.ravel(data[name]) for name in ("t", "qg", "qm", "vir"))
    half = slice(len(t_s) // 2, None)
    columns = {"t_s": t_s[half] - t_s[half][0], "x_ref_mm": 1000.0 * ref[half], "x_pos_mm": 1000.0 * pos[half]}
    log = run_log(columns | {"x_torque_a": force[half]}, "EMPS")
    machine = machine_from_toml(
        "[machine]\nname = 'emps'\nservo_period_s = 0.001\n[axes.x]\nmass_kg = 95.11\nforce_per_command_n = 35.15\n"
        "position_gain_per_s = 160.18\nvelocity_gain_a_s_per_mm = 0.24345\ntorque_limit_a = 10.0\n"
        "[axes.x.friction]\ncoulomb_n = 20.39\nstatic_n = 20.39\nstribeck_velocity_mm_s = 1.0\nviscous_n_s_per_mm = 0.2035\n"
    )
    found = followed(machine, log)
    assert found.verdict is Verdict.WITHIN and "of 57" in found.basis
    assert 0.2 < (found.value or 0.0) < 1.0 and found.low is not None and found.high is not None


def timed(texts: dict[str, Path], *cycles: Cycle, machine: MachineFile | None = None, reason: str = "") -> list[Figure]:
    return judged_cycle_time(Twin(machine or machine_from_toml(MILL), {}), Cycles(cycles, texts, reason), BUDGETS)


def shop(folder: Path, name: str = "O1") -> tuple[str, dict[str, Path]]:
    text = shop_program(2000.0)
    (folder / f"{name}.nc").write_text(text)
    return text, texts_of(folder, [name])


def test_a_program_that_takes_what_the_twin_says_is_within(tmp_path: Path) -> None:
    text, texts = shop(tmp_path)
    machine = machine_from_toml(MILL)
    plan = simulate(machine.model_copy(update={"stock": None}), text).plan
    runs = [Cycle("O1", run_log(program_columns(sampled(plan, 0.15)), "run"))] * 3
    (found,) = timed(texts, *runs)
    assert found.verdict is Verdict.WITHIN and found.on == "O1" and found.samples == 3 and (found.value or 99.0) < 0.5


def test_a_program_that_takes_longer_is_over_with_both_times_said(tmp_path: Path) -> None:
    text, texts = shop(tmp_path)
    slower = made(text, {"tool_change_time": {"change_s": 14.0}, "block_overhead": {"block_s": 0.05}})
    (found,) = timed(texts, Cycle("O1", run_log(slower, "run")))
    assert found.verdict is Verdict.OVER and "predicted" in found.basis and "took" in found.basis


def test_what_is_not_given_or_another_program_is_not_judged(tmp_path: Path) -> None:
    text, texts = shop(tmp_path)
    run = Cycle("O1", run_log(made(text, {}), "run"))
    assert [one.reason for one in timed({}, run)] == ["ran 1 times; its text is not among the programs given"]
    assert [one.reason for one in timed(texts, reason="none ran")] == ["none ran"]
    assert "[program]" in (
        timed(texts, run, machine=machine_from_toml("[machine]\nname = 'm'\nservo_period_s = 0.001\n"))[0].reason or ""
    )
    other = Cycle("O1", run_log(made(shop_program(2000.0, (1, 2, 3)), {}), "run"))
    (found,) = timed(texts, other)
    assert found.verdict is Verdict.UNSEEN and "ran another program than the one given" in (found.reason or "")


def test_programs_are_found_by_the_names_that_controls_tell(tmp_path: Path) -> None:
    for name in ("O1701.nc", "PLATE.NC", "part.h"):
        (tmp_path / name).write_text("M30\n")
    told = ["O1701", "/PRG/PLATE", r"TNC:\nc\part.h", "../secret", "absent", ""]
    found = texts_of(tmp_path, told)
    assert {name: path.name for name, path in found.items()} == {"O1701": "O1701.nc", "/PRG/PLATE": "PLATE.NC", told[2]: "part.h"}
    with pytest.raises(UsageError, match="no such folder with NC files"):
        texts_of(tmp_path / "none", told)


PLATES = """
[machine]
name = "hurco"
servo_period_s = 0.001
[program]
rapid_mm_min = 20319.0
acceleration_mm_s2 = 168.0
rapid_acceleration_mm_s2 = 2112.0
centripetal_mm_s2 = 319.0
corner_speed_difference_mm_min = 93.0
in_position_s = 0.067
tool_change_s = 4.69
spindle_acceleration_rpm_s = 3820.0
spindle_deceleration_rpm_s = 3100.0
spindle_base_rpm = 3000.0
rapid_waits_for_spindle = true
"""
"""The model of docs/explanation/program-time.md, fitted to plates 13, 14 and 15."""


def test_recorded_plates_that_were_not_fitted_take_what_the_twin_says() -> None:
    texts = {name: recording(f"nist/nc/NIST_MTC_CRADA_PLATE-{int(name)}.NC") for name in ("03", "10")}
    cycles = [Cycle(name, run_log(plate_runs(name)[0], name)) for name in texts]
    found = timed(texts, *cycles, machine=machine_from_toml(PLATES))
    assert [one.on for one in found] == ["03", "10"]
    assert {one.verdict for one in found} == {Verdict.WITHIN}
    assert all(0.0 < (one.value or 0.0) < 5.0 and "where the reference position lies is not told" in one.basis for one in found)
