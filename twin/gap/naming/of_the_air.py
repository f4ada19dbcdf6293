"""A gap that the air at a spindle makes by itself: nothing is named for it.

In plain production the air at the spindle differs from that at the thermometer by the floor of the temperature, now more and now
less, from hour to hour. However many readings there are of n hours, they are n draws of it and no more, so that a healthy twin
leaves up to

    √(χ²(n) / n)   floors

of them, and whatever warms or cools a little takes that away. In less than an hour a spindle does not follow its air so far.
"""

from dataclasses import replace

import numpy as np
from scipy.stats import chi2

from twin.gap.diagnosis import Effected
from twin.gap.evidence import evidence_of
from twin.gap.fitting import Fitted, Left, without_effect
from twin.gap.floors import AIR_K
from twin.gap.search import Explained
from twin.gap.stages.heat import HeatStage

CHANCE = 0.02
"""Part of healthy machines that leave more."""
HOUR_S = 3600.0


def unless_of_the_air(stage: HeatStage, found: Explained) -> Explained:
    """Return the same without the effects without which nothing is left but what the air may do."""
    in_production = all(float(np.nanmedian(observed.floor)) >= AIR_K for observed in stage.observed)
    while in_production and (needless := _needless(stage, found)) is not None:
        effected, best = needless
        evidence = evidence_of(stage, found.base, best)
        rivals = {e: r for e, r in found.rivals.items() if e in evidence}
        notes = (*found.notes, f"{effected} is not named: the air at the spindle may do as much from hour to hour")
        alike = (*found.alike, effected)
        found = replace(found, best=best, rivals=rivals, evidence=evidence, alike=alike, notes=notes)
    return found


def _needless(stage: HeatStage, found: Explained) -> tuple[Effected, Fitted] | None:
    """Return an effect that the air may stand for, the one that closes least, and the hypothesis without it; None without any."""
    without = [(e, without_effect(stage, found.base, found.best, e)) for e in found.best.effects]
    enough = [(e, one) for e, one in without if _may_be_air(stage, one.left)]
    return min(enough, key=lambda pair: pair[1].left.gap(), default=None)


def _may_be_air(stage: HeatStage, left: Left) -> bool:
    judging = [run for run in stage.runs if not run.fitted] or stage.runs
    hours = sum(float(part.at_s[-1] - part.at_s[0]) for run in judging for part in run.parts) / HOUR_S
    return hours >= 1.0 and bool((left.rms() <= np.sqrt(chi2.isf(CHANCE, hours) / hours)).all())
