"""The cutting force on a machine's description, and only where the load is the cut's: at a steady speed, below no held peak."""

import math

import pytest

from processors.cutting_force import BASIS, CHANGING, FORCE, HELD, PROCESSOR, Config
from processors.sample import SampleKind
from tests.processors.machines import CUTTER, SPINDLE, Fold, described_as

TOOLS = {"3": {"diameter_mm": 20.0, **CUTTER}, "7": {"diameter_mm": 6.0, **CUTTER}}
RATED = {"effect": "rated_power", "parameters": {"scale": 1.3}}
HOLDS = {"effect": "load_peak_hold", "parameters": {"hold_s": 4.0}}


def force_n(load_pct: float, rpm: float, diameter_mm: float, rated_kw: float = 11.0) -> float:
    """The closed form of a meter that nothing bends."""
    power_w = 1000.0 * SPINDLE["efficiency"] * (load_pct / 100.0 * rated_kw - SPINDLE["idle_power_kw"])
    return power_w / (math.pi * diameter_mm / 1000.0 * rpm / 60.0)


def steady(fold: Fold, **values: object) -> None:
    """The spindle has turned like this for a while."""
    fold.at(0.0, **values)
    fold.at(5.0, **values)


def test_drive_and_tool_are_those_of_the_file_whatever_old_tables_say() -> None:
    description = described_as(RATED, spindle=SPINDLE, tools=TOOLS)
    fold = Fold(PROCESSOR, description, rated_power_kw=99.0, tool_diameter_mm=1.0)
    steady(fold, spindle_rpm=3000.0, spindle_load_pct=40.0, tool_number=3)
    shown = fold.at(6.0, tool_number=3)
    assert shown[FORCE] == pytest.approx(force_n(40.0, 3000.0, 20.0, 1.3 * 11.0), abs=0.05)
    assert shown[BASIS] == (
        f"description {description.version}; 11 kW rated, efficiency 0.85; with rated_power scale 1.3; tool 3 of 20 mm"
    )
    assert fold.at(7.0, tool_number=7)[FORCE] == pytest.approx(force_n(40.0, 3000.0, 6.0, 1.3 * 11.0), abs=0.05)


def test_a_tool_that_is_not_described_has_no_force_unless_one_stands_for_any() -> None:
    several = Fold(PROCESSOR, described_as(spindle=SPINDLE, tools=TOOLS))
    steady(several, spindle_rpm=3000.0, spindle_load_pct=40.0, tool_number=5)
    assert several.at(6.0)[FORCE] == "tool 5 is not described: it has no [tools.5]"
    steady(several, tool_number=None)
    assert several.at(6.0)[FORCE] == "the machine has several tools, and no tool_number says which one it is"
    one = Fold(PROCESSOR, described_as(spindle=SPINDLE, tools={"3": TOOLS["3"]}))
    steady(one, spindle_rpm=3000.0, spindle_load_pct=40.0)
    assert one.at(6.0)[FORCE] == pytest.approx(force_n(40.0, 3000.0, 20.0), abs=0.05)
    any_tool = Fold(PROCESSOR, described_as(spindle=SPINDLE, tool={"diameter_mm": 12.0, **CUTTER}))
    steady(any_tool, spindle_rpm=3000.0, spindle_load_pct=40.0, tool_number=5)
    assert any_tool.at(6.0)[FORCE] == pytest.approx(force_n(40.0, 3000.0, 12.0), abs=0.05)


def test_what_a_file_does_not_say_is_assumed_and_said() -> None:
    for description, said in (
        (described_as(), "15 kW rated, efficiency 0.85 (rated power and efficiency assumed); any tool 12 mm (assumed)"),
        (described_as(spindle=SPINDLE), "11 kW rated, efficiency 0.85; any tool 12 mm (assumed)"),
        (
            described_as(machine={"assumed": ["spindle.efficiency", "tools.3"]}, spindle=SPINDLE, tools=TOOLS),
            "11 kW rated, efficiency 0.85 (efficiency assumed); tool 3 of 20 mm (assumed)",
        ),
    ):
        fold = Fold(PROCESSOR, description)
        assert fold.at(0.0, spindle_rpm=3000.0, spindle_load_pct=40.0, tool_number=3)[BASIS].endswith(said)


def test_while_the_speed_changes_the_force_is_null_and_says_why() -> None:
    fold = Fold(PROCESSOR, described_as(spindle=SPINDLE, tools=TOOLS))
    steady(fold, spindle_rpm=3000.0, spindle_load_pct=20.0, tool_number=3)
    for number, rpm in enumerate((3300.0, 4500.0, 5900.0, 6000.0)):
        assert fold.at(10.0 + 0.1 * number, spindle_rpm=rpm, spindle_load_pct=140.0)[FORCE] == CHANGING
    assert fold.at(10.4, spindle_load_pct=20.0)[FORCE] == CHANGING
    assert fold.tick(11.0)[FORCE] == CHANGING
    assert fold.tick(12.0)[FORCE] == pytest.approx(force_n(20.0, 6000.0, 20.0), abs=0.05)
    assert fold.tick(13.0) == {}  # nothing is awaited any more: the next one is at the next change
    assert fold.at(20.0, spindle_rpm=5000.0, spindle_load_pct=0.0)[FORCE] == CHANGING


