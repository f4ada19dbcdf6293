"""A learned term that is being fitted: smooth, and on top of the quantity at its site."""

import numpy as np

from tests.twin.gap.small_case import air_case
from twin.gap.fitting import fitted
from twin.gap.stages.free_term import FreeTerm
from twin.gap.stages.plan import axis_stage, ground_of
from twin.gap.stages.stage import Model
from twin.learned.knots import Knots
from twin.learned.words import LearnedSite
from twin.machine import AddedEffect

FORCE_N = 300.0
AT_MM = np.linspace(0.0, 45.0, 7)


def test_a_constant_load_is_learned_as_a_force_that_is_alike_everywhere() -> None:
    ground = ground_of(air_case(AddedEffect(effect="gravity", on="z", parameters={"force_n": FORCE_N})), frozenset())
    stage = axis_stage(ground, "z", {})
    assert stage is not None
    term = FreeTerm(LearnedSite.AXIS_FORCE, "z", Knots({"position_mm": AT_MM}), 100.0, {"position_mm": 15.0})
    model = Model(stage.constants, ()).with_term(term)
    found = fitted(stage, model, model.null_theta())
    place = dict(model.term_places())[term]
    learned = term.term(found.theta[place], found.covariance[place, place])
    assert np.abs(learned.value + FORCE_N).max() < 0.1 * FORCE_N
    assert (found.left.rms() < 1.3).all()


def test_at_zero_a_term_changes_nothing() -> None:
    stage = axis_stage(ground_of(air_case(), frozenset()), "z", {})
    assert stage is not None
    bare = Model(stage.constants, ())
    term = FreeTerm(LearnedSite.FRICTION, "z", Knots({"position_mm": AT_MM}), 100.0, {})
    with_term = bare.with_term(term)
    shown, same = (stage.predict(m, m.null_theta()[None, :], 0) for m in (bare, with_term))
    assert (shown == same).all()
