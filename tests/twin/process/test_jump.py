"""Samples whose force hangs on the last digit of an angle."""

import math

import numpy as np

from twin.machine import Tool
from twin.process.jump import at_a_jump
from twin.process.milling import Milling, milling_force, tool_constants

TOOL = Tool(diameter_mm=20.0, teeth=3, tangential_coefficient_n_per_mm2=900.0, radial_ratio=0.4)


def test_beside_the_marked_ticks_a_rounded_angle_tells_the_force() -> None:
    """Up milling leaves at the thickest chip: there the force jumps by all of it."""
    angle = np.linspace(0.0, 2 * math.pi, 4001)
    constant = [np.full(4001, v) for v in (3000.0, 20.0, 5.0, 1.0, 0.0, math.pi / 2)]
    exact, rounded = (Milling(a, *constant) for a in (angle, np.round(angle, 2)))
    forces = [milling_force(tool_constants(TOOL), 3, motion).force_y_n[0] for motion in (exact, rounded)]
    marked = at_a_jump(rounded, 3, 0.0051)[0]
    error = np.abs(forces[0] - forces[1])
    assert error.max() > 50.0
    assert error[~marked].max() < 1.0
    assert 0 < marked.sum() < 100
