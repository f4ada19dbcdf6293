"""A constant that is only assumed leaves the list once recordings tell it."""

import pytest

from twin.assumed import with_fitted
from twin.machine import MachineFile, machine_from_toml

TEXT = """
[machine]
name = "vmc"
assumed = ASSUMED
[spindle]
rated_power_kw = 15.0
efficiency = 0.85
idle_power_kw = 0.3
[thermal]
alpha_w_per_pct_rpm2 = ALPHA
beta_w_per_rpm = 1.2e-2
resistance_k_per_w = 0.18
capacity_j_per_k = 6000.0
"""
HEAT = ("alpha_w_per_pct_rpm2", "beta_w_per_rpm", "resistance_k_per_w")


def machine(*assumed: str, alpha: float = 1.8e-8) -> MachineFile:
    """Return a machine with these assumptions."""
    listed = ", ".join(f'"{one}"' for one in assumed)
    return machine_from_toml(TEXT.replace("ASSUMED", f"[{listed}]").replace("ALPHA", str(alpha)))


def left(given: MachineFile, **deviations: float) -> tuple[str, ...]:
    """Return what is still assumed when constants of the heat and the spindle are known like this."""
    spindle = ("efficiency", "idle_power_kw")
    told = {f"{'spindle' if name in spindle else 'thermal'}.{name}": value for name, value in deviations.items()}
    return with_fitted(given, told).machine.assumed


def test_a_section_leaves_with_all_its_constants() -> None:
    assert left(machine("spindle", "thermal"), **dict.fromkeys(HEAT, 0.05)) == ("spindle",)


def test_a_constant_that_is_known_badly_stays() -> None:
    known = dict.fromkeys(HEAT, 0.05) | {"alpha_w_per_pct_rpm2": 0.4}
    assert left(machine("thermal"), **known) == ("thermal.alpha_w_per_pct_rpm2", "thermal.capacity_j_per_k")


def test_a_constant_that_is_nothing_keeps_no_section() -> None:
    assert left(machine("thermal", alpha=0.0), beta_w_per_rpm=0.05, resistance_k_per_w=0.05) == ()


def test_a_single_constant_leaves() -> None:
    assert left(machine("spindle.idle_power_kw", "thermal"), idle_power_kw=0.1) == ("thermal",)


@pytest.mark.parametrize("name", ["efficiency", "idle_power_kw"])
def test_the_rated_power_stays_while_one_of_its_powers_does(name: str) -> None:
    other = {"efficiency": "idle_power_kw", "idle_power_kw": "efficiency"}[name]
    assert left(machine("spindle"), **{name: 0.05}) == tuple(sorted((f"spindle.{other}", "spindle.rated_power_kw")))


def test_what_is_not_assumed_is_not_touched() -> None:
    given = machine("spindle")
    assert with_fitted(given, {"thermal.beta_w_per_rpm": 0.01}) is given
