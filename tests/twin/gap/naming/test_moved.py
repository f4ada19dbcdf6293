"""Constants that a fit has moved: found by how much, and whether they could have stayed within two deviations."""

import numpy as np
import pytest

from tests.twin.gap.one_line import OneLine
from twin.gap.diagnosis import Verdict
from twin.gap.fitting import fitted
from twin.gap.naming.moved import cost, deviations, has_to_be_beyond
from twin.gap.search import explain
from twin.gap.stages.free import constant
from twin.gap.stages.stage import Model
from twin.gap.verdict import judged


def found_of(slope: float, stated: float = 0.05) -> tuple[OneLine, bool, float]:
    stage = OneLine(slope=slope, constants=(constant("slope", stated),), candidates=())
    model = Model(stage.constants, ())
    found = fitted(stage, model, model.null_theta())
    return stage, has_to_be_beyond(stage, found), float(deviations(found)[0])


@pytest.mark.parametrize("sigmas", [-1.9, 0.0, 1.9])
def test_a_constant_within_two_deviations_may_be_there(sigmas: float) -> None:
    stage, beyond, away = found_of(float(np.exp(0.05 * sigmas)))
    assert away == pytest.approx(sigmas, abs=0.1)
    assert not beyond
    assert judged(explain(stage)).verdict is Verdict.HEALTHY


@pytest.mark.parametrize("sigmas", [-2.7, 2.6])
def test_a_constant_that_has_to_be_further_off_explains_the_stage_and_leaves_it_not_healthy(sigmas: float) -> None:
    stage, beyond, away = found_of(float(np.exp(0.05 * sigmas)))
    assert away == pytest.approx(sigmas, abs=0.1)
    assert beyond
    answer = judged(explain(stage))
    assert answer.verdict is Verdict.EXPLAINED
    assert answer.explained.best.effects == ()


def test_a_constant_that_the_runs_do_not_tell_has_not_moved() -> None:
    stage = OneLine(slope=1.1)
    model = Model((constant("slope", 0.05), constant("nothing", 0.05)), ())
    found = fitted(stage, model, np.array([0.0, 0.14]))
    assert deviations(found)[1] == 0.0
    assert cost(found) == pytest.approx(deviations(found)[0] ** 2)


def test_a_machine_without_free_constants_has_none_that_moved() -> None:
    stage = OneLine(constants=())
    found = fitted(stage, Model((), ()), np.zeros(0))
    assert not has_to_be_beyond(stage, found)
