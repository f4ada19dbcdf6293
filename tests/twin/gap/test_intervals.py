"""Intervals of what is reported."""

import numpy as np
import pytest

from tests.twin.gap.one_line import BIAS, OneLine
from twin.gap.fitting import fitted
from twin.gap.intervals import closure_interval, parameter_intervals
from twin.gap.score import Squares
from twin.gap.stages.stage import Model


def test_the_interval_of_a_parameter_holds_the_true_one_and_is_as_wide_as_the_noise() -> None:
    stage = OneLine(bias=2.0)
    model = Model(stage.constants, (BIAS,))
    interval = parameter_intervals(fitted(stage, model, model.null_theta()))[BIAS]["bias"]
    assert interval.low < 2.0 < interval.high
    assert interval.low < interval.value < interval.high
    assert interval.high - interval.low < 0.1


def squares(rms: float, seed: int) -> Squares:
    """A signal in fifty blocks."""
    ratio = rms**2 * np.random.default_rng(seed).chisquare(30, 50)
    return Squares(ratio, np.full(50, 30.0), np.full(50, 30.0))


def test_closure_lies_in_its_interval_and_is_the_same_every_time() -> None:
    before, after = {"z_pos_mm": squares(5.0, 1)}, {"z_pos_mm": squares(2.0, 2)}
    found = closure_interval(before, after)
    assert found == closure_interval(before, after)
    closure, low, high = found
    assert closure == pytest.approx(1.0 - (2.0**2 - 1.0) / (5.0**2 - 1.0), abs=0.02)
    assert 0.0 < low < closure < high < 1.0


def test_nothing_to_close_is_no_closure() -> None:
    assert closure_interval({}, {}) == (0.0, 0.0, 0.0)
    assert closure_interval({"z_pos_mm": squares(0.9, 1)}, {"z_pos_mm": squares(0.9, 1)})[0] == 0.0
