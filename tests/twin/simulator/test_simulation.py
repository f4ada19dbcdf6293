"""The whole chain: from a part program to what the machine records."""

import numpy as np
import pytest

from twin.errors import EffectError, MachineError, PartProgramError
from twin.machine import AddedEffect, MachineFile, Stock, Tool, machine_from_toml
from twin.simulator.recorded import told_of
from twin.simulator.response import respond
from twin.simulator.simulation import simulate

AXIS = """
[axes.{letter}]
mass_kg = 300.0
screw_lead_mm = 12.0
torque_constant_nm_per_a = 1.2
position_gain_per_s = 40.0
velocity_gain_a_s_per_mm = 0.3
velocity_integral_gain_a_per_mm = 9.0
torque_limit_a = 60.0
[axes.{letter}.friction]
coulomb_n = 300.0
static_n = 400.0
stribeck_velocity_mm_s = 6.0
viscous_n_s_per_mm = 2.0
"""
MACHINE = machine_from_toml(
    "[machine]\nname = 'small'\n"
    + "".join(AXIS.format(letter=letter) for letter in "xyz")
    + """
[tool]
diameter_mm = 6.0
teeth = 2
tangential_coefficient_n_per_mm2 = 1230.0
radial_ratio = 0.5
[spindle]
rated_power_kw = 11.0
efficiency = 0.85
idle_power_kw = 0.25
[thermal]
alpha_w_per_pct_rpm2 = 2.2e-8
beta_w_per_rpm = 0.016
resistance_k_per_w = 0.12
capacity_j_per_k = 9000.0
[program]
rapid_mm_min = 20000.0
acceleration_mm_s2 = 2500.0
jerk_mm_s3 = 60000.0
corner_speed_difference_mm_min = 500.0
tool_change_s = 1.0
spindle_acceleration_rpm_s = 16000.0
[stock]
min_mm = [0.0, 0.0, -20.0]
max_mm = [30.0, 30.0, 0.0]
[noise]
position_mm = 0.0003
torque_a = 0.01
force_n = 2.0
disturbance_force_n = 1.0
"""
)
SLOT = """%
N1 G21 G90 G17 T1 M6
N2 G0 X-5 Y15 Z5
N3 S8000 M3
N4 G0 Z-0.8
N5 M8
N6 G1 X35 F400
N7 M9
N8 G0 Z5
M30
%
"""


@pytest.fixture(scope="module")
def slot() -> dict[str, np.ndarray]:
    run = simulate(MACHINE.model_copy(update={"noise": {}}), SLOT).run
    return dict(run.columns) | {"t_s": run.t_s}


def test_a_slot_in_aluminium_has_the_forces_of_the_closed_form(slot: dict[str, np.ndarray]) -> None:
    """6 mm, two flutes, K_t 1,230 N/mm², K_e 0.5: one tooth is in the slot at a time, F = K_t d c √(1 + K_e²)."""
    inside = (slot["x_ref_mm"] > 5.0) & (slot["x_ref_mm"] < 25.0) & (slot["axial_depth_mm"] > 0.0)
    assert inside.sum() > 2000
    np.testing.assert_allclose(slot["entry_angle_rad"][inside], 0.0, atol=1e-9)
    np.testing.assert_allclose(slot["exit_angle_rad"][inside], np.pi, atol=1e-9)
    chip = 400.0 / (8000.0 * 2)
    peak = 1230.0 * 0.8 * chip * np.sqrt(1.25)
    np.testing.assert_allclose(slot["cutting_force_peak_n"][inside], peak, rtol=1e-6)
    phi = np.mod(slot["spindle_angle_rad"][inside], np.pi)
    tangential = 1230.0 * 0.8 * chip * np.sin(phi)
    np.testing.assert_allclose(
        slot["force_x_n"][inside], -tangential * np.cos(phi) - 0.5 * tangential * np.sin(phi), atol=1e-6 * peak
    )
    np.testing.assert_allclose(
        slot["force_y_n"][inside], tangential * np.sin(phi) - 0.5 * tangential * np.cos(phi), atol=1e-6 * peak
    )


def test_its_spindle_load_is_that_of_the_mean_torque(slot: dict[str, np.ndarray]) -> None:
    inside = (slot["x_ref_mm"] > 8.0) & (slot["x_ref_mm"] < 25.0)
    chip = 400.0 / (8000.0 * 2)
    mean_force = 1230.0 * 0.8 * chip * 2.0 / np.pi  # the mean of sin over the half turn in which one of the two teeth cuts
    power_kw = mean_force * np.pi * 0.006 * 8000.0 / 60.0 / 1000.0
    expected = 100.0 * (power_kw / 0.85 + 0.25) / 11.0
    windows = slot["spindle_load_pct"][inside]
    assert windows.mean() == pytest.approx(expected, rel=1e-3)