def test_a_speed_that_has_just_been_told_is_not_known_to_be_steady() -> None:
    fold = Fold(PROCESSOR, described_as(spindle=SPINDLE, tools=TOOLS))
    assert fold.at(0.0, spindle_rpm=3000.0, spindle_load_pct=20.0, tool_number=3)[FORCE] == CHANGING
    assert isinstance(fold.tick(1.0)[FORCE], float)
    fold.at(2.0, SampleKind.DEATH)
    assert fold.at(3.0, SampleKind.BIRTH)[FORCE] == CHANGING
    assert isinstance(fold.tick(4.0)[FORCE], float)
    assert fold.at(5.0, SampleKind.HOLE)[FORCE] == CHANGING
    unknown = fold.at(7.0, spindle_rpm=None)
    assert unknown[FORCE] == "spindle_rpm is null"
    assert fold.at(8.0, spindle_rpm=3000.0)[FORCE] == CHANGING


def test_noise_and_the_drift_of_a_lathe_at_constant_surface_speed_are_steady() -> None:
    fold = Fold(PROCESSOR, described_as(spindle=SPINDLE, tools=TOOLS))
    steady(fold, spindle_rpm=1000.0, spindle_load_pct=20.0, tool_number=3)
    for number in range(300):
        rpm = 1000.0 + 15.0 * 0.1 * number + (4.0 if number % 2 else -4.0)
        shown = fold.at(6.0 + 0.1 * number, spindle_rpm=rpm)
        assert isinstance(shown[FORCE], float), number


def test_a_commanded_change_counts_before_the_speed_follows() -> None:
    fold = Fold(PROCESSOR, described_as(spindle=SPINDLE, tools=TOOLS))
    steady(fold, spindle_rpm=3000.0, spindle_rpm_cmd=3000.0, spindle_load_pct=20.0, tool_number=3)
    assert fold.at(10.0, spindle_rpm_cmd=8000.0, spindle_load_pct=120.0)[FORCE] == CHANGING
    standing = {"spindle_rpm": 3000.0, "spindle_rpm_cmd": 5000.0}  # an override: the two differ for good
    fold.at(20.0, **standing)
    assert isinstance(fold.at(22.0, **standing)[FORCE], float)


def test_without_a_time_to_settle_a_ramp_is_still_none_of_the_cut() -> None:
    fold = Fold(PROCESSOR, described_as(spindle=SPINDLE, tools=TOOLS), settle_s=0.0)
    assert isinstance(fold.at(0.0, spindle_rpm=3000.0, spindle_load_pct=20.0, tool_number=3)[FORCE], float)


def test_a_meter_that_still_shows_a_peak_tells_no_force() -> None:
    fold = Fold(PROCESSOR, described_as(HOLDS, spindle=SPINDLE, tools=TOOLS))
    steady(fold, spindle_rpm=3000.0, spindle_load_pct=60.0, tool_number=3)
    assert fold.at(10.0)[FORCE] == pytest.approx(force_n(60.0, 3000.0, 20.0), abs=0.05)
    for number in range(1, 10):
        assert fold.at(10.0 + number, spindle_load_pct=60.0 * math.exp(-number / 4.0))[FORCE] == HELD
    low_pct = 60.0 * math.exp(-9 / 4.0)
    assert fold.tick(30.0)[FORCE] == pytest.approx(force_n(low_pct, 3000.0, 20.0), abs=0.05)  # it stands: it is the cut's
    assert fold.at(31.0, spindle_load_pct=50.0)[FORCE] == pytest.approx(force_n(50.0, 3000.0, 20.0), abs=0.05)


def test_a_new_description_counts_from_the_next_sample_on() -> None:
    fold = Fold(PROCESSOR, described_as(spindle=SPINDLE, tools=TOOLS))
    steady(fold, spindle_rpm=3000.0, spindle_load_pct=40.0, tool_number=3)
    fold.describe(described_as(RATED, spindle=SPINDLE, tools=TOOLS))
    assert fold.at(6.0)[FORCE] == pytest.approx(force_n(40.0, 3000.0, 20.0, 1.3 * 11.0), abs=0.05)


def test_constants_in_a_table_of_old_are_named_with_where_they_belong() -> None:
    said = Config(rated_power_kw=11.0, tool_diameter_mm=10.0, settle_s=2.0).belongs_elsewhere("cutting_force")
    assert said == (
        "[cutting_force] rated_power_kw belongs in machines/<name>.toml, [spindle]; it is used until a machine has a file",
        "[cutting_force] tool_diameter_mm belongs in machines/<name>.toml, [tool]; it is used until a machine has a file",
    )
