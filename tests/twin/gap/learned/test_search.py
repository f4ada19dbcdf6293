"""A term that no catalogue has is found at its site, over what it depends on."""

import numpy as np

from tests.twin.gap.learned.pushed import healthy_stage, refitted, stage_with
from twin.gap.learned.search import free_form, refined, refitted_beside
from twin.learned.words import LearnedSite

AT_MM = np.linspace(0.0, 45.0, 16)


def test_a_spring_is_a_force_over_the_position() -> None:
    stage = stage_with(LearnedSite.AXIS_FORCE, {"position_mm": AT_MM}, lambda x: 4.0 * (x - 10.0))
    parent = refitted(stage)
    best = refined(stage, free_form(stage, parent)[0], parent)
    assert (best.term.site, best.term.knots.columns) == (LearnedSite.AXIS_FORCE, ("position_mm",))
    place = dict(best.found.model.term_places())[best.term]
    term = best.term.term(best.found.theta[place], best.found.covariance[place, place])
    inside = slice(2, -2)
    at = term.knots.by_column["position_mm"][inside]
    assert np.abs(term.value[inside] - 4.0 * (at - 10.0)).max() < 12.0


def test_a_rough_place_is_friction_over_the_position() -> None:
    stage = stage_with(LearnedSite.FRICTION, {"position_mm": AT_MM}, lambda x: 200.0 * np.exp(-(((x - 15.0) / 4.0) ** 2)))
    best = free_form(stage, refitted(stage))[0]
    assert (best.term.site, best.term.knots.columns) == (LearnedSite.FRICTION, ("position_mm",))


def test_nothing_is_found_on_a_healthy_axis() -> None:
    stage = healthy_stage()
    assert free_form(stage, refitted(stage)) == ()


def test_only_the_sites_that_are_asked_for_are_tried() -> None:
    stage = stage_with(LearnedSite.AXIS_FORCE, {"position_mm": AT_MM}, lambda x: 4.0 * (x - 10.0))
    found = free_form(stage, refitted(stage), sites={LearnedSite.FRICTION})
    assert {one.term.site for one in found} <= {LearnedSite.FRICTION}


def test_a_term_is_fitted_beside_what_a_hypothesis_has() -> None:
    stage = stage_with(LearnedSite.AXIS_FORCE, {"position_mm": AT_MM}, lambda x: 4.0 * (x - 10.0))
    parent = refitted(stage)
    term = free_form(stage, parent, sites={LearnedSite.AXIS_FORCE})[0].term
    beside = refitted_beside(stage, parent, term)
    assert beside.left.gap() < 0.5 * parent.left.gap()
