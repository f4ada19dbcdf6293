"""Learned terms are described with figures and place, and stand in the twin."""

import numpy as np

from tests.twin.gap.learned.pushed import healthy_stage, refitted, stage_with
from tests.twin.gap.small_case import MACHINE
from twin.gap.diagnosis import Verdict
from twin.gap.learned.answer import described_stages, learned_of, with_learned
from twin.gap.search import Explained
from twin.gap.stages.axis import AxisStage
from twin.gap.verdict import Judged
from twin.learned.words import LearnedSite

AT_MM = np.linspace(0.0, 45.0, 31)


def _judged(stage: AxisStage, verdict: Verdict) -> Judged:
    base = refitted(stage)
    return Judged(Explained(stage, base, base, (), {}, {}), verdict, ())


def test_a_rough_place_is_described_and_closed() -> None:
    stage = stage_with(LearnedSite.FRICTION, {"position_mm": AT_MM}, lambda x: 200.0 * np.exp(-(((x - 15.0) / 4.0) ** 2)))
    described = described_stages([_judged(stage, Verdict.UNKNOWN)])
    first = learned_of(described)[0]
    assert (first.site, first.on, first.unit, first.depends_on) == ("friction", "z", "N", ("position",))
    assert first.repeats
    assert first.closure > 0.9
    assert first.closure_low <= first.closure <= first.closure_high
    assert first.sentence.startswith("an additional friction on Z of +")
    assert "in both directions and in all runs" in first.sentence
    twin = with_learned(MACHINE, described)
    assert [section.site for section in twin.learned][:1] == [LearnedSite.FRICTION]


def test_a_stage_that_is_explained_is_not_asked() -> None:
    assert described_stages([_judged(healthy_stage(), Verdict.HEALTHY)]) == ()
