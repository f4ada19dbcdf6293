"""Velocity feed-forward: the derivative of the reference, over the period before, over the next one, or between them."""

import numpy as np
import pytest

from twin.effects.velocity_feedforward import velocity_command_mm_s
from twin.servo.controller import reference_motion

PERIOD_S = 0.001


@pytest.mark.parametrize(("ahead_s", "since", "until"), [(0.0, -1.0, 0.0), (0.5 * PERIOD_S, -0.5, 0.5), (PERIOD_S, 0.0, 1.0)])
def test_ahead_is_the_derivative_of_a_later_period(ahead_s: float, since: float, until: float) -> None:
    def reference_mm(ticks: float) -> float:
        return 400.0 * (ticks * PERIOD_S) ** 2 + 30.0 * ticks * PERIOD_S

    now = 20.0
    before_mm_s = (reference_mm(now - 1.0) - reference_mm(now - 2.0)) / PERIOD_S
    motion = reference_motion(reference_mm(now), reference_mm(now - 1.0), before_mm_s, PERIOD_S)
    fed = velocity_command_mm_s(0.0, *motion, 0.8, ahead_s)
    later = (reference_mm(now + until) - reference_mm(now + since)) / ((until - since) * PERIOD_S)
    assert fed == pytest.approx(0.8 * later, rel=1e-9)
    assert np.isfinite(fed)
