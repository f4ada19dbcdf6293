"""Constants that take up a part of the gap are listed with their shares, and named in the sentence."""

from functools import cache

import pytest

from tests.twin.gap.small_case import HOT, case_of, columns_of, warm_case
from twin.case import RunKind
from twin.gap.diagnose import diagnose
from twin.gap.diagnosis import Diagnosis, MovedConstant, Verdict
from twin.gap.naming.constants import said_of


@cache
def told(resistance: float, capacity: float) -> Diagnosis:
    """Return the diagnosis of a machine whose file states these for 0.122 K/W and 8900 J/K."""
    assert HOT.thermal is not None
    thermal = HOT.thermal.model_copy(update={"resistance_k_per_w": resistance, "capacity_j_per_k": capacity})
    case = case_of(HOT.model_copy(update={"thermal": thermal}), columns_of(warm_case()), RunKind.WARMUP)
    return diagnose(case).diagnosis


def test_constants_that_are_a_little_off_are_listed_with_their_share_and_the_machine_is_healthy() -> None:
    found = told(0.113, 8900.0)
    assert found.verdict is Verdict.HEALTHY
    assert found.causes == ()
    moved = {c.name: c for c in found.constants}
    resistance = moved["thermal.resistance_k_per_w"]
    assert resistance.stated == 0.113
    assert resistance.found > 0.113
    assert resistance.deviations >= 1.0
    assert 0.0 < sum(c.closure for c in found.constants) <= 1.0 + 1e-6
    assert "thermal resistance" in found.sentence


def test_constants_that_have_to_be_far_off_are_a_finding_and_no_effect() -> None:
    found = told(0.112, 8200.0)
    assert found.verdict is Verdict.EXPLAINED
    assert found.causes == ()
    assert found.gap.before < 1.3
    assert "further than its uncertainty allows" in found.sentence
    assert max(c.deviations for c in found.constants) > 2.0


def test_as_stated_nothing_is_listed() -> None:
    assert told(0.122, 8900.0).constants == ()


@pytest.mark.parametrize(
    ("constant", "words"),
    [
        (MovedConstant("axes.y.mass_kg", 320.0, 301.0, 2.1, 0.4), "the mass of Y 6 % smaller than stated (2.1 σ)"),
        (MovedConstant("axes.y.mass_kg", 320.0, 301.0, 2.1, 0.01), ""),
        (MovedConstant("thermal.resistance_k_per_w", 0.1, 0.102, 1.2, 0.9), ""),
    ],
)
def test_the_sentence_has_only_what_takes_up_a_part_and_is_far_enough(constant: MovedConstant, words: str) -> None:
    assert said_of((constant,)) == words
