"""The cutting force against figures made by hand, and where there is none."""

import math

import pytest
from hypothesis import given
from hypothesis import strategies as st

from twin.live.assumed import SPINDLE, completed
from twin.live.force import LiveForce, ToolUsed
from twin.machine import MachineFile

CUTTER = {"teeth": 4, "tangential_coefficient_n_per_mm2": 900.0, "radial_ratio": 0.4}
DRIVE = {"rated_power_kw": 11.0, "efficiency": 0.85, "idle_power_kw": 0.25}
BENT = {"effect": "load_dependent_efficiency", "parameters": {"drop": 0.3, "knee_kw": 0.6}}
DEAD = {"effect": "sensor_scale", "on": "spindle_load_pct", "parameters": {"scale": 0.0}}


def force_of(*effects: object, **sections: object) -> LiveForce:
    named = {"machine": {"name": "vmc"}, "spindle": DRIVE, "effects": list(effects)}
    return LiveForce.of(MachineFile.model_validate(named | sections))


def test_power_over_speed() -> None:
    # 40 % of 11 kW is 4.4 kW, less 0.25 kW idle, times 0.85 = 3527.5 W; 20 mm at 2,000 rev/min = 2.0944 m/s.
    force = force_of().force(40.0, 2000.0, 20.0)
    assert force.force_n == pytest.approx(3527.5 / 2.0944, rel=1e-4)
    assert force.reason is None


def test_below_idle_power_the_force_is_zero() -> None:
    assert force_of().force(1.0, 2000.0, 20.0).force_n == force_of(BENT).force(1.0, 2000.0, 20.0).force_n == 0.0


@pytest.mark.parametrize(
    ("load", "rpm", "diameter", "word"),
    [
        (None, 2000.0, 20.0, "load is missing"),
        (math.nan, 2000.0, 20.0, "load is missing"),
        (-3.0, 2000.0, 20.0, "load is negative"),
        (40.0, None, 20.0, "speed is missing"),
        (40.0, math.inf, 20.0, "speed is missing"),
        (40.0, 0.0, 20.0, "below 50 rev/min"),
        (40.0, -49.0, 20.0, "below 50 rev/min"),
        (40.0, 2000.0, None, "diameter is not known"),
        (40.0, 2000.0, 0.0, "diameter is not known"),
        (1e308, 51.0, 1e-300, "beyond"),
    ],
)
def test_no_number_is_made_up(load: float | None, rpm: float | None, diameter: float | None, word: str) -> None:
    force, reason = force_of().force(load, rpm, diameter)
    assert force is None
    assert reason is not None
    assert word in reason


def test_a_meter_that_says_nothing_has_no_force() -> None:
    assert "says nothing of the cut" in (force_of(DEAD).force(40.0, 2000.0, 20.0).reason or "")


@given(st.floats(0, 200), st.floats(50, 60_000), st.floats(0.1, 300))
def test_the_force_is_never_negative_and_falls_with_speed(load: float, rpm: float, diameter: float) -> None:
    for live in (force_of(), force_of(BENT)):
        slow, fast = live.force(load, rpm, diameter).force_n, live.force(load, 2 * rpm, diameter).force_n
        assert slow is not None
        assert fast is not None
        assert 0.0 <= fast <= slow
        assert slow == pytest.approx(2 * fast)


def test_the_tool_is_that_of_the_number_the_only_one_or_any() -> None:
    both = force_of(tool={"diameter_mm": 12.0, **CUTTER}, tools={"3": {"diameter_mm": 20.0, **CUTTER}})
    assert (both.tool(3.0), both.tool(4.0), both.tool(None)) == (ToolUsed("3", 20.0), ToolUsed("", 12.0), ToolUsed("", 12.0))
    one = force_of(tools={"3": {"diameter_mm": 20.0, **CUTTER}})
    assert (one.tool(None), one.tool(4.0).diameter_mm) == (ToolUsed("3", 20.0), None)
    assert force_of().tool(3.0) == ToolUsed("", None, "tool diameter is not known")


def test_a_section_that_is_there_is_never_completed() -> None:
    bare = MachineFile.model_validate({"machine": {"name": "vmc"}})
    assert completed(bare, "spindle").spindle == SPINDLE
    known = MachineFile.model_validate({"machine": {"name": "vmc"}, "spindle": DRIVE})
    assert completed(known, "spindle") is known
    assert completed(known, "thermal").machine.assumed == ("thermal",)
