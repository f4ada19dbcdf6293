"""Idle power from the load in air."""

import pytest

from tests.twin.gap.stages.produced import MACHINE, case_with, produced
from twin.gap.stages.air import air_runs
from twin.identification.identify import identify
from twin.identification.idle_fit import fit_idle


@pytest.mark.parametrize(("factor", "step_pct"), [(1.0, 0.1), (1.6, 0.1), (1.6, 1.0)])
def test_idle_power_is_what_the_load_in_air_shows(factor: float, step_pct: float) -> None:
    assert MACHINE.spindle is not None
    found = fit_idle(MACHINE.spindle, air_runs(MACHINE, (produced(1, factor=factor, step_pct=step_pct),)))
    assert found is not None
    assert abs(found.power_kw - 0.3 * factor) < 2.0 * found.deviation_kw
    assert found.deviation_kw < 0.04


def test_power_that_differs_by_speed_is_known_no_better_than_that() -> None:
    assert MACHINE.spindle is not None
    found = fit_idle(MACHINE.spindle, air_runs(MACHINE, (produced(1, slope_pct=6.0),)))
    assert found is not None and found.deviation_kw > 0.2


def test_an_assumed_idle_power_is_assumed_no_longer() -> None:
    assumed = MACHINE.machine.model_copy(update={"assumed": ("spindle",)})
    machine = MACHINE.model_copy(update={"machine": assumed, "uncertainty": {"relative": 0.5}})
    found = identify(case_with(machine, factor=1.6))
    assert found.machine.machine.assumed == ("spindle.efficiency", "spindle.rated_power_kw")
    assert found.machine.spindle is not None
    assert found.machine.spindle.idle_power_kw == pytest.approx(0.48, rel=0.03)
    (estimate,) = found.estimates
    assert estimate.path == "spindle.idle_power_kw" and estimate.identifiable
