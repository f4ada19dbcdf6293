"""The verdict in a sentence."""

from typing import Any

import pytest

from tests.twin.gap.one_line import OneLine
from twin.gap.diagnosis import (
    Cause,
    Cell,
    Diagnosis,
    Effected,
    GapNumbers,
    Interval,
    Learned,
    MovedConstant,
    Subsystem,
    Verdict,
)
from twin.gap.naming.sentence import sentence_of
from twin.gap.search import explain
from twin.gap.verdict import judged

FRICTION = Cause("direction_friction", "x", 1.0, {"asymmetry": Interval(-0.16, -0.18, -0.14)}, (Effected("gravity", "x"),), 0.77)
MASS = MovedConstant("axes.y.mass_kg", 320.0, 339.0, 2.1, 0.4)
PUSH = Learned("axis_force", "x", "N", ("position",), True, 0.8, 0.7, 0.9, {}, (), "a force on X of +43 N between 118 and 141 mm")
LEFT = Cell("x_torque_a", "acceleration", 0.6, 1.0, 5.0, 1e-6, True, "")
PARTS = (
    Subsystem("x mechanics", (), "x_torque_a", 8.04, 3.0, Verdict.PARTLY, ("direction_friction",)),
    Subsystem("x controller", (), "x_torque_a", 0.9, 0.9, Verdict.HEALTHY),
    Subsystem("y controller", (), "y_torque_a", 0.9, 0.9, Verdict.HEALTHY),
)


def told(verdict: Verdict, **fields: Any) -> Diagnosis:
    none: dict[str, Any] = {"causes": (), "where": (), "where_after": (), "patterns": (), "candidates": (), "notes": ()}
    none |= {"not_observable": (), "not_identifiable": (), "next_experiment": None, "seconds": 1.0}
    gap = GapNumbers(9.0, 8.0, 4.0, 1.0, 0.77, 0.7, 0.8, {})
    return Diagnosis(verdict=verdict, sentence="", gap=gap, **(none | fields))


@pytest.mark.parametrize(
    ("verdict", "fields", "sentence"),
    [
        (Verdict.HEALTHY, {}, "Healthy: with its constants refitted, the twin is 8 × what repeated runs differ by."),
        (
            Verdict.HEALTHY,
            {"constants": (MASS,)},
            "Healthy, with the mass of Y 6 % larger than stated (2.1 σ): the twin is then 8 × what repeated runs differ by.",
        ),
        (
            Verdict.EXPLAINED,
            {"constants": (MASS,)},
            "Explained: the mass of Y 6 % larger than stated (2.1 σ), which is further than its uncertainty allows; no effect "
            "of the catalogue does so better.",
        ),
        (
            Verdict.EXPLAINED,
            {"causes": (FRICTION,), "subsystems": PARTS},
            "Explained: 77 % of the gap comes from direction friction on X (-0.16 ± 0.02; or gravity).",
        ),
        (
            Verdict.PARTLY,
            {"causes": (FRICTION,), "subsystems": PARTS, "learned": (PUSH,), "where_after": (LEFT,)},
            "Partly explained: 77 % of the gap comes from direction friction on X (-0.16 ± 0.02; or gravity); 23 % remains, most "
            "of it in the X torque while it accelerates; X controller healthy; X mechanics 8 × the repeatability, in direction "
            "friction; "
            "described: a force on X of +43 N between 118 and 141 mm.",
        ),
    ],
)
def test_it_has_what_is_certain_what_remains_and_what_was_described(
    verdict: Verdict, fields: dict[str, Any], sentence: str
) -> None:
    assert sentence_of(told(verdict, **fields), ()) == sentence


def test_an_unknown_gap_is_said_with_its_stage_and_its_size() -> None:
    stage = judged(explain(OneLine(bias=2.0, candidates=())))
    sentence = sentence_of(told(Verdict.UNKNOWN, learned=(PUSH,)), (stage,))
    assert sentence.startswith(
        "Unknown: a gap of 8 × the repeatability in one line that no effect of the catalogue explains; described: "
    )


def test_a_gap_in_places_that_no_stage_minds_is_said_without_a_stage() -> None:
    place = Cell("x_torque_a", "reversal", 0.9, 2.0, 6.0, 1e-6, True, "")
    said = sentence_of(told(Verdict.UNKNOWN, where=(place,)), [])
    assert (
        said == "Unknown: a gap of 8 × the repeatability in the X torque at reversals that no effect of the catalogue explains."
    )
