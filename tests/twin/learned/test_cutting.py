"""Learned terms of the cut, the spindle and its heat in a simulation, and in the stages that are judged on recordings."""

from pathlib import Path

import numpy as np
import pytest

from tests.twin.gap.small_case import HOT, warm_case
from tests.twin.simulator.test_simulation import MACHINE, SLOT
from twin.case import RunAtHand, RunEntry
from twin.gap.floors import repeatability
from twin.gap.stages.plan import ground_of
from twin.gap.stages.shown import shown
from twin.learned.section import LearnedSection
from twin.machine import MachineFile
from twin.simulator.response import RunInput, respond
from twin.simulator.simulation import simulate

QUIET = MACHINE.model_copy(update={"noise": {}})
MODEL = {"axial_depth_mm": [0.0, 5.0], "spindle_rpm": [0.0, 9000.0], "chip_mm": [0.0, 0.02], "x_position_mm": [0.0, 30.0]}


def term(site: str, column: str, at: list[float], value: list[float], on: str = "") -> LearnedSection:
    return LearnedSection.model_validate({"site": site, "on": on, "table": {column: at, "value": value}})


def run(*terms: LearnedSection, machine: MachineFile = QUIET) -> dict[str, np.ndarray]:
    return dict(simulate(machine.model_copy(update={"learned": terms}), SLOT).run.columns)


@pytest.fixture(scope="module")
def bare() -> dict[str, np.ndarray]:
    return run()


@pytest.mark.parametrize(
    ("site", "on"),
    [("cut_force", ""), ("cut_force", "x"), ("spindle_power", ""), ("force_reading", "force_x_n"), ("heat_input", "")],
)
def test_a_table_of_zeros_changes_nothing(bare: dict[str, np.ndarray], site: str, on: str) -> None:
    shown = run(term(site, "spindle_rpm", [0.0, 9000.0], [0.0, 0.0], on))
    for name, values in bare.items():
        if values.dtype == np.float64:
            np.testing.assert_array_equal(shown[name], values, err_msg=name)


@pytest.mark.parametrize("column", MODEL)
def test_a_constant_specific_force_is_a_k_t_raised_by_it(column: str) -> None:
    shown = run(term("cut_force", column, MODEL[column], [200.0, 200.0]))
    assert QUIET.tool is not None
    harder = QUIET.tool.model_copy(update={"tangential_coefficient_n_per_mm2": 1430.0})
    other = run(machine=QUIET.model_copy(update={"tool": harder}))
    for name in ("force_x_n", "force_y_n", "spindle_load_pct", "x_torque_a", "cutting_force_peak_n", "spindle_temp_c"):
        np.testing.assert_allclose(shown[name], other[name], rtol=1e-9, atol=1e-9, err_msg=name)


def test_a_force_in_one_direction_pushes_the_axis_while_the_tool_cuts(bare: dict[str, np.ndarray]) -> None:
    shown = run(term("cut_force", "spindle_rpm", [0.0], [30.0], "force_x_n"))
    cutting = (bare["axial_depth_mm"] > 0.0) & (bare["spindle_rpm"] > 0.0)
    np.testing.assert_allclose(shown["force_x_n"] - bare["force_x_n"], np.where(cutting, 30.0, 0.0), atol=1e-9)
    inside = (bare["x_ref_mm"] > 5.0) & (bare["x_ref_mm"] < 25.0) & cutting
    assert np.mean((shown["x_torque_a"] - bare["x_torque_a"])[inside]) == pytest.approx(-30.0 / 628.3, rel=0.02)
    assert (shown["cutting_force_peak_n"] >= np.hypot(shown["force_x_n"], shown["force_y_n"]) - 1e-6).all()


def test_a_power_is_shown_over_the_rated_one(bare: dict[str, np.ndarray]) -> None:
    shown = run(term("spindle_power", "time_since_start_s", [0.0], [0.11]))
    np.testing.assert_allclose(shown["spindle_load_pct"] - bare["spindle_load_pct"], 1.0, atol=1e-9)


