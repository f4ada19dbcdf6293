"""Scores of diagnoses that are known to be right or wrong."""

from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np
import pytest

from cnctwin.blind_check.answer import Answer, Answered
from cnctwin.blind_check.given import Given, GivenCause, GivenTerm, Named, given_of
from cnctwin.blind_check.question import Sort
from cnctwin.blind_check.rate import Rate
from cnctwin.blind_check.scoring import Judged, scored
from cnctwin.standins.reference_machine.unnamed_effects import UNNAMED
from twin.gap.diagnosis import Verdict

SITES = {
    *("controller", "axis_force", "friction", "table_position", "position_reading", "table_reading", "torque_reading"),
    *("cut_force", "force_reading", "spindle_power", "heat_input", "heat_loss", "temperature_reading", "program_time"),
}
WORDS = {
    *("position", "velocity", "direction", "acceleration", "load", "axis", "spindle_angle", "spindle_rpm", "chip"),
    *("temperature", "coolant", "time_since_start", "time"),
}
"""Sites and variables of formats, section 6."""
GRAVITY, FRICTION = ("gravity", "z"), ("direction_friction", "z")


def case(
    sort: Sort, truths: Sequence[Named], causes: Sequence[GivenCause], verdict: Verdict = Verdict.EXPLAINED, size: float = 5.0
) -> Judged:
    effects = tuple(
        Answered(name, on, sort is not Sort.OUTSIDE, {"force_n": 300.0}, ("force_n",), {"s": size}) for name, on in truths
    )
    return Judged(Answer("case", sort, effects, {"s": size}), Given(verdict, tuple(causes), (), 1.0))


def cause(named: Named, *alike: Named, low: float = 290.0, high: float = 310.0) -> GivenCause:
    return GivenCause(named, frozenset(alike), {"force_n": (low, high)})


@pytest.mark.parametrize(
    ("causes", "right", "in_class", "wrong"),
    [
        ([cause(GRAVITY)], True, True, False),
        ([cause(FRICTION, GRAVITY)], False, True, False),
        ([cause(FRICTION)], False, False, True),
        ([cause(("gravity", "x"))], False, False, True),
        ([cause(GRAVITY), cause(("payload", "z"))], False, False, True),
        ([], False, False, False),
    ],
)
def test_a_name_counts_with_its_axis_and_nothing_besides(
    causes: list[GivenCause], right: bool, in_class: bool, wrong: bool
) -> None:
    one = case(Sort.SINGLE, [GRAVITY], causes)
    assert (one.right, one.in_class, one.wrong) == (right, in_class, wrong)


def test_an_effect_outside_the_catalogue_is_right_when_it_is_unknown() -> None:
    unknown = case(Sort.OUTSIDE, [("cable_chain", "x")], [], Verdict.UNKNOWN)
    named = case(Sort.OUTSIDE, [("cable_chain", "x")], [cause(GRAVITY)], Verdict.PARTLY)
    missed = case(Sort.OUTSIDE, [("cable_chain", "x")], [], Verdict.HEALTHY)
    found = scored([unknown, named, missed]).judged
    assert (found.outside_unknown.hits, found.outside_wrong.hits, found.outside_wrong.count) == (1, 1, 3)


@pytest.mark.parametrize(
    ("changes", "called", "taken_up", "missed"),
    [
        ({"verdict": Verdict.UNKNOWN}, True, False, False),
        ({"verdict": Verdict.PARTLY, "learned": (GivenTerm("friction", "x", frozenset({"position"}), 0.9),)}, True, False, False),
        ({"closure_unseen": 0.97, "constants": {"axes.x.mass_kg": 2.3}}, False, True, False),
        ({"closure_unseen": 0.97}, False, False, True),
        ({"closure_unseen": 0.6, "constants": {"axes.x.mass_kg": 2.3}}, False, False, True),
        ({"causes": (cause(GRAVITY),), "verdict": Verdict.EXPLAINED}, False, False, False),
    ],
)
def test_an_effect_outside_is_called_so_or_taken_up_and_said_so_or_missed_or_named(
    changes: Mapping[str, object], called: bool, taken_up: bool, missed: bool
) -> None:
    healthy = case(Sort.OUTSIDE, [("cable_chain", "x")], [], Verdict.HEALTHY)
    found = scored([replace(healthy, given=replace(healthy.given, **changes))]).judged  # type: ignore[arg-type]
    hits = (found.outside_unknown.hits, found.outside_taken_up.hits, found.outside_missed.hits)
    assert hits == (called, taken_up, missed)
    assert found.outside_told.hits == (called or taken_up)
    assert sum(hits) + found.outside_wrong.hits == 1


