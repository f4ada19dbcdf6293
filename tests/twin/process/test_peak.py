"""The peak of the resultant over a tooth period against closed forms and against a fine search."""

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from twin.machine import Tool
from twin.process.milling import Milling, milling_force, peak_force, tool_constants

PAPER = Tool(diameter_mm=6.0, teeth=2, tangential_coefficient_n_per_mm2=1230.0, radial_ratio=0.5)
MILL = Tool(diameter_mm=20.0, teeth=4, tangential_coefficient_n_per_mm2=900.0, radial_ratio=0.4)


@given(st.floats(100.0, 500.0), st.floats(1000.0, 8000.0), st.floats(0.1, 2.0))
def test_a_slot_with_two_flutes_peaks_at_its_closed_form(feed_mm_min: float, rpm: float, depth_mm: float) -> None:
    """F_peak = K_t d c √(1 + K_e²), c = f / (N n): the paper's tool in A6061, K_t = 1.23e9 N/m²."""
    peak = peak_force(tool_constants(PAPER), 2, rpm, feed_mm_min, depth_mm, 0.0, math.pi)
    assert peak[0, 0] == pytest.approx(1230.0 * depth_mm * feed_mm_min / (2 * rpm) * math.sqrt(1.25), rel=1e-9)


@pytest.mark.parametrize(("arc", "sine"), [((0.0, 1.0), math.sin(1.0)), ((2.4, 3.0), math.sin(2.4)), ((1.0, 2.0), 1.0)])
def test_one_tooth_in_a_short_arc_peaks_at_its_thickest_chip(arc: tuple[float, float], sine: float) -> None:
    peak = peak_force(tool_constants(PAPER), 2, 1000.0, 100.0, 1.0, *arc)
    assert peak[0, 0] == pytest.approx(1230.0 * 0.05 * math.sqrt(1.25) * sine, rel=1e-9)


def test_four_teeth_in_a_slot_share_an_even_force() -> None:
    """Two teeth a quarter turn apart: Σ sin² = 1, Σ sin cos = 0, so the resultant is K_t a c √(1 + K_e²) at any angle."""
    peak = peak_force(tool_constants(MILL), 4, 3000.0, 1200.0, 2.0, 0.0, math.pi)
    assert peak[0, 0] == pytest.approx(900.0 * 2.0 * 0.1 * math.sqrt(1.16), rel=1e-9)


EFFECTS = {
    "cutting_coefficient": {"cutting_coefficient__scale": 1.2},
    "edge_force": {"edge_force__tangential_n_per_mm": 20.0, "edge_force__radial_n_per_mm": 35.0},
    "size_effect": {"size_effect__exponent": 0.3},
    "runout": {"runout__eccentricity_mm": 0.02, "runout__phase_rad": 0.9},
    "helix": {"helix__angle_deg": 40.0},
}


@settings(max_examples=15)
@pytest.mark.parametrize("effects", [(), tuple(EFFECTS)[:4], tuple(EFFECTS)], ids=len)
@given(teeth=st.integers(1, 5), entry=st.floats(0.0, 1.5), width=st.floats(0.3, 1.6))
def test_no_angle_of_a_turn_exceeds_the_peak_and_one_reaches_it(
    effects: tuple[str, ...], teeth: int, entry: float, width: float
) -> None:
    constants = tool_constants(MILL)
    for effect in effects:
        constants |= EFFECTS[effect]
    ticks = 7200
    angle = 2 * math.pi / ticks * np.arange(ticks) + 1e-7
    motion = Milling(angle, *[np.full(ticks, v) for v in (3000.0, 20.0, 0.0, 2.0, entry, entry + width)])
    force = milling_force(constants, teeth, motion, effects=effects)
    seen = np.hypot(force.force_x_n, force.force_y_n).max()
    peak = peak_force(constants, teeth, 3000.0, 1200.0, 2.0, entry, entry + width, effects=effects)[0, 0]
    assert seen <= peak * (1.0 + (1e-4 if "helix" in effects else 1e-9))
    assert peak <= seen * (1.0 + 5e-3)


def test_a_tooth_that_leaves_as_another_enters_does_not_count_twice() -> None:
    """Four teeth in a slot, two in the cut: the peak is that of two edges a quarter turn apart, not of three."""
    constants = tool_constants(MILL) | {"tangential_coefficient_n_per_mm2": 1e-9}
    edge = {"edge_force__tangential_n_per_mm": 10.0, "edge_force__radial_n_per_mm": 0.0}
    peak = peak_force(constants | edge, 4, 3000.0, 1200.0, 2.0, 0.0, math.pi, effects=["edge_force"])
    assert peak[0, 0] == pytest.approx(2.0 * 10.0 * math.sqrt(2.0), rel=1e-6)


def test_null_effects_lanes_and_plain_python_change_no_bit() -> None:
    names = tuple(EFFECTS)
    null = {"cutting_coefficient__scale": 1.0, "edge_force__tangential_n_per_mm": 0.0, "edge_force__radial_n_per_mm": 0.0}
    null |= {"size_effect__exponent": 0.0, "runout__eccentricity_mm": 0.0, "runout__phase_rad": 1.0, "helix__angle_deg": 0.0}
    cut = (3000.0, [100.0, 900.0], 2.0, 0.3, 2.0)
    bare = peak_force(tool_constants(MILL), 4, *cut)
    assert bare.shape == (1, 2)
    assert np.array_equal(bare, peak_force(tool_constants(MILL) | null, 4, *cut, effects=names))
    assert np.array_equal(bare, peak_force(tool_constants(MILL), 4, *cut, reference_run=True))
    lanes = peak_force(tool_constants(MILL) | {"radial_ratio": np.linspace(0.3, 0.5, 11)}, 4, *cut)
    assert np.array_equal(lanes[5], peak_force(tool_constants(MILL) | {"radial_ratio": np.linspace(0.3, 0.5, 11)[5]}, 4, *cut)[0])


@pytest.mark.parametrize("cut", [(0.0, 100.0, 1.0, 0.0, 3.0), (1000.0, 0.0, 1.0, 0.0, 3.0), (1000.0, 100.0, math.nan, 0.0, 3.0)])
def test_no_cut_has_no_peak(cut: tuple[float, ...]) -> None:
    assert peak_force(tool_constants(PAPER), 2, *cut)[0, 0] == 0.0