def test_it_starts_and_ends_where_the_program_says(slot: dict[str, np.ndarray]) -> None:
    assert slot["x_ref_mm"][-1] == 35.0
    assert slot["z_ref_mm"][-1] == 5.0
    assert slot["tool_change_active"].max() == 1.0
    assert slot["coolant_on"].max() == 1.0
    assert slot["coolant_on"][-1] == 0.0
    assert set(np.unique(slot["line"])) <= set(range(12))
    assert abs(slot["x_pos_mm"][-1] - 35.0) < 0.02
    assert np.all(np.diff(slot["t_s"]) > 0)


def test_the_same_seed_gives_the_same_course_and_another_one_another() -> None:
    one, again, other = (simulate(MACHINE, SLOT, seed=seed).run for seed in (1, 1, 2))
    np.testing.assert_array_equal(one["x_pos_mm"], again["x_pos_mm"])
    assert np.abs(one["x_pos_mm"] - other["x_pos_mm"]).max() > 1e-4


def test_without_a_seed_it_is_the_mean_of_its_courses_with_their_spread() -> None:
    done = simulate(MACHINE, SLOT)
    spread = done.response.spread["x_pos_mm"]
    assert 1e-6 < spread.max() < 0.01
    quiet = simulate(MACHINE.model_copy(update={"noise": {}}), SLOT)
    assert not quiet.response.spread


def test_temperature_goes_on_from_where_it_was() -> None:
    cold = simulate(MACHINE, SLOT, seed=1)
    warm = simulate(MACHINE, SLOT, seed=1, start_temperature_c=40.0)
    assert cold.run["spindle_temp_c"][0] == pytest.approx(22.0)
    assert warm.run["spindle_temp_c"][0] == pytest.approx(40.0)
    assert warm.run["spindle_temp_c"][-1] < 40.0


def test_a_wrong_program_is_refused_with_line_word_and_reason() -> None:
    with pytest.raises(PartProgramError, match="line 2"):
        simulate(MACHINE, "G1 X10 F100\nG2 X20 R1\n")


def test_what_the_machine_does_not_state_is_said() -> None:
    bare = MACHINE.model_copy(update={"program": None, "stock": None, "axes": {"x": MACHINE.axes["x"]}})
    notes = " ".join(simulate(bare, SLOT).notes)
    assert "no [program]" in notes
    assert "no [stock]" in notes
    assert "no [axes.y]" in notes


def test_a_machine_with_numbered_tools_alone_is_sent_to_the_command_that_knows_them() -> None:
    numbered = MACHINE.model_copy(update={"tool": None, "tools": {"1": MACHINE.tool}})
    assert any(
        "no [tool] (simulate knows one tool" in note and "cnctwin expect" in note for note in simulate(numbered, SLOT).notes
    )


def test_a_rapid_through_the_stock_is_said_with_its_line() -> None:
    notes = simulate(MACHINE, "G0 X-5 Y15 Z-5\nG0 X35\nM30\n").notes
    assert any(note.startswith("line 2: rapid into material") for note in notes), notes


@pytest.mark.parametrize(
    ("program", "said"),
    [
        ("G0 X-5 Y15\nG1 Z-1 F500\nG1 X35\nM30\n", "line 3: feeds into material with the spindle at rest"),
        ("S8000 M4\nG0 X-5 Y15\nG1 Z-1 F500\nG1 X35\nM30\n", "line 4: M4: a right-hand tool does not cut"),
    ],
)
def test_a_cut_that_is_none_is_said_with_its_line(program: str, said: str) -> None:
    done = simulate(MACHINE, program)
    assert any(note.startswith(said) for note in done.notes), done.notes
    assert not np.nan_to_num(done.run["axial_depth_mm"]).any()


def test_a_feed_beside_the_stock_needs_no_spindle() -> None:
    assert not any("spindle" in note for note in simulate(MACHINE, "G0 X-5 Y15 Z50\nG1 X35 F500\nM30\n").notes)


def test_an_axis_at_its_torque_limit_is_said() -> None:
    weak = MACHINE.axes["x"].model_copy(update={"torque_limit_a": 0.7})
    done = simulate(MACHINE.model_copy(update={"axes": MACHINE.axes | {"x": weak}}), SLOT)
    assert any(note.startswith("x is at its torque limit of 0.7 A") for note in done.notes), done.notes


@pytest.mark.parametrize("program", ["", "M30\n", "G4 P1000\nM30\n"])
def test_a_program_without_motion_runs_too(program: str) -> None:
    assert simulate(MACHINE, program).seconds == pytest.approx(1.0 if "G4" in program else 0.0)