WARM = RunInput(
    t_s=np.arange(0.0, 3600.0, 5.0),
    spindle_rpm=np.full(720, 6000.0),
    ambient_temp_c=np.full(720, 20.0),
    start_temp_c=20.0,
)
LOAD = {"spindle_load_pct": np.full(720, 10.0)}


def test_a_loss_in_proportion_to_the_rise_is_a_smaller_resistance() -> None:
    """10 W/K beside 1 / 0.12 W/K, from 20 °C on; the temperature that it depends on is the one that it makes."""
    loss = term("heat_loss", "temperature_c", [20.0, 80.0], [0.0, 600.0])
    assert HOT.thermal is not None
    open_hall = HOT.thermal.model_copy(update={"resistance_k_per_w": 1.0 / (1.0 / 0.12 + 10.0)})
    found, other = (
        respond(machine, WARM, recorded=LOAD).columns["spindle_temp_c"]
        for machine in (HOT.model_copy(update={"learned": (loss,)}), HOT.model_copy(update={"thermal": open_hall}))
    )
    assert other.max() > 25.0
    np.testing.assert_allclose(found, other, atol=0.05)


def test_what_goes_in_and_what_is_lost_cancel() -> None:
    both = tuple(term(site, "spindle_rpm", [0.0, 9000.0], [0.0, 300.0]) for site in ("heat_input", "heat_loss"))
    found, bare = (respond(HOT.model_copy(update={"learned": t}), WARM, recorded=LOAD).columns for t in (both, ()))
    np.testing.assert_allclose(found["spindle_temp_c"], bare["spindle_temp_c"], atol=1e-9)


def test_a_learned_heat_is_shown_beside_a_recording() -> None:
    case = warm_case()
    floors = ground_of(case, frozenset()).floors
    more = case.machine.model_copy(update={"learned": (term("heat_input", "coolant_on", [0.0], [40.0]),)})
    reads = case.machine.model_copy(update={"learned": (term("temperature_reading", "temperature_c", [0.0], [0.7]),)})
    run = case.runs[0]
    bare, warmer, off = (shown(m, run, floors)["spindle_temp_c"] for m in (case.machine, more, reads))
    assert np.max(warmer - bare) == pytest.approx(40.0 * 0.12, rel=0.1)
    np.testing.assert_allclose(off - bare, 0.7, atol=1e-9)


def test_a_power_over_the_load_is_over_the_load_without_it(bare: dict[str, np.ndarray]) -> None:
    """1 kW for each 100 %: the load of 11 kW is 1/11 more than it was, and no more for that."""
    shown = run(term("spindle_power", "load_pct", [0.0, 100.0], [0.0, 1.0]))
    np.testing.assert_allclose(shown["spindle_load_pct"], bare["spindle_load_pct"] * (1.0 + 1.0 / 11.0), rtol=1e-9)


def test_a_learned_power_is_shown_beside_a_recording_as_it_is_simulated() -> None:
    learned = (
        term("spindle_power", "load_pct", [0.0, 4.0, 8.0], [0.0, 0.2, 0.1]),
        term("cut_force", "x_position_mm", [0.0, 30.0], [0.0, 400.0]),
    )
    real = QUIET.model_copy(update={"learned": learned})
    run = simulate(real, SLOT).run
    entry = RunEntry.model_validate({"file": "cut", "kind": "cut", "role": "fit"})
    at_hand = RunAtHand(entry, Path(), run)
    found = shown(real, at_hand, repeatability((), (), real))
    for signal in ("spindle_load_pct", "force_x_n", "force_y_n"):
        compared = np.isfinite(found[signal])
        assert compared.any()
        np.testing.assert_allclose(found[signal][compared], run[signal][compared], atol=1e-6, err_msg=signal)
