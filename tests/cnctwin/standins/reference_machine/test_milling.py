"""Forces of the reference machine's cutter against those of a slot by hand."""

from math import cos, pi, sin

import numpy as np
import pytest

from cnctwin.standins.reference_machine import milling
from cnctwin.standins.reference_machine.axis import STEPS
from cnctwin.standins.reference_machine.milling import CutPhysics

TOOL = CutPhysics(20.0, 4, 900.0, 0.4)
TICKS = 200
ADVANCE_MM = 0.1
RPM = 3000.0


def cut(tool: CutPhysics, heading: float = 0.0) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """A full slot of 2 mm at 0.1 mm a tooth."""
    speed = ADVANCE_MM * tool.teeth * RPM / 60.0
    angle = np.arange(TICKS) * RPM / 60.0 * 2.0 * pi * 0.001
    velocity = np.outer([speed * cos(heading), speed * sin(heading)], np.ones(TICKS))
    sampled, held, power = np.zeros((2, TICKS)), np.zeros((2, TICKS * STEPS)), np.zeros(TICKS)
    arc = np.outer([0.0, pi], np.ones(TICKS))
    ones = np.ones(TICKS)
    milling.forces(tool, angle, RPM * ones, np.zeros((2, TICKS)), velocity, 2.0 * ones, arc, sampled, held, power)
    return sampled, held, power


def test_a_slot_takes_the_power_of_its_chips() -> None:
    """K_t times the volume that is removed: 900 N/mm² · 20 mm · 2 mm · 20 mm/s = 720 W."""
    _, _, power = cut(TOOL)
    assert power.mean() == pytest.approx(900.0 * 20.0 * 2.0 * 20.0 / 1000.0, rel=2e-3)


def test_mean_forces_of_a_slot_are_those_of_the_book() -> None:
    """Along −N a c K_r / 4, across +N a c K_t / 4 (Altintas, section 2.8, for a full slot)."""
    _, held, _ = cut(TOOL)
    across = 4 * 2.0 * ADVANCE_MM * 900.0 / 4.0
    assert held[1].mean() == pytest.approx(across, rel=5e-3)
    assert held[0].mean() == pytest.approx(-0.4 * across, rel=5e-3)


def test_force_turns_with_the_heading() -> None:
    turned = cut(TOOL, heading=pi / 2.0)[1].mean(axis=1)
    straight = cut(TOOL)[1].mean(axis=1)
    assert turned == pytest.approx([-straight[1], straight[0]], rel=0.02)


@pytest.mark.parametrize("change", [{"runout_mm": 0.01}, {"chipped_mm": 0.01}])
def test_unequal_teeth_take_together_what_equal_ones_do(change: dict[str, float]) -> None:
    assert cut(TOOL._replace(**change))[2].mean() == pytest.approx(cut(TOOL)[2].mean(), rel=5e-3)


def test_a_helix_smooths_and_leaves_the_power() -> None:
    straight, helical = cut(TOOL._replace(teeth=2)), cut(TOOL._replace(teeth=2, helix_rad=0.8))
    assert np.ptp(helical[1][1]) < np.ptp(straight[1][1])
    assert helical[2].mean() == pytest.approx(straight[2].mean(), rel=0.01)


def test_no_depth_no_force() -> None:
    sampled, held = np.zeros((2, 5)), np.zeros((2, 5 * STEPS))
    power, ones = np.zeros(5), np.ones(5)
    milling.forces(TOOL, ones, RPM * ones, np.zeros((2, 5)), np.ones((2, 5)), 0 * ones, np.zeros((2, 5)), sampled, held, power)
    assert not sampled.any() and not held.any() and not power.any()
