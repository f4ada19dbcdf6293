"""Forces of the edge: the hand figure, and that an edge without a chip does not rub."""

import math

import numpy as np
import pytest

from twin.machine import Tool
from twin.process.milling import Milling, milling_force, tool_constants

TOOL = tool_constants(Tool(diameter_mm=20.0, teeth=1, tangential_coefficient_n_per_mm2=900.0, radial_ratio=0.4))
EDGE = {"edge_force__tangential_n_per_mm": 10.0, "edge_force__radial_n_per_mm": 25.0}


def in_the_middle(feed_mm_s: float, extra: dict[str, float] | None = None) -> tuple[float, float]:
    """One tooth in the middle of a slot of 2 mm, feed in +x, 600 rev/min: forces against and across the feed."""
    motion = Milling(*[np.array([v]) for v in (math.pi / 2, 600.0, feed_mm_s, 0.0, 2.0, 0.0, math.pi)])
    effects = ["edge_force", *(["runout"] if extra else [])]
    force = milling_force(TOOL | EDGE | (extra or {}), 1, motion, effects=effects)
    return float(force.force_x_n[0, 0]), float(force.force_y_n[0, 0])


def test_an_edge_adds_its_own_force_by_its_length() -> None:
    """c = 0.1 mm: F_t = (90 + 10) · 2 = 200 N, F_r = (36 + 25) · 2 = 122 N."""
    assert in_the_middle(1.0) == pytest.approx((-122.0, 200.0))


def test_what_is_left_as_the_chip_goes_to_nothing_is_the_edge() -> None:
    assert in_the_middle(1e-9) == pytest.approx((-50.0, 20.0), abs=1e-6)


def test_an_edge_that_does_not_feed_does_not_rub() -> None:
    assert in_the_middle(0.0) == (0.0, 0.0)


def test_a_tooth_that_runout_keeps_out_of_the_cut_does_not_rub() -> None:
    """With two teeth, the radii differ by 2ρ = 0.4 mm, more than the advance of 0.05 mm: only one tooth cuts."""
    angles = np.array([math.pi / 2, 3 * math.pi / 2])
    motion = Milling(angles, *[np.full(2, v) for v in (600.0, 1.0, 0.0, 2.0, 0.0, math.pi)])
    runout = {"runout__eccentricity_mm": 0.2, "runout__phase_rad": 0.0}
    force = milling_force(TOOL | EDGE | runout, 2, motion, effects=["edge_force", "runout"])
    assert force.force_y_n[0] == pytest.approx([2 * (900 * 0.45 + 10), 0.0])
