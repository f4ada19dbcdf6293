"""Friction compensation: all of the torque from a commanded velocity on, in proportion below it, nothing at rest."""

import pytest

from twin.effects.friction_compensation import torque_command_a


@pytest.mark.parametrize(
    ("velocity_mm_s", "part"), [(0.0, 0.0), (0.5, 0.25), (-1.0, -0.5), (2.0, 1.0), (300.0, 1.0), (-300.0, -1.0)]
)
def test_it_ramps_up_to_the_velocity_and_is_whole_beyond(velocity_mm_s: float, part: float) -> None:
    assert torque_command_a(3.0, velocity_mm_s, 0.4, 2.0) == pytest.approx(3.0 + 0.4 * part)