def test_a_program_without_end_of_memory_is_refused() -> None:
    with pytest.raises(MachineError, match="split it"):
        simulate(MACHINE, "G4 P99999999\n" * 40 + "G1 X1 F1\nM30\n")


def added(effect: str, on: str = "", **parameters: float) -> MachineFile:
    return MACHINE.model_copy(update={"noise": {}, "effects": (AddedEffect(effect=effect, on=on, parameters=parameters),)})


@pytest.mark.parametrize(
    ("machine", "complaint"),
    [
        (added("gravity", "w", force_n=10.0), "no axis"),
        (added("gravity", force_n=10.0), "acts on an axis: say which by `on`"),
        (added("sensor_bias", "colour", bias=1.0), "no column that a machine answers with"),
        (added("gravity", "z", force_n=1e9), "has to be from"),
        (added("gravity", "z", weight=1.0), "no parameter 'weight'"),
        (added("edge_force", "x", tangential_n_per_mm=5.0), "`on` is empty"),
        (added("sensor_bias", bias=1.0), "say which by `on`"),
        (added("telekinesis"), "no effect"),
    ],
)
def test_effects_that_do_not_fit_the_machine_are_named(machine: MachineFile, complaint: str) -> None:
    with pytest.raises(EffectError, match=complaint):
        simulate(machine, SLOT)


@pytest.mark.parametrize(
    ("machine", "column", "size"),
    [
        (added("gravity", "z", force_n=300.0), "z_torque_a", 0.3),
        (added("command_delay", "x", delay_s=0.003), "x_pos_mm", 0.01),
        (added("clock_drift", ppm=200.0, offset_s=0.01), "x_pos_mm", 0.01),
        (added("sensor_bias", "spindle_temp_c", bias=-3.0), "spindle_temp_c", 2.99),
        (added("sensor_scale", "x_torque_a", scale=1.1), "x_torque_a", 0.01),
        (added("sensor_lag", "spindle_load_pct", time_constant_s=0.5), "spindle_load_pct", 0.05),
        (added("thermal_growth", "x", um_per_k=50.0), "x_table_mm", 0.001),
        (added("edge_force", tangential_n_per_mm=10.0, radial_n_per_mm=15.0), "force_x_n", 5.0),
        (added("cutting_coefficient", scale=1.3), "force_y_n", 3.0),
        (added("rated_power", scale=1.2), "spindle_load_pct", 0.1),
    ],
)
def test_an_added_effect_shows_in_its_column(machine: MachineFile, column: str, size: float, slot: dict[str, np.ndarray]) -> None:
    changed = simulate(machine, SLOT).run[column]
    assert np.nanmax(np.abs(changed - slot[column])) > size


def test_a_sensor_effect_leaves_all_other_columns_alone(slot: dict[str, np.ndarray]) -> None:
    changed = simulate(added("sensor_scale", "x_torque_a", scale=1.1), SLOT).run
    for name, values in slot.items():
        if name not in ("t_s", "x_torque_a"):
            np.testing.assert_array_equal(values, changed[name], err_msg=name)


def test_a_twin_of_its_own_recording_has_no_gap() -> None:
    quiet = MACHINE.model_copy(update={"noise": {}})
    run = simulate(quiet, SLOT).run
    twin = respond(quiet, told_of(run, quiet)).columns
    for name in ("x_pos_mm", "z_torque_a", "force_x_n", "spindle_load_pct", "spindle_temp_c"):
        np.testing.assert_allclose(twin[name], run[name], atol=1e-6, err_msg=name)


def test_what_is_upstream_of_a_recorded_column_does_not_matter() -> None:
    """The force measured in place of the model's: a wrong K_t shifts the axis less; samples are not means, so not to 0."""
    quiet = MACHINE.model_copy(update={"noise": {}})
    run = simulate(quiet, SLOT).run
    assert quiet.tool is not None
    soft = quiet.model_copy(update={"tool": Tool(**quiet.tool.model_dump() | {"tangential_coefficient_n_per_mm2": 100.0})})
    told = told_of(run, quiet)
    modelled = respond(soft, told).columns["x_pos_mm"]
    measured = respond(soft, told, recorded={"force_x_n": run["force_x_n"], "force_y_n": run["force_y_n"]}).columns["x_pos_mm"]
    truth = run["x_pos_mm"]
    assert np.abs(measured - truth).max() < 0.5 * np.abs(modelled - truth).max()


def test_a_tool_that_cuts_nothing_has_no_force() -> None:
    high = MACHINE.model_copy(update={"stock": Stock(min_mm=(0, 0, -20), max_mm=(30, 30, -10)), "noise": {}})
    run = simulate(high, SLOT).run
    assert not run["axial_depth_mm"].any()
    assert run["spindle_load_pct"].max() == pytest.approx(100.0 * 0.25 / 11.0)
