"""Runout: hand figures of the chips, and that the mean over a turn stays while all teeth cut."""

import math

import numpy as np
import pytest

from twin.machine import Tool
from twin.process.milling import Milling, milling_force, tool_constants

TOOL = tool_constants(Tool(diameter_mm=20.0, teeth=2, tangential_coefficient_n_per_mm2=1000.0, radial_ratio=0.0))


def turns(eccentricity_mm: float, phase_rad: float) -> np.ndarray:
    """Force across the feed of tooth 0, then of tooth 1, in the middle of a slot of 1 mm; advance 0.05 mm."""
    motion = Milling(np.array([math.pi / 2, 3 * math.pi / 2]), *[np.full(2, v) for v in (600.0, 1.0, 0.0, 1.0, 0.0, math.pi)])
    values = {"runout__eccentricity_mm": eccentricity_mm, "runout__phase_rad": phase_rad}
    return milling_force(TOOL | values, 2, motion, effects=["runout"]).force_y_n[0]


def test_the_longer_of_two_teeth_takes_twice_the_eccentricity_more() -> None:
    """ρ = 0.01 mm towards tooth 0: its chip is 0.05 + 0.02 mm, the other's 0.05 − 0.02 mm."""
    assert turns(0.01, 0.0) == pytest.approx([70.0, 30.0])
    assert turns(0.01, math.pi) == pytest.approx([30.0, 70.0])
    assert turns(0.01, math.pi / 2) == pytest.approx([50.0, 50.0])


def test_a_tooth_that_is_too_short_takes_nothing() -> None:
    assert turns(0.03, 0.0) == pytest.approx([110.0, 0.0])


def test_the_mean_over_a_turn_of_four_teeth_stays() -> None:
    """3,000 rev/min are 20 ticks a turn; the arc keeps clear of the thin ends, where chips would be clipped."""
    angle = 0.05 + 0.1 * math.pi * np.arange(20)
    motion = Milling(angle, *[np.full(20, v) for v in (3000.0, 20.0, 0.0, 1.0, 0.8, 2.3)])
    values = {"runout__eccentricity_mm": 0.005, "runout__phase_rad": 0.9}
    bare = milling_force(TOOL, 4, motion)
    run_out = milling_force(TOOL | values, 4, motion, effects=["runout"])
    assert np.abs(run_out.mean_force_y_n - bare.mean_force_y_n).max() > 1.0
    assert run_out.mean_force_y_n.mean() == pytest.approx(bare.mean_force_y_n.mean())
