"""Each part of an axis is compared alone: what is wrong elsewhere does not show in it, and what is wrong in it does."""

from functools import cache

import pytest

from tests.twin.gap.small_case import air_case
from tests.twin.gap.stages.open_loop.opened import loops_of_case
from twin.gap.diagnosis import Effected, Verdict
from twin.gap.search import Explained, explain
from twin.gap.stages.open_loop.stage import OpenStage
from twin.gap.verdict import judged
from twin.machine import AddedEffect

GRAVITY = AddedEffect(effect="gravity", on="z", parameters={"force_n": 150.0})
BACKLASH = AddedEffect(effect="backlash", on="z", parameters={"play_mm": 0.008})
GAINS = AddedEffect(effect="servo_gain", on="z", parameters={"position_scale": 0.9, "velocity_scale": 1.2, "integral_scale": 0.8})


@cache
def loops(*effects: str) -> dict[str, OpenStage]:
    known = {effect.effect: effect for effect in (GRAVITY, BACKLASH, GAINS)}
    return loops_of_case(air_case(*(known[name] for name in effects)))


@cache
def found(name: str, *effects: str) -> Explained:
    return explain(loops(*effects)[name])


def test_a_healthy_axis_is_healthy_in_each_of_its_parts() -> None:
    assert set(loops()) == {"controller", "mechanics", "table"}
    for name in loops():
        assert judged(found(name)).verdict is Verdict.HEALTHY, name


@pytest.mark.parametrize(
    ("effect", "part"), [("gravity", "mechanics"), ("backlash", "table"), ("servo_gain", "controller")], ids=str
)
def test_an_effect_is_found_in_the_part_where_it_acts_and_shows_in_no_other(effect: str, part: str) -> None:
    for name in loops(effect):
        verdict = judged(found(name, effect)).verdict
        assert verdict is (Verdict.EXPLAINED if name == part else Verdict.HEALTHY), name
    assert found(part, effect).best.effects == (Effected(effect, "z"),)


def test_the_parameters_are_those_of_the_machine() -> None:
    force_n = found("mechanics", "gravity").best.values[Effected("gravity", "z")]["force_n"]
    assert force_n == pytest.approx(150.0, rel=0.05)
    gains = found("controller", "servo_gain").best.values[Effected("servo_gain", "z")]
    assert gains["velocity_scale"] == pytest.approx(1.2, abs=0.01)


def test_an_open_loop_is_named_by_its_axis_and_has_only_what_acts_in_it_for_candidates() -> None:
    by_name = {name: {c.effect for c in stage.candidates} for name, stage in loops().items()}
    assert loops()["mechanics"].name == "z mechanics"
    assert "gravity" in by_name["mechanics"] - by_name["controller"] - by_name["table"]
    assert "servo_gain" in by_name["controller"] - by_name["mechanics"] - by_name["table"]
    assert "backlash" in by_name["table"] - by_name["mechanics"] - by_name["controller"]