def test_cases_fall_into_bins_by_their_smallest_effect() -> None:
    small, large = case(Sort.SINGLE, [GRAVITY], [], size=1.2), case(Sort.SINGLE, [GRAVITY], [cause(GRAVITY)], size=50.0)
    found = scored([small, large])
    assert found.by_size[1.0, 1.5].single_right.count == 1
    assert found.judged.single_right == Rate(1, 1)
    assert found.by_effect == {"gravity": (Rate(1, 1), Rate(1, 1))}


def test_a_pair_is_right_when_both_are() -> None:
    both = case(Sort.PAIR, [GRAVITY, ("backlash", "x")], [cause(GRAVITY), cause(("backlash", "x"))])
    half = case(Sort.PAIR, [GRAVITY, ("backlash", "x")], [cause(GRAVITY)])
    found = scored([both, half]).judged
    assert (found.pair_both, found.pair_some, found.pair_wrong) == (Rate(1, 2), Rate(2, 2), Rate(0, 2))


def test_healthy_is_healthy_and_names_nothing() -> None:
    found = scored([case(Sort.HEALTHY, [], [], Verdict.HEALTHY), case(Sort.HEALTHY, [], [cause(GRAVITY)])])
    assert (found.healthy, found.healthy_wrong) == (Rate(1, 2), Rate(1, 2))


def test_intervals_of_right_names_cover_or_not() -> None:
    cases = [
        case(Sort.SINGLE, [GRAVITY], [cause(GRAVITY)]),
        case(Sort.SINGLE, [GRAVITY], [cause(GRAVITY, low=310.0, high=320.0)]),
    ]
    assert scored(cases).judged.covered == Rate(1, 2)


def test_an_exact_interval_is_that_of_clopper_and_pearson() -> None:
    assert Rate(0, 10).high == pytest.approx(1.0 - 0.025**0.1)
    assert Rate(10, 10).low == pytest.approx(0.025**0.1)
    assert (Rate(0, 10).low, Rate(10, 10).high) == (0.0, 1.0)
    assert str(Rate(0, 0)) == "–"


STRUCTURE = ("velocity_feedforward", "x")


def with_another_controller(causes: Sequence[GivenCause], subsystems: Mapping[str, Verdict], sort: Sort = Sort.SINGLE) -> Judged:
    truth = GRAVITY if sort is Sort.SINGLE else ("cable_chain", "z")
    asked = case(sort, [truth], causes, Verdict.PARTLY)
    structure = Answered(*STRUCTURE, True, {"gain": 0.8}, (), {"x_pos_mm": 900.0})
    return Judged(replace(asked.answer, controller=structure), replace(asked.given, subsystems=subsystems))


@pytest.mark.parametrize(
    ("causes", "subsystems", "right", "in_class", "wrong"),
    [
        ([cause(GRAVITY), cause(STRUCTURE)], {}, True, True, False),
        ([cause(GRAVITY)], {"x controller": Verdict.UNKNOWN}, True, True, False),
        ([cause(GRAVITY)], {"x controller": Verdict.HEALTHY}, False, False, False),
        ([cause(GRAVITY)], {"y controller": Verdict.UNKNOWN}, False, False, False),
        ([cause(GRAVITY), cause(("servo_gain", "x"))], {"x controller": Verdict.UNKNOWN}, False, False, True),
        ([cause(GRAVITY), cause(("servo_gain", "x"), STRUCTURE)], {}, True, True, False),
        ([cause(STRUCTURE)], {}, False, False, False),
    ],
)
def test_another_controller_may_be_named_or_called_not_understood(
    causes: list[GivenCause], subsystems: dict[str, Verdict], right: bool, in_class: bool, wrong: bool
) -> None:
    one = with_another_controller(causes, subsystems)
    assert (one.right, one.in_class, one.wrong) == (right, in_class, wrong)


def test_another_controller_that_does_not_show_need_not_be_told() -> None:
    one = with_another_controller([cause(GRAVITY)], {})
    assert one.answer.controller is not None and not one.right
    small = replace(one.answer.controller, size_over_floor={"x_pos_mm": 1.2})
    assert Judged(replace(one.answer, controller=small), one.given).right


def test_cases_with_another_controller_are_scored_apart_as_well() -> None:
    other = with_another_controller([cause(GRAVITY)], {"x controller": Verdict.UNKNOWN})
    found = scored([other, case(Sort.SINGLE, [GRAVITY], [])])
    assert (found.judged.single_right, found.nominal.single_right) == (Rate(1, 2), Rate(0, 1))
    assert (found.other_controller.single_right, found.controller_told) == (Rate(1, 1), Rate(1, 1))


def test_an_effect_outside_the_catalogue_is_unknown_beside_a_structure_that_is_named() -> None:
    named = with_another_controller([cause(STRUCTURE)], {}, Sort.OUTSIDE)
    wrong = with_another_controller([cause(STRUCTURE), cause(GRAVITY)], {}, Sort.OUTSIDE)
    assert named.unknown and not wrong.unknown
    assert scored([named, wrong]).judged.outside_wrong == Rate(1, 2)


