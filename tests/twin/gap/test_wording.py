"""A diagnosis in a line, in the words of the shop floor."""

from dataclasses import replace

import pytest

from tests.twin.gap.stages.produced import case_with
from tests.twin.gap.stages.test_air import LOAD
from twin.gap.diagnose import diagnose
from twin.gap.diagnosis import Diagnosis, Effected, Verdict
from twin.gap.wording import effect_words, in_short


@pytest.fixture(scope="module")
def told() -> Diagnosis:
    """A diagnosis that names idle power."""
    return diagnose(case_with(slope_pct=6.0)).diagnosis


def test_a_cause_stands_with_what_it_does_to_the_gap(told: Diagnosis) -> None:
    words, _, figures = in_short(told).partition(": ")
    assert words == "idle power grows with the speed"
    gap = told.gap.by_signal[LOAD]
    assert figures.startswith("gap of the spindle load ")
    before, after = (
        float(part) for part in figures.removeprefix("gap of the spindle load ").removesuffix(" floors").split(" → ")
    )
    assert before == pytest.approx(gap.before / gap.floor, rel=0.05)
    assert after == pytest.approx(gap.after / gap.floor, rel=0.1)


def test_what_cannot_be_told_from_it_stands_beside(told: Diagnosis) -> None:
    cause = replace(told.causes[0], indistinguishable_from=(Effected("sensor_scale", LOAD), Effected("rated_power")))
    said = in_short(replace(told, causes=(cause,)))
    assert "(or the spindle load is read on another scale, the meter's 100 % is another power): gap" in said


def test_without_a_cause_it_says_so(told: Diagnosis) -> None:
    nothing = replace(told, causes=())
    assert in_short(replace(nothing, verdict=Verdict.HEALTHY)).startswith("as told: gap of the spindle load ")
    assert in_short(replace(nothing, verdict=Verdict.UNKNOWN)).startswith("no effect explains it: ")
    assert in_short(replace(nothing, verdict=Verdict.EXPLAINED)).startswith("constants differ from what is stated: ")


def test_an_effect_says_what_it_is_on() -> None:
    assert effect_words("gravity", "z") == "a constant force pulls on Z"
    assert effect_words("sensor_lag", "spindle_temp_c") == "the spindle temperature is read by a slow sensor"
    assert effect_words("runout", "3") == "the tool runs out"
