"""The verdict: what may be said of what was found.

A stage whose gap was hardly closed has no named cause: an effect that explains a half of a gap is more often the next best shape
than the truth. What a healthy twin leaves at worst, each stage knows.
"""

from dataclasses import dataclass

import numpy as np

from twin.gap.diagnosis import Effected, Verdict
from twin.gap.search import Explained, without

NAMED_MIN = 0.6
"""Part of a stage's gap that its causes have to close to be named."""


@dataclass(frozen=True, slots=True)
class Judged:
    """A stage with its verdict. likeness: what an unknown gap partly looks like."""

    explained: Explained
    verdict: Verdict
    likeness: tuple[Effected, ...]


def judged(explained: Explained) -> Judged:
    """The verdict on one stage."""
    before, after = (e.left.rms() for e in (explained.base, explained.best))
    worst = explained.stage.healthy_rms
    gap_before, gap_after = bool((before > worst).any()), bool((after > worst).any())
    if not explained.best.effects:
        return Judged(explained, Verdict.UNKNOWN if gap_before else Verdict.HEALTHY, ())
    if not gap_after:
        return Judged(explained, Verdict.EXPLAINED, ())
    if closed_part(explained) >= NAMED_MIN:
        return Judged(explained, Verdict.PARTLY, ())
    return Judged(without(explained), Verdict.UNKNOWN, explained.best.effects)


def closed_part(explained: Explained) -> float:
    """Part of the gap above the floor that is closed, by energy over the floor, all signals together."""
    before, after = (np.sum(np.maximum(e.left.rms() ** 2 - 1.0, 0.0)) for e in (explained.base, explained.best))
    return float(1.0 - after / before) if before > 0.0 else 0.0


def overall(stages: list[Judged]) -> Verdict:
    """Of the machine: unknown where nothing could be named, partly explained where something could and something could not."""
    verdicts = {s.verdict for s in stages}
    if verdicts <= {Verdict.HEALTHY}:
        return Verdict.HEALTHY
    named = verdicts & {Verdict.EXPLAINED, Verdict.PARTLY}
    if not named:
        return Verdict.UNKNOWN
    return Verdict.EXPLAINED if verdicts <= {Verdict.HEALTHY, Verdict.EXPLAINED} else Verdict.PARTLY