def learned(site: str, on: str, *depends_on: str, closure: float = 0.9) -> GivenTerm:
    return GivenTerm(site, on, frozenset(depends_on), closure)


def test_a_term_for_the_structure_of_the_controller_is_not_the_one_that_is_asked_for() -> None:
    one = with_another_controller([cause(STRUCTURE)], {}, Sort.OUTSIDE)
    terms = (learned("controller", "x", "velocity"), learned("axis_force", "z", "position"))
    assert Judged(one.answer, replace(one.given, learned=terms)).variables_right
    other = Judged(one.answer, replace(one.given, learned=(replace(terms[0], on="y"), terms[1])))
    assert not other.site_right


@pytest.mark.parametrize(
    ("effect", "term", "site", "variables"),
    [
        (("cable_chain", "x"), learned("axis_force", "x", "position"), True, True),
        (("cable_chain", "x"), learned("axis_force", "y", "position"), False, False),
        (("cable_chain", "x"), learned("axis_force", "x", "position", "velocity"), True, False),
        (("cable_chain", "x"), learned("friction", "x", "position"), False, False),
        (("friction_spot", "x"), learned("friction", "x", "position"), True, True),
        (("friction_spot", "x"), learned("axis_force", "x", "direction", "position"), True, True),
        (("friction_spot", "x"), learned("axis_force", "x", "position"), True, False),
        (("scale_graduation", "y"), learned("table_reading", "y_table_mm", "position"), True, True),
        (("chipped_tooth", ""), learned("cut_force", "", "spindle_angle"), True, True),
        (("tight_bearing", ""), learned("heat_input", "", "temperature"), True, True),
        (("tight_bearing", ""), learned("spindle_power", "", "temperature"), False, False),
    ],
)
def test_a_learned_term_is_right_at_its_site_and_in_its_variables(
    effect: Named, term: GivenTerm, site: bool, variables: bool
) -> None:
    asked = case(Sort.OUTSIDE, [effect], [], Verdict.UNKNOWN)
    one = Judged(asked.answer, replace(asked.given, learned=(term, learned("clock", "")), closure_unseen=0.85))
    assert (one.site_right, one.variables_right) == (site, variables)
    found = scored([one]).learned
    assert (found.site.hits, found.variables.hits, found.closure) == (site, variables, 0.85)


def test_another_axis_is_a_variable_by_its_letter() -> None:
    effect = Answered("frame_coupling", "x", False, {"from": 2.4, "mass_kg": 40.0}, (), {"x_torque_a": 5.0})
    answer = Answer("case", Sort.OUTSIDE, (effect,), {"x_torque_a": 5.0})
    given = Given(Verdict.UNKNOWN, (), (), 1.0)
    for axis, right in (("z", True), ("y", False)):
        assert Judged(answer, replace(given, learned=(learned("axis_force", "x", f"axis:{axis}"),))).variables_right is right


def test_what_is_called_outside_and_not_described_is_at_no_site() -> None:
    found = scored([case(Sort.OUTSIDE, [("cable_chain", "x")], [], Verdict.UNKNOWN)]).learned
    assert (found.site, found.variables) == (Rate(0, 1), Rate(0, 1))


def test_every_effect_outside_the_catalogue_says_where_it_acts() -> None:
    for effect in UNNAMED:
        parameters = effect.parameters(1.0, effect.traits(np.random.default_rng(1)))
        for one in effect.acts_at(effect.places[0], parameters):
            assert one.site in SITES and {word.partition(":")[0] for word in one.depends_on} <= WORDS, effect.name
        assert effect.acts_at(effect.places[0], parameters), effect.name


def test_a_kept_diagnosis_is_read_as_the_formats_have_it() -> None:
    found = {
        "verdict": "partly_explained",
        "causes": [
            {
                "effect": "gravity",
                "on": "z",
                "parameters": {"force_n": {"value": 1.0, "low": 0.5, "high": None, "unit": "N"}},
                "indistinguishable_from": [{"effect": "direction_friction", "on": "z"}],
            }
        ],
        "subsystems": [{"subsystem": "x controller", "verdict": "unknown"}],
        "learned": [
            {"site": "friction", "on": "x", "depends_on": ["velocity"], "closure": 0.2},
            {"site": "axis_force", "on": "x", "depends_on": ["position"], "closure": 0.7},
        ],
        "not_identifiable": ["axes.x.mass_kg"],
    }
    given = given_of({"diagnosis": found, "seconds": 3.0, "failed": "", "closure_unseen": None})
    assert given.causes == (GivenCause(GRAVITY, frozenset({FRICTION}), {"force_n": (0.5, float("inf"))}),)
    assert given.subsystems == {"x controller": Verdict.UNKNOWN}
    assert [term.site for term in given.learned] == ["axis_force", "friction"]
