"""A constant that the recordings do not tell is written exactly as it was stated, and the others are fitted beside it."""

import numpy as np

from tests.twin.gap.stages.produced import MACHINE as PLAIN
from tests.twin.gap.stages.produced import case_with
from tests.twin.simulator.test_simulation import MACHINE
from twin.heat.run import Warming, spindle_temperature_c, thermal_constants
from twin.identification.cutting_fit import fit_spindle, with_spindle
from twin.identification.identify import identify
from twin.identification.thermal_fit import NAMES, WarmingRun, fit_thermal, with_thermal
from twin.machine import MachineFile

T_S = np.arange(0.0, 3600.0, 5.0)


def test_heat_without_load_leaves_alpha_as_stated_and_fits_the_friction() -> None:
    assert MACHINE.thermal is not None
    rpm = np.where(T_S < 1800.0, 8000.0, 0.0)
    warming = Warming(T_S, np.zeros(len(T_S)), rpm, np.full(len(T_S), 20.0), None)
    real = thermal_constants(MACHINE.thermal) | {"beta_w_per_rpm": 1.1 * MACHINE.thermal.beta_w_per_rpm}
    told = spindle_temperature_c(real, warming, 20.0)[0] + np.random.default_rng(1).normal(0.0, 0.05, len(T_S))
    found = fit_thermal(MACHINE.thermal, [WarmingRun(T_S, warming, told)], 0.05, 0.2)
    fitted = with_thermal(MACHINE.thermal, found)
    alpha = NAMES.index("alpha_w_per_pct_rpm2")
    assert found.known[alpha] < 0.01
    assert fitted.alpha_w_per_pct_rpm2 == MACHINE.thermal.alpha_w_per_pct_rpm2
    assert found.covariance[alpha, alpha] == 0.2**2, "its uncertainty is the stated one"
    assert abs(fitted.beta_w_per_rpm / MACHINE.thermal.beta_w_per_rpm - 1.1) < 0.01


def test_a_load_meter_that_only_shows_noise_leaves_the_drive_as_stated() -> None:
    assert MACHINE.spindle is not None
    t_s = np.arange(200) * 0.001
    load = np.random.default_rng(2).normal(40.0, 30.0, len(t_s))
    run = (t_s, np.zeros(len(t_s)), np.full(len(t_s), 3000.0), load)
    found = fit_spindle(MACHINE.spindle, [run], 0.001, 30.0, 0.05, True)
    assert (found.known < 0.5).all()
    assert with_spindle(MACHINE.spindle, found) == MACHINE.spindle


def test_an_idle_power_that_differs_by_speed_stays_as_stated() -> None:
    """Known to ±0.2 kW only, it is less than was stated."""
    machine: MachineFile = PLAIN.model_copy(update={"uncertainty": {"relative": 0.1}})
    found = identify(case_with(machine, slope_pct=6.0))
    (estimate,) = (one for one in found.estimates if one.path == "spindle.idle_power_kw")
    assert machine.spindle is not None and found.machine.spindle == machine.spindle
    assert not estimate.identifiable
    assert estimate.value == estimate.stated == machine.spindle.idle_power_kw
    assert "these recordings do not say" in estimate.sentence()
    assert "spindle.idle_power_kw" not in found.machine.uncertainty
