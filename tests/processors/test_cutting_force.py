"""The cutting force processor: a figure with what it rests on, or a null with its reason."""

from typing import Any

import pytest

from processors.config import Configuration
from processors.cutting_force import BASIS, FORCE, PROCESSOR, Config
from processors.errors import ConfigurationError
from sparkplug.metric import Change
from tests.processors.streams import birth, data, engine_of, fed


def force(*events: Any, **table: Any) -> tuple[Change, str]:
    """The last force and its basis."""
    engine = engine_of(PROCESSOR, **table)
    fed(engine, *events, data(3.0, feed_mm_min=0.0, spindle_rpm_cmd=3000.0))  # the speed has been steady for a while by then
    latest = engine._machines["okuma"].live.emission.latest
    return latest[FORCE], str(latest[BASIS].value)


def test_the_figure_of_the_formula() -> None:
    change, basis = force(
        birth(0.0, spindle_rpm=3000.0, spindle_load_pct=50.0), rated_power_kw=10.0, efficiency=0.8, tool_diameter_mm=20.0
    )
    assert change.value == pytest.approx(1273.2, abs=0.05)
    assert basis == "10 kW rated, efficiency 0.8; any tool 20 mm"


def test_what_nobody_configured_is_called_assumed() -> None:
    _, basis = force(birth(0.0, spindle_rpm=3000.0, spindle_load_pct=50.0))
    assert basis == "15 kW rated, efficiency 0.85 (rated power and efficiency assumed); any tool 12 mm (assumed)"


def test_the_tool_number_picks_the_diameter() -> None:
    start = birth(0.0, spindle_rpm=3000.0, spindle_load_pct=50.0, tool_number=3)
    half, basis = force(start, tool_diameter_mm=10.0, tool_diameters_mm={"3": 20.0})
    whole, _ = force(start, data(1.0, tool_number=4), tool_diameter_mm=10.0, tool_diameters_mm={"3": 20.0})
    assert whole.value == pytest.approx(2 * half.value, abs=0.1)
    assert basis.endswith("tool 3 of 20 mm")


@pytest.mark.parametrize(
    ("values", "reason"),
    [
        ({"spindle_rpm": 0.0, "spindle_load_pct": 5.0}, "spindle below 50 rev/min: power over speed means nothing"),
        ({"spindle_rpm": 3000.0, "spindle_load_pct": None}, "spindle_load_pct is null"),
        ({"spindle_rpm": 3000.0}, "spindle_load_pct is not offered"),
        ({"spindle_rpm": float("nan"), "spindle_load_pct": 5.0}, "spindle_rpm is nan"),
        ({"spindle_rpm": "fast", "spindle_load_pct": 5.0}, "spindle_rpm is not a number"),
        ({"spindle_rpm": 1e308, "spindle_load_pct": 5.0}, "spindle_rpm or spindle_load_pct is beyond any spindle"),
        ({"spindle_rpm": 3000.0, "spindle_load_pct": 1e6}, "spindle_rpm or spindle_load_pct is beyond any spindle"),
        ({"spindle_rpm": 3000.0, "spindle_load_pct": -5.0}, "spindle load is negative: the spindle brakes"),
    ],
)
def test_a_null_says_why(values: dict[str, Any], reason: str) -> None:
    change, _ = force(birth(0.0, **values))
    assert (change.value, change.reason) == (None, reason)


def test_a_tool_of_unknown_diameter_has_no_force() -> None:
    change, _ = force(birth(0.0, spindle_rpm=3000.0, spindle_load_pct=5.0), tool_diameter_mm=0.0)
    assert change.reason == "tool diameter is not known"


def test_a_configuration_that_makes_no_sense_is_refused_with_key_value_and_table() -> None:
    with pytest.raises(ConfigurationError, match=r"\[cutting_force\] efficiency = 1.5: .*must be 1 or less"):
        Configuration(Config, {"efficiency": 1.5}, name="cutting_force")
    with pytest.raises(ConfigurationError, match=r"\[cutting_force.machines.okuma\] tool_diametre is not known; did you mean"):
        Configuration(Config, {"machines": {"okuma": {"tool_diametre": 3}}}, name="cutting_force")
    with pytest.raises(ConfigurationError, match=r"idle_power_kw is 20\.0"):
        Configuration(Config, {"idle_power_kw": 20.0}, name="cutting_force")
    with pytest.raises(ConfigurationError, match="gap_s_max / tick_s"):
        Configuration(Config, {"tick_s": 0.001, "gap_s_max": 86_400.0}, name="cutting_force")


def test_other_values_hold_for_one_machine() -> None:
    configuration = Configuration(Config, {"efficiency": 0.7, "machines": {"okuma": {"tool_diameter_mm": 10}}})
    assert (configuration.of("okuma").tool_diameter_mm, configuration.of("okuma").efficiency) == (10.0, 0.7)
    assert configuration.of("mazak").tool_diameter_mm is None
    assert configuration.machines == ("okuma",)
