"""A rotary axis in a file is in degrees and N m, and comes back as it was."""

import math
import re
from pathlib import Path

import numpy as np
import pytest

from tests.twin.rotary_axis import STATED
from twin.errors import MachineError, RunLogError
from twin.machine import Axis, Friction, machine_from_toml
from twin.machine_toml import machine_to_toml
from twin.rotary import inside_name, outside_name, outside_text
from twin.runlog import read_run, run_log, write_run
from twin.simulator.simulation import simulate

EFFECTS = """
[[effects]]
effect = "gravity"
on = "b"
parameters = { torque_nm = 6.0 }
[[effects]]
effect = "sensor_bias"
on = "b_pos_deg"
parameters = { bias = 0.01 }
"""


def test_a_rotary_axis_is_a_point_on_it_that_moves_a_mm_for_each_degree() -> None:
    machine = machine_from_toml(STATED + EFFECTS)
    axis = machine.axes["b"]
    # 12 N m on 2.5 kg m² is 4.8 rad/s²
    assert 1000.0 * axis.newton_per_command / axis.mass_kg == pytest.approx(math.degrees(12.0 / 2.5))
    # power at 30 deg/s against Coulomb friction
    assert 0.001 * float(axis.friction.coulomb_n) * 30.0 == pytest.approx(14.0 * math.radians(30.0))  # type: ignore[arg-type]
    assert machine.rotary == {"b": 1.0}
    assert machine.effects[0].parameters["force_n"] == pytest.approx(6.0 * 1000.0 * math.pi / 180.0)
    assert machine.effects[1].on == "b_pos_mm"
    assert machine.uncertainty["axes.b.mass_kg"] == 0.1


def test_a_file_that_was_read_is_written_as_it_was() -> None:
    text = machine_to_toml(machine_from_toml(STATED + EFFECTS))
    for figure in ("inertia_kg_m2 = 2.5\n", "coulomb_nm = 14.0\n", "viscous_nm_s_per_deg = 0.12\n", "torque_nm = 6.0 "):
        assert figure in text
    for figure in ('"axes.b.inertia_kg_m2" = 0.1', "position_deg = 0.0002", "disturbance_torque_nm = 0.05", 'on = "b_pos_deg"'):
        assert figure in text
    assert "_mm" not in text
    assert "scale" not in text
    assert machine_to_toml(machine_from_toml(text)) == text


TERMS = """
[[effects]]
effect = "learned"
site = "axis_force"
on = "b"
unit = "N m"
depends_on = ["position"]
table = { position_deg = [0.0, 90.0], value = [0.0, 2.0], low = [-0.5, 1.5], high = [0.5, 2.5] }
[[effects]]
effect = "learned"
site = "position_reading"
on = "b_pos_deg"
table = { velocity_deg_s = [0.0, 10.0], value = [0.0, 0.002] }
"""


def test_a_learned_term_of_a_rotary_axis_is_in_degrees_and_nm_and_comes_back() -> None:
    machine = machine_from_toml(STATED + TERMS)
    force, reading = machine.learned
    assert force.table["position_mm"] == (0.0, 90.0)
    assert force.table["value"] == pytest.approx((0.0, 2.0 * 1000.0 * math.pi / 180.0))
    assert (reading.on, reading.table["value"]) == ("b_pos_mm", (0.0, 0.002))
    text = machine_to_toml(machine)
    assert "_mm" not in text
    assert 'unit = "N m"' in text
    again = machine_from_toml(text)
    assert again.learned[0].table["high"] == pytest.approx(force.table["high"])
    assert machine_to_toml(again) == text


def test_a_wrist_and_a_shoulder_have_the_size_of_a_feed_axis_inside() -> None:
    machine = machine_from_toml(STATED + EFFECTS)
    small = STATED + EFFECTS
    for key in (
        "inertia_kg_m2",
        "torque_per_command_nm",
        "coulomb_nm",
        "viscous_nm_s_per_deg",
        "torque_nm",
        "disturbance_torque_nm",
    ):
        small = re.sub(
            rf"\b{key} = ([0-9.]+)", lambda found: f"{found[0].partition('=')[0]}= {float(found[1]) / 1000.0:.12g}", small
        )
    small = small.replace("[18.0, 18.5]", "[0.018, 0.0185]")
    wrist = machine_from_toml(small)
    assert wrist.rotary == {"b": 1000.0}
    for key in ("mass_kg", "force_per_command_n"):
        assert getattr(wrist.axes["b"], key) == pytest.approx(getattr(machine.axes["b"], key))
    assert wrist.effects[0].parameters["force_n"] == pytest.approx(machine.effects[0].parameters["force_n"])
    assert wrist.noise["disturbance_force_n"] == pytest.approx(machine.noise["disturbance_force_n"])
    text = machine_to_toml(wrist)
    assert "inertia_kg_m2 = 0.0025\n" in text
    assert "torque_nm = 0.006" in text
    assert "disturbance_torque_nm = 5e-05" in text
    assert machine_to_toml(machine_from_toml(text)) == text
    assert outside_text("gravity on B (107.6 ± 5 N)", wrist.rotary, ()) == "gravity on B (0.006165 ± 0.00029 N m)"


