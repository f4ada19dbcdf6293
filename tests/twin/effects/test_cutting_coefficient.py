"""A harder material: the hand figure, and where it shows."""

import math

import pytest

from twin.machine import Tool
from twin.process.milling import peak_force, tool_constants

TOOL = tool_constants(Tool(diameter_mm=6.0, teeth=2, tangential_coefficient_n_per_mm2=1230.0, radial_ratio=0.5))


def test_a_quarter_harder_takes_a_quarter_more_force() -> None:
    """c = 0.025 mm, 0.8 mm deep: 27.50 N of the nominal material, 34.38 N of one with 1.25 times its coefficient."""
    cut = (8000.0, 400.0, 0.8, 0.0, math.pi)
    harder = peak_force(TOOL | {"cutting_coefficient__scale": 1.25}, 2, *cut, effects=["cutting_coefficient"])
    assert harder[0, 0] == pytest.approx(1.25 * 1230.0 * 0.8 * 0.025 * math.sqrt(1.25))
    assert round(float(harder[0, 0]), 2) == 34.38
