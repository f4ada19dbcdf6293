"""Wind-up where friction, or a part of the mass, lies before the elastic element."""

import numpy as np
import pytest
from numpy.typing import NDArray

from tests.twin.axes import constants, reference, with_effect
from twin.servo.run import AxisInput, run_axes

STIFFNESS_N_PER_MM = 8e4
LANE, PERIOD_S = 0, 0.001


def run_with(before: float) -> dict[str, NDArray[np.float64]]:
    """The first axis with such a joint: its quantities, (ticks,)."""
    given = with_effect(constants(), "screw_compliance", {"stiffness_n_per_mm": STIFFNESS_N_PER_MM, "before": before})
    outputs = ("position_mm", "velocity_mm_s", "torque_a", "table_mm")
    run = run_axes(given, AxisInput(reference(1500), np.arange(3)), effects=("screw_compliance",), outputs=outputs)
    return {name: values[LANE] for name, values in run.outputs.items()} | {"mass_kg": given["mass_kg"][LANE]}


def wound_n(run: dict[str, NDArray[np.float64]]) -> NDArray[np.float64]:
    """The force that winds the element up, from the second tick on."""
    return np.asarray(STIFFNESS_N_PER_MM * (run["position_mm"] - run["table_mm"])[2:])


def inertia_n(run: dict[str, NDArray[np.float64]]) -> NDArray[np.float64]:
    """The force that moves the whole mass over the period before each tick, from the second one on."""
    return np.asarray(0.001 * run["mass_kg"] * np.diff(run["velocity_mm_s"])[1:] / PERIOD_S)


@pytest.mark.parametrize("before", [0.0, 0.4, 1.0])
def test_what_is_left_of_the_drive_force_after_the_friction_before_it_winds_it_up(before: float) -> None:
    drive_n, run = wound_n(run_with(0.0)), run_with(before)
    expected = (1.0 - before) * drive_n + before * inertia_n(run)
    np.testing.assert_allclose(wound_n(run), expected, atol=1e-5)
    assert np.ptp(inertia_n(run)) > 100.0


def test_a_mass_before_it_takes_its_part_of_the_force_that_moves_the_whole() -> None:
    drive_n, run = wound_n(run_with(0.0)), run_with(-0.3)
    np.testing.assert_allclose(wound_n(run), drive_n - 0.3 * inertia_n(run), atol=1e-5)
