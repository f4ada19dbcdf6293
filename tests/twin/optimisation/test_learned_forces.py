"""Learned terms of the cut and of the spindle's power in an optimisation."""

from typing import Any

import numpy as np
import pytest

from tests.twin.optimisation.benchmark import machine_with, second, text
from twin.machine import machine_from_toml
from twin.optimisation.forces import CutForces
from twin.optimisation.optimise import optimise
from twin.optimisation.question import Question, problem
from twin.simulator.simulation import simulate

SPINDLE = {"rated_power_kw": 1.0, "efficiency": 0.8, "idle_power_kw": 0.1}


def learned(site: str, table: dict[str, list[float]], on: str = "") -> dict[str, Any]:
    return {"effect": "learned", "site": site, "on": on, "table": table}


def question(*terms: dict[str, Any], tool: dict[str, float] | None = None) -> Question:
    return second(machine_toml=machine_with(text("second.toml"), effects=list(terms), spindle=SPINDLE, tool=tool or {}))


def forces(*terms: dict[str, Any], tool: dict[str, float] | None = None) -> CutForces:
    return CutForces.of(problem(question(*terms, tool=tool)).program)


@pytest.mark.parametrize(
    "table",
    [
        {"chip_mm": [0.0, 0.1], "value": [200.0, 200.0]},
        {"axial_depth_mm": [0.0], "value": [200.0]},
        {"x_position_mm": [0.0, 5.0], "value": [-50.0, 200.0]},
    ],
)
def test_a_specific_force_is_a_k_t_raised_by_the_most_that_it_may_be(table: dict[str, list[float]]) -> None:
    machine = machine_from_toml(text("second.toml"))
    assert machine.tool is not None
    harder = {"tangential_coefficient_n_per_mm2": machine.tool.tangential_coefficient_n_per_mm2 + 200.0}
    found, other = forces(learned("cut_force", table)), forces(tool=harder)
    advance = np.full(len(found.cuts), 0.02)
    np.testing.assert_allclose(found.peak_n(advance), other.peak_n(advance), rtol=1e-9)
    np.testing.assert_allclose(found.tangential_n(advance), other.tangential_n(advance), rtol=1e-9)


def test_a_force_that_falls_with_the_chip_still_grows_with_the_advance() -> None:
    found = forces(learned("cut_force", {"chip_mm": [0.0, 0.01, 0.02], "value": [9000.0, 3000.0, -1000.0]}))
    peaks = np.array([found.peak_n(np.full(len(found.cuts), advance)) for advance in np.geomspace(1e-3, 0.2, 60)])
    assert (np.diff(peaks, axis=0) >= -1e-9 * peaks[1:]).all()


def test_a_force_in_one_direction_is_in_every_peak() -> None:
    bare, pushed = forces(), forces(learned("cut_force", {"x_position_mm": [0.0, 5.0], "value": [-7.0, 3.0]}, "x"))
    advance = np.full(len(bare.cuts), 0.02)
    np.testing.assert_allclose(pushed.peak_n(advance) - bare.peak_n(advance), 7.0)


def test_a_zero_table_changes_no_force() -> None:
    bare, zero = forces(), forces(learned("cut_force", {"chip_mm": [0.0, 0.1], "value": [0.0, 0.0]}))
    advance = np.full(len(bare.cuts), 0.02)
    assert (zero.peak_n(advance) == bare.peak_n(advance)).all()


def test_power_that_is_learned_leaves_less_for_the_cut() -> None:
    """0.2 kW of 1 kW are asked for: 0.8 (0.2 − 0.1) kW for the cut, and with 0.05 kW that the term takes 0.04 kW."""
    table = {"load_pct": [0.0, 10.0, 20.0], "value": [0.0, 0.05, 0.03]}
    limits = machine_with(
        text("second.toml"), spindle=SPINDLE, limits={"power_kw": 0.2}, effects=[learned("spindle_power", table)]
    )
    spindle = problem(second(machine_toml=limits)).allowed.spindle
    assert spindle is not None
    left_w = spindle.allowed_cutting_w(np.array([3000.0]))
    assert left_w[0] == pytest.approx(40.0, rel=1e-6)
    assert spindle.electrical_kw(left_w, np.array([3000.0]))[0] <= 0.2 * (1.0 + 1e-9)


def test_what_is_written_keeps_the_force_limit_on_the_simulated_machine_and_says_that_it_was_sampled() -> None:
    table = {"chip_mm": [0.0, 0.01, 0.04], "value": [900.0, 400.0, -200.0]}
    asked = question(learned("cut_force", table))
    found = optimise(asked.with_(evolutions=4))
    assert any("learned terms" in note for note in found.notes)
    run = simulate(machine_from_toml(asked.machine_toml), found.program)
    assert run.run["cutting_force_peak_n"].max() <= 60.0 * 1.01
    assert run.run["cutting_force_peak_n"].max() >= 60.0 * 0.8
