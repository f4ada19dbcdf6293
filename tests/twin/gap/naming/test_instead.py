"""An effect in place of constants that would have to be far from what is stated."""

from dataclasses import dataclass

import numpy as np
import pytest

from tests.twin.gap.one_line import SCALE, Floats, OneLine
from twin.gap.fitting import fitted
from twin.gap.naming.instead import instead_of_constants
from twin.gap.naming.moved import cost
from twin.gap.search import explain
from twin.gap.stages.free import Free, constant
from twin.gap.stages.stage import Model

OFFSET = 2.0
FREE = (constant("slope", 0.05), constant("offset", 0.05))


@dataclass(frozen=True, eq=False)
class Lifted(OneLine):
    """A line with an offset, both uncertain."""

    constants: tuple[Free, ...] = FREE

    def predict(self, model: Model, theta: Floats, run: int) -> Floats:
        """The line at each row of θ, (lanes, n)."""
        one = np.ones(len(theta))
        factors, values = model.factors(theta), model.values(theta)
        line = np.multiply.outer(factors.get("slope", one), self.at(run)) + OFFSET * factors.get("offset", one)[:, None]
        return np.asarray(line * (values[SCALE]["scale"] if SCALE in values else one)[:, None])


def test_an_effect_that_puts_several_constants_back_is_taken_instead() -> None:
    stage = Lifted(slope=1.15, bias=1.15 * OFFSET, candidates=(SCALE,))
    model = Model(stage.constants, ())
    base = fitted(stage, model, model.null_theta())
    (found,) = instead_of_constants(stage, base)
    assert found.effects == (SCALE,)
    assert cost(found) < 0.1 * cost(base)
    assert explain(stage).best.effects == (SCALE,)


def test_an_effect_that_may_as_well_be_nothing_is_not_taken(monkeypatch: pytest.MonkeyPatch) -> None:
    stage = Lifted(slope=1.15, bias=1.15 * OFFSET, candidates=(SCALE,))
    model = Model(stage.constants, ())
    base = fitted(stage, model, model.null_theta())
    (found,) = instead_of_constants(stage, base)
    sure = float(found.theta[-1] / np.sqrt(found.covariance[-1, -1]))
    monkeypatch.setattr("twin.gap.naming.instead.SURE", 1.1 * sure)
    assert instead_of_constants(stage, base) == ()


def test_an_effect_that_does_what_one_constant_does_is_no_better() -> None:
    stage = OneLine(slope=1.15, candidates=(SCALE,))
    model = Model(stage.constants, ())
    assert instead_of_constants(stage, fitted(stage, model, model.null_theta())) == ()
    found = explain(stage)
    assert found.best.effects == ()
    assert found.beyond
    assert found.base.theta[0] == pytest.approx(np.log(1.15), abs=0.02)
