"""[assumed]: each constant with its range and source; what recordings tell leaves it."""

import pytest

from twin.assumed import assumed_in_words, narrowed_in_words, with_fitted
from twin.errors import MachineError
from twin.machine import MachineFile, machine_from_toml
from twin.machine_toml import machine_to_toml

TEXT = """
[machine]
name = "vmc"
assumed = ["thermal"]

[spindle]
rated_power_kw = 11.0
efficiency = 0.85
idle_power_kw = 0.3

[thermal]
alpha_w_per_pct_rpm2 = 1.8e-8
beta_w_per_rpm = 1.2e-2
resistance_k_per_w = 0.18
capacity_j_per_k = 6000.0

[axes.b]
inertia_kg_m2 = 2.5
torque_per_command_nm = 12.0
position_gain_per_s = 25.0
velocity_gain_a_s_per_deg = 0.08
torque_limit_a = 30.0

[axes.b.friction]
coulomb_nm = 14.0
static_nm = 18.0
stribeck_velocity_deg_s = 2.0

[uncertainty]
relative = 0.05
"spindle.idle_power_kw" = 0.01

[assumed]
"spindle.efficiency" = { range = [0.75, 0.92], source = "estimate" }
"spindle.idle_power_kw" = { range = [0.1, 0.8], source = "estimate" }
"axes.b.inertia_kg_m2" = { range = [1.0, 6.0], source = "table and rotor" }
"""
LINES = TEXT.partition("[assumed]\n")[2].splitlines()


def machine() -> MachineFile:
    return machine_from_toml(TEXT)


def test_what_stands_in_the_table_is_assumed_like_what_the_list_names() -> None:
    assert machine().machine.assumed == ("thermal", "spindle.efficiency", "spindle.idle_power_kw", "axes.b.mass_kg")
    assert assumed_in_words(machine()) == "thermal, spindle.efficiency, spindle.idle_power_kw, axes.b.inertia_kg_m2"


def test_a_range_is_what_a_fit_begins_with_unless_a_deviation_is_stated() -> None:
    stated = machine().uncertainty
    assert stated["spindle.efficiency"] == pytest.approx(0.0511, abs=1e-4)  # ln(0.92 / 0.75) / 4
    assert stated["spindle.idle_power_kw"] == 0.01
    assert stated["relative"] == 0.05


def test_it_is_written_as_it_was_read() -> None:
    text = machine_to_toml(machine())
    assert machine_from_toml(text) == machine()
    assert text.partition("[assumed]\n")[2].split() == TEXT.partition("[assumed]\n")[2].split()
    assert '"spindle.efficiency" = 0.0' not in text, "the range says it"


def test_a_constant_that_recordings_tell_leaves_the_table_and_the_list() -> None:
    told = with_fitted(machine(), {"spindle.efficiency": 0.02, "axes.b.mass_kg": 0.3})
    assert list(told.assumed) == ["spindle.idle_power_kw", "axes.b.mass_kg"]
    assert "spindle.efficiency" not in told.machine.assumed
    assert narrowed_in_words(machine(), told) == (
        "1 of 4 assumed constants are known from these recordings now; still assumed: thermal, spindle.idle_power_kw, "
        "axes.b.inertia_kg_m2",
    )


def test_a_section_of_which_a_part_is_told_is_counted_by_its_constants() -> None:
    told = with_fitted(machine(), {"thermal.beta_w_per_rpm": 0.02})
    assert narrowed_in_words(machine(), told)[0].startswith("1 of 7 assumed constants are known from these recordings now; ")
    assert len(told.machine.assumed) == 6


@pytest.mark.parametrize(
    ("line", "instead", "fault"),
    [
        (
            LINES[0],
            '"spindle.efficency" = { source = "x" }',
            "assumed: spindle.efficency is assumed, but the file does not state it",
        ),
        (
            LINES[0],
            '"spindle.efficiency" = { range = [0.5, 0.8], source = "x" }',
            "assumed: spindle.efficiency = 0.85 is outside its range 0.5 to 0.8",
        ),
        (LINES[0], '"spindle" = { range = [0.5, 0.8], source = "x" }', "assumed: spindle is no number, so it has no range"),
        (LINES[0], '"spindle.efficiency" = { range = [0.9, 0.8], source = "x" }', "its lowest at or above its highest"),
        (LINES[0], '"spindle.efficiency" = { range = [0.75, 0.92] }', "assumed.spindle.efficiency.source is missing"),
        (
            LINES[2],
            '"axes.b.inertia_kg_m2" = { range = [3.0, 6.0], source = "x" }',
            "axes.b.inertia_kg_m2 = 2.5 is outside its range 3 to 6",
        ),
    ],
)
def test_an_entry_that_cannot_be_is_said_in_one_line(line: str, instead: str, fault: str) -> None:
    with pytest.raises(MachineError) as error:
        machine_from_toml(TEXT.replace(line, instead))
    assert fault in str(error.value)
    assert "\n" not in str(error.value)
