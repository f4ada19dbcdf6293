"""The verdict: what may be said of what was found.

A stage whose gap was hardly closed has no named cause: an effect that explains a half of a gap is more often the next best shape
than the truth. What a healthy twin leaves at worst, each stage knows. A stage whose constants had to move by more than two stated
deviations is explained by them, and not healthy.
"""

from dataclasses import dataclass

import numpy as np

from twin.gap.diagnosis import Effected, Verdict
from twin.gap.search import Explained, without

CHANCE_BLOCKS = 2
NAMED_MIN = 0.6
"""Part of a stage's gap that its causes have to close to be named."""
REMAINDER_MAX = 25.0
"""Floors. Beside a remainder of so many a name means little, whatever it closes."""
OWN_PART, OWN_MIN = 0.7, 0.84
"""Where most of what a cause closes lies, it has to close this much: an effect that is only the next best shape of the true one
leaves a part of it in the same places, where a second gap lies elsewhere."""


@dataclass(frozen=True, slots=True)
class Judged:
    """A stage with its verdict. likeness: what an unknown gap partly looks like."""

    explained: Explained
    verdict: Verdict
    likeness: tuple[Effected, ...]


def judged(explained: Explained) -> Judged:
    """The verdict on one stage."""
    before, after = (e.left.rms_but_worst(CHANCE_BLOCKS) for e in (explained.base, explained.best))
    worst = explained.stage.healthy_rms
    gap_before, gap_after = bool((before > worst).any()), bool((after > worst).any())
    if not explained.best.effects:
        taken_up = Verdict.EXPLAINED if explained.beyond else Verdict.HEALTHY
        return Judged(explained, Verdict.UNKNOWN if gap_before else taken_up, explained.alike or () if gap_before else ())
    if not gap_after:
        return Judged(explained, Verdict.EXPLAINED, ())
    if explained.alike is not None:
        return Judged(explained, Verdict.PARTLY, explained.alike)
    near = bool((after < REMAINDER_MAX).all())
    if near and closed_part(explained) >= NAMED_MIN and closed_where_it_acts(explained) >= OWN_MIN:
        return Judged(explained, Verdict.PARTLY, ())
    return Judged(without(explained), Verdict.UNKNOWN, explained.best.effects)


def closed_part(explained: Explained) -> float:
    """Part of the gap above the floor that is closed, by energy over the floor, all signals together."""
    before, after = (np.sum(np.maximum(e.left.rms() ** 2 - 1.0, 0.0)) for e in (explained.base, explained.best))
    return float(1.0 - after / before) if before > 0.0 else 0.0


def closed_where_it_acts(explained: Explained) -> float:
    """Part of the gap that is closed in those cells (signal × regime) in which most of what was closed lay."""
    count = np.maximum(explained.base.left.cell_counts, 1.0)
    before, after = (e.left.cells - count * (e.left.cells > 0) for e in (explained.base, explained.best))
    before, after = np.maximum(before, 0.0).ravel(), np.maximum(after, 0.0).ravel()
    closed = before - after
    order = np.argsort(-closed)
    enough = np.searchsorted(np.cumsum(closed[order]), OWN_PART * closed[closed > 0].sum()) + 1
    own = order[:enough]
    return float(1.0 - after[own].sum() / before[own].sum()) if before[own].sum() > 0.0 else 0.0


def overall(stages: list[Judged]) -> Verdict:
    """Of the machine: unknown where nothing could be named, partly explained where something could and something could not."""
    verdicts = {s.verdict for s in stages}
    if verdicts <= {Verdict.HEALTHY}:
        return Verdict.HEALTHY
    named = verdicts & {Verdict.EXPLAINED, Verdict.PARTLY}
    if not named:
        return Verdict.UNKNOWN
    return Verdict.EXPLAINED if verdicts <= {Verdict.HEALTHY, Verdict.EXPLAINED} else Verdict.PARTLY
