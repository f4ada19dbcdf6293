"""Effects whose evidence is specific: each takes away most of what would be left of some signal without it.

Beside a remainder that nothing in the catalogue explains, an effect may take a little away because its shape is a little like the
remainder's, and it may be the only thing that has the shape that it takes away. The first says nothing, the second is certain
whatever else is left. An effect is dropped, and the others fitted again without it, unless in the signal in which it does most

    (m₀ − m₁) / (m₀ − 1) ≥ SHARE_MIN   and   m₀ − m₁ ≥ CLOSES_MIN,

m₀ and m₁ being the mean squares, in floors², that are left on unseen runs without it and with it. An effect of a sensor changes
all that its signal shows, and so fits a little of anything: it is named only where nothing is left.
"""

from dataclasses import replace

from twin.effects.catalogue import effect_named
from twin.gap.diagnosis import Effected
from twin.gap.evidence import evidence_of
from twin.gap.fitting import without_effect
from twin.gap.search import Explained
from twin.gap.stages.stage import Stage

SHARE_MIN = 0.6
CLOSES_MIN = 2.0


def only_specific(stage: Stage, found: Explained) -> Explained:
    """The same with none but specific effects, and the others among what the remainder looks like."""
    alike = list(found.alike)
    while vague := {e: over for e, over in found.evidence.items() if not _is_specific(stage, found, e)}:
        worst = min(vague, key=lambda e: vague[e].gain)
        alike.append(worst)
        best = without_effect(stage, found.base, found.best, worst)
        evidence = evidence_of(stage, found.base, best)
        rivals = {e: r for e, r in found.rivals.items() if e in evidence}
        found = replace(found, best=best, evidence=evidence, rivals=rivals)
    return replace(found, alike=tuple(alike))


def _is_specific(stage: Stage, found: Explained, effected: Effected) -> bool:
    over = found.evidence[effected]
    if over.share < SHARE_MIN or over.closes < CLOSES_MIN:
        return False
    return not effect_named(effected.effect).is_of_measurement or bool((found.best.left.rms() <= stage.healthy_rms).all())
