"""Effects of the cut that a low pass of the dynamometer shows as well: they are not named.

A helix smooths the entry of the tooth, and so does a filter whose cut-off is near the harmonics of the tooth passing. An effect
is kept where it takes away on unseen runs what no low pass in its place takes away, by as much as it has to take to be named.
"""

from dataclasses import replace

import numpy as np

from twin.effects.catalogue import effect_named
from twin.gap.diagnosis import Effected
from twin.gap.dynamometer.low_pass import LowPass
from twin.gap.evidence import Advantage, advantage, evidence_of
from twin.gap.fitting import Fitted, dropped, without_effect
from twin.gap.null import Null
from twin.gap.search import Explained
from twin.gap.stages.turns import TurnStage

FLATTEST = 0.71
CLOSER = (1.26, 1.26, 1.12, 1.06)
"""Damping with the flattest pass band, which is tried first, and the steps from there; those of the damping are twice as long."""
CUTOFFS = 7
PASSINGS = (0.5, 8.0)
"""Cut-offs that are tried, over the frequency of the tooth passing: below, no tooth is seen; above, all that is kept passes."""


def told_from_a_filter(stage: TurnStage, found: Explained, null: Null) -> Explained:
    """Return the same without the effects that a low pass of both forces shows as well, and a note on each."""
    for effected in found.best.effects:
        if not effect_named(effected.effect).shows_only_fast:
            continue
        over, low_pass = _next_best(stage, found.best, effected)
        if null.exceeded(effected, over, stage.healthy_rms):
            continue
        best = without_effect(stage, found.base, found.best, effected)
        evidence = evidence_of(stage, found.base, best)
        rivals = {e: r for e, r in found.rivals.items() if e in evidence}
        note = (
            f"{effected} is not named: a low pass of both forces at about {low_pass.half_power_hz:.0f} Hz, in the dynamometer "
            "or behind it, shows the same; a recording without the filter, or at a lower speed of the spindle, tells them apart"
        )
        alike, notes = (*found.alike, effected), (*found.notes, note)
        found = replace(found, best=best, evidence=evidence, rivals=rivals, alike=alike, notes=notes)
    return found


def _next_best(stage: TurnStage, best: Fitted, effected: Effected) -> tuple[Advantage, LowPass]:
    """Return the low pass that does best in place of an effect, and the advantage of the effect over it."""

    def over(low_pass: LowPass) -> Advantage:
        return advantage(dropped(replace(stage, low_pass=low_pass), best, effected).left, best.left)

    speeds = [stretch.cut.rpm for run in stage.runs for stretch in run.stretches]
    cutoffs = float(np.median(speeds)) / 60.0 * stage.teeth * np.geomspace(*PASSINGS, CUTOFFS)
    tried = [(over(one), one) for one in (LowPass(float(cutoff), FLATTEST) for cutoff in cutoffs)]
    for step in CLOSER:
        _, at = min(tried, key=lambda one: one[0].gain)
        steps = ((step, 1.0), (1.0 / step, 1.0), (1.0, step**2), (1.0, step**-2))
        tried += [(over(one), one) for one in (LowPass(at.cutoff_hz * f, at.damping * d) for f, d in steps)]
    return min(tried, key=lambda one: one[0].gain)
