"""The helix: the lag by hand, and that it spreads the force over the turn without changing its mean."""

import math

import numpy as np
import pytest

from twin.effects.helix import lag_rad
from twin.machine import Tool
from twin.process.milling import Milling, milling_force, tool_constants

TOOL = tool_constants(Tool(diameter_mm=20.0, teeth=2, tangential_coefficient_n_per_mm2=1000.0, radial_ratio=0.3))


def test_at_45_degrees_an_edge_lags_by_its_height_over_the_radius() -> None:
    assert lag_rad(0.0, 5.0, 20.0, 45.0) == pytest.approx(0.5)


def test_the_force_comes_in_bit_by_bit_and_its_mean_stays() -> None:
    """Up milling to 90°: without a helix the force drops from its peak to 0 at once."""
    ticks = 2000
    angle = 2 * math.pi / ticks * np.arange(ticks)
    motion = Milling(angle, *[np.full(ticks, v) for v in (3000.0, 20.0, 0.0, 5.0, 0.0, math.pi / 2)])
    straight = milling_force(TOOL, 2, motion, period_s=0.02 / ticks)
    helical = milling_force(TOOL | {"helix__angle_deg": 30.0}, 2, motion, period_s=0.02 / ticks, effects=["helix"])
    drops = [float(np.abs(np.diff(force.force_y_n[0])).max()) for force in (straight, helical)]
    assert drops[1] < drops[0] / 10.0
    assert np.abs(helical.force_y_n).max() < np.abs(straight.force_y_n).max()
    assert helical.mean_force_y_n.mean() == pytest.approx(straight.mean_force_y_n.mean(), rel=1e-9)
    assert helical.mean_tangential_n.mean() == pytest.approx(straight.mean_tangential_n.mean(), rel=1e-9)


def test_an_edge_that_is_in_the_cut_as_a_whole_bears_the_integral_over_it() -> None:
    """Mean of sin φ over the lag ψ: (cos(φ − ψ) − cos φ) / ψ, at φ = 2 and ψ = 2 · 5 mm · tan 45° / 20 mm = 0.5."""
    motion = Milling(*[np.array([v]) for v in (2.0, 3000.0, 20.0, 0.0, 5.0, 0.0, math.pi)])
    tool = TOOL | {"radial_ratio": 0.0, "helix__angle_deg": 45.0}
    force = milling_force(tool, 1, motion, period_s=1e-9, effects=["helix"])
    expected = 1000.0 * 5.0 * 0.4 * (math.cos(1.5) - math.cos(2.0)) / 0.5
    assert force.mean_tangential_n[0, 0] == pytest.approx(expected, rel=1e-6)


@pytest.mark.parametrize("angle_deg", [2.0, 30.0, 60.0])
def test_forces_are_those_of_many_thin_slices(angle_deg: float) -> None:
    """3,000 slices that each are a straight edge of their own, at the tick and as means until the next one."""
    angle = np.array([0.3, 1.4, 2.9, 5.9])
    tool = TOOL | {"tool_diameter_mm": 6.0}
    constant = [3000.0, 20.0, 0.0, 5.0, 0.2, 1.7]
    motion = Milling(angle, *[np.full(4, v) for v in constant])
    helical = milling_force(tool | {"helix__angle_deg": angle_deg}, 2, motion, effects=["helix"])
    heights = 5.0 * (np.arange(3000) + 0.5) / 3000
    lags = 2.0 * heights * math.tan(math.radians(angle_deg)) / 6.0
    for tick in range(4):
        slices = milling_force(tool, 2, Milling(angle[tick] - lags, *[np.full(3000, v) for v in constant]))
        for name in ("force_x_n", "force_y_n", "mean_force_x_n", "mean_force_y_n", "mean_tangential_n"):
            assert getattr(helical, name)[0, tick] == pytest.approx(getattr(slices, name).mean(), abs=0.2)
    assert np.abs(helical.force_y_n).max() > 100.0