def test_each_key_of_an_axis_has_one_name_outside_and_comes_back() -> None:
    for key in ({*Axis.model_fields} - {"scale"}) | {*Friction.model_fields}:
        name, factor = outside_name(key)
        assert inside_name(name) == (key, factor)
        assert not re.search(r"_mm|_kg$|_n$|_n_", name)


@pytest.mark.parametrize(
    ("written", "instead", "said"),
    [
        ("inertia_kg_m2 = 2.5\n", "", "axes.b.inertia_kg_m2 is missing"),
        ("inertia_kg_m2 = 2.5", "inertia_kg_m2 = -2.5", "axes.b.inertia_kg_m2 = -2.5: must be"),
        ("coulomb_nm = 14.0", "coulomb_nm = 24.0", r"static_nm \(18.0, 18.5\) is below coulomb_nm 24.0"),
        ("coulomb_nm = 14.0", "coulomb_n = 14.0", "inertia_kg_m2 of a rotary axis and coulomb_n of a linear one"),
        ("torque_per_command_nm = 12.0\n", "", "axes.b: state torque_per_command_nm"),
        ("torque_limit_a = 30.0", "torque_limit_a = 30.0\nscale = 1.0", "axes.b.scale is not known"),
    ],
)
def test_a_fault_is_told_in_the_words_and_figures_of_the_file(written: str, instead: str, said: str) -> None:
    with pytest.raises(MachineError, match=said):
        machine_from_toml(STATED.replace(written, instead), "table.toml")


def test_columns_in_degrees_come_back_in_degrees(tmp_path: Path) -> None:
    t_s = np.arange(3) * 0.001
    log = run_log({"t_s": t_s, "b_ref_deg": t_s, "b_pos_deg": t_s + 1.0, "x_pos_mm": t_s, "c_turns": t_s})
    assert log.rotary == {"b"}
    assert log.axes() == ("b", "x")
    assert log.ignored == ("c_turns",)
    for name in ("run.parquet", "run.csv"):
        write_run(log, tmp_path / name)
        again = read_run(tmp_path / name)
        assert again.rotary == {"b"}
        np.testing.assert_array_equal(again["b_pos_mm"], t_s + 1.0)
    assert (tmp_path / "run.csv").read_text().splitlines()[0] == "t_s,b_ref_deg,b_pos_deg,x_pos_mm"


def test_an_axis_in_degrees_and_in_mm_is_one_line() -> None:
    with pytest.raises(RunLogError, match="there are b_pos_deg and b_pos_mm"):
        run_log({"t_s": np.arange(2.0), "b_pos_deg": np.zeros(2), "b_pos_mm": np.zeros(2)})


def test_a_program_has_a_word_for_a_rotary_axis() -> None:
    done = simulate(machine_from_toml(STATED), "G90 G94\nG1 X5 B20 F1200\nG0 B-10\nG4 P800\nM30\n", seed=1)
    assert done.run["b_ref_mm"][-1] == -10.0
    assert done.run.rotary == {"b"}
    assert abs(done.run["b_pos_mm"][-1] + 10.0) < 1.0


@pytest.mark.parametrize(
    ("inside", "outside"),
    [
        ("mean −0.61 A, +3.3 µm in the B position", "mean −0.61 A, +0.0033 deg in the B position"),
        ("the X position is 3.3 µm off", "the X position is 3.3 µm off"),
        ("a force on B of +43 N between 118 and 141 mm", "a force on B of +2.5 N m between 118 and 141 deg"),
        ("axes.b.friction.coulomb_n: not told", "axes.b.friction.coulomb_nm: not told"),
        ("axis b: viscous_n_s_per_mm: not told", "axis b: viscous_nm_s_per_deg: not told"),
        ("b_pos_mm goes 2 mm; x_pos_mm goes 2 mm", "b_pos_deg goes 2 deg; x_pos_mm goes 2 mm"),
        ("no force_x_n in any run with b_ref_mm", "no force_x_n in any run with b_ref_deg"),
        ("gravity on B (107.6 ± 5 N; or sensor bias)", "gravity on B (6.165 ± 0.29 N m; or sensor bias)"),
    ],
)
def test_a_text_speaks_of_a_rotary_axis_in_its_own_units(inside: str, outside: str) -> None:
    assert outside_text(inside, {"b": 1.0}, {"x"}) == outside


def test_a_learned_term_on_a_rotary_axis_is_in_n_m_over_degrees() -> None:
    term = """
[[effects]]
effect = "learned"
site = "axis_force"
on = "b"
unit = "N m"
depends_on = ["position"]
table = { position_deg = [0.0, 90.0], value = [0.0, 2.0], low = [0.0, 1.9], high = [0.0, 2.1] }
"""
    machine = machine_from_toml(STATED + term)
    (learned,) = machine.learned
    assert learned.unit == "N"
    assert learned.term.at({"position_mm": np.array([90.0])})[0] == pytest.approx(2.0 * 1000.0 * math.pi / 180.0)
    text = machine_to_toml(machine)
    assert "position_deg" in text
    assert 'unit = "N m"' in text
    assert machine_to_toml(machine_from_toml(text)) == text
    held = simulate(machine, "G90 G94\nG0 B90\nG4 P1500\nM30\n").run["b_torque_a"][-1]
    bare = simulate(machine_from_toml(STATED), "G90 G94\nG0 B90\nG4 P1500\nM30\n").run["b_torque_a"][-1]
    assert held != bare
