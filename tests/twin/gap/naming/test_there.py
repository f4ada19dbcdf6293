"""An effect whose size may as well be nothing is no cause."""

from dataclasses import replace
from types import SimpleNamespace
from typing import Any, cast

import numpy as np
import pytest

from tests.twin.gap.one_line import BIAS, SCALE, OneLine
from twin.gap.diagnosis import Effected, Verdict
from twin.gap.fitting import Fitted, fitted
from twin.gap.intervals import parameter_intervals
from twin.gap.naming.there import is_there, only_there
from twin.gap.search import Explained, bare_fit
from twin.gap.stages.stage import Model
from twin.gap.verdict import judged

SIZES = Effected("servo_gain", "z")
FAINT = 0.3
"""A bias that a scale looks like, of a line whose slope is known to 5 %."""


def explained(stage: OneLine, *effects: Effected) -> Explained:
    """A stage with these effects accepted, each of them unable to be told from those that are not among them."""
    model = Model(stage.constants, effects)
    best, others = fitted(stage, model, model.null_theta() + 0.01), tuple(e for e in stage.candidates if e not in effects)
    return Explained(stage, bare_fit(stage), best, (), dict.fromkeys(effects, others), {})


@pytest.mark.parametrize(("bias", "there"), [(0.0, False), (2.0, True)])
def test_one_size_is_there_where_its_interval_does_not_hold_the_null_value(bias: float, there: bool) -> None:
    best = explained(OneLine(bias=bias), BIAS).best
    interval = parameter_intervals(best)[BIAS]["bias"]
    assert is_there(best, BIAS) is there
    assert (not interval.low <= 0.0 <= interval.high) is there


def test_what_may_be_nothing_is_dropped_and_the_others_are_fitted_without_it() -> None:
    found = only_there(explained(OneLine(slope=1.6, constants=()), BIAS, SCALE))
    assert found.best.effects == (SCALE,)
    assert found.best.values[SCALE]["scale"] == pytest.approx(1.6, rel=0.01)
    assert found.alike == (BIAS,)
    assert "sensor_bias on z_pos_mm is not named" in found.notes[0]


def test_an_effect_that_is_there_leads_where_the_one_that_it_cannot_be_told_from_may_be_nothing() -> None:
    before = explained(OneLine(bias=FAINT), SCALE)
    assert not is_there(before.best, SCALE)
    found = only_there(before)
    assert found.best.effects == (BIAS,)
    assert found.rivals[BIAS] == (SCALE,)


def test_a_gap_that_only_an_effect_explains_which_may_be_nothing_has_no_name() -> None:
    before = explained(OneLine(bias=FAINT), SCALE)
    told = judged(replace(before, rivals={}))
    assert told.explained.best.effects == ()
    assert told.verdict is Verdict.UNKNOWN
    assert told.likeness == (SCALE,)


@pytest.mark.parametrize(("correlation", "there"), [(0.0, False), (-0.98, True)])
def test_sizes_that_only_show_as_a_sum_are_there_though_each_could_be_nothing(correlation: float, there: bool) -> None:
    spread = np.array([[1.0, correlation, 0.0], [correlation, 1.0, 0.0], [0.0, 0.0, 1.0]]) * 0.09
    sure = cast(Any, SimpleNamespace(covariance=spread))
    left = explained(OneLine(), BIAS).best.left
    found = Fitted(Model((), (SIZES,)), np.array([0.3, 0.3, 0.0]), sure, left, left)
    held = [i.low <= 1.0 <= i.high for i in parameter_intervals(found)[SIZES].values()]
    assert held == [True, True, True]
    assert is_there(found, SIZES) is there
