"""Names that stand beside a remainder: an effect is certain where it takes away what no free-form term takes as well.

Asked of each effect E that was accepted, where something is left. M₀ is the hypothesis without E, M_E with it, M_F with a learned
term F at a site where it could mimic E in place of E, M_EF with both. E is certain where

* it does as well as the best F with fewer numbers, and leaves next to nothing where it acts (M₀ → M_E); or
* it is not much behind F, and all effects together close most of the stage and next to all where they act; or
* beside F it takes away most of what it takes alone, surely, and leaves next to nothing where it acts then (M_F → M_EF).

An effect that is only the next best shape of the true one leaves a part in the same places, and a free-form term does better. One
of a sensor changes all that its signal shows, and so fits a little of anything: it must not be surely behind F at all.
"""

import numpy as np

from twin.effects.catalogue import effect_named
from twin.gap.diagnosis import Effected
from twin.gap.evidence import advantage
from twin.gap.fitting import Fitted, Left, without_effect
from twin.gap.learned.learnable import Learnable
from twin.gap.learned.search import free_form, refitted_beside
from twin.gap.naming.siblings import above
from twin.gap.null import Null
from twin.gap.stages.stage import Stage
from twin.learned.words import LearnedSite
from twin.sites import Site

NAMED_MIN = 0.6
"""Part of a stage's gap that its causes have to close to be named where they are somewhat behind a free-form term."""
REMAINDER_MAX = 25.0
"""Floors. Beside a remainder of so many a name means little, whatever it closes."""
OWN_PART, OWN_MIN = 0.7, 0.84
"""Share of what a cause closes that makes up its own cells, and the part of those that it has to close: the next best shape of
the true one leaves a part in the same places, where a second gap lies elsewhere."""
AS_WELL, NEARLY = 0.95, 0.7
"""Part of what the best free-form term closes that an effect has to close: with fewer numbers alone, and with NAMED_MIN."""
ITS_OWN, SIGMAS = 0.5, 3.0
"""Part of what it takes alone that an effect has to take beside a free-form term, and how surely."""
COMPETITORS = 2
S = LearnedSite
MIMICS = {
    Site.REFERENCE: (S.CONTROLLER, S.AXIS_FORCE, S.POSITION_READING),
    Site.CONTROLLER: (S.CONTROLLER, S.AXIS_FORCE, S.TORQUE_READING),
    Site.DRIVE_FORCE: (S.AXIS_FORCE, S.CONTROLLER, S.TORQUE_READING),
    Site.FRICTION: (S.FRICTION, S.AXIS_FORCE),
    Site.MECHANICS: (S.AXIS_FORCE, S.FRICTION, S.TABLE_POSITION, S.TABLE_READING),
    Site.PROCESS_FORCE: (S.CUT_FORCE, S.FORCE_READING),
    Site.SPINDLE: (S.SPINDLE_POWER,),
    Site.THERMAL: (S.HEAT_INPUT, S.HEAT_LOSS, S.TEMPERATURE_READING),
}
"""Site of an effect → the sites where a learned term could do what it does; of sensors and clocks: all."""


def certain_of(stage: Stage, base: Fitted, best: Fitted, null: Null) -> tuple[Effected, ...]:
    """Return the effects of a hypothesis that leaves something which may be named in spite of it."""
    if not bool((best.left.rms() < REMAINDER_MAX).all()):
        return ()
    most = closed_part(base.left, best.left) >= NAMED_MIN and closed_where_it_acts(base.left, best.left) >= OWN_MIN
    return tuple(e for e in best.effects if _is_certain(stage, base, best, e, most, null))


def _is_certain(stage: Stage, base: Fitted, best: Fitted, effected: Effected, most: bool, null: Null) -> bool:
    parent = without_effect(stage, base, best, effected)
    taken = above(parent.left) - above(best.left)
    clean = closed_where_it_acts(parent.left, best.left) >= OWN_MIN
    if taken <= 0.0:
        return False
    if not isinstance(stage, Learnable):
        return most
    shaped = free_form(stage, parent, sites=MIMICS.get(effect_named(effected.effect).site), null=null)
    behind = max((above(parent.left) - above(one.found.left) for one in shaped), default=0.0)
    if effect_named(effected.effect).is_of_measurement:
        if clean and not any(advantage(best.left, one.found.left).sigmas > SIGMAS for one in shaped):
            return True
    elif (clean and taken >= AS_WELL * behind) or (most and taken >= NEARLY * behind):
        return True
    return bool(shaped) and all(_takes_its_own(stage, best, one.found, effected, taken, null) for one in shaped[:COMPETITORS])


def _takes_its_own(stage: Stage, best: Fitted, competitor: Fitted, effected: Effected, taken: float, null: Null) -> bool:
    """Return True where the effect beside the free-form term takes most of what it takes alone."""
    beside = refitted_beside(stage, best, competitor.model.terms[-1])
    over = advantage(competitor.left, beside.left)
    enough = above(competitor.left) - above(beside.left) >= ITS_OWN * taken
    surely = over.sigmas > SIGMAS and null.exceeded(effected, over, stage.healthy_rms)
    return enough and surely and closed_where_it_acts(competitor.left, beside.left) >= OWN_MIN


def closed_part(before: Left, after: Left) -> float:
    """Part of the gap above the floor that is closed, by energy over the floor, all signals together."""
    return 1.0 - above(after) / above(before) if above(before) > 0.0 else 0.0


def closed_where_it_acts(one: Left, other: Left) -> float:
    """Part of the gap that is closed in those cells (signal × regime) in which most of what was closed lay."""
    count = np.maximum(one.cell_counts, 1.0)
    before, after = (left.cells - count * (left.cells > 0) for left in (one, other))
    before, after = np.maximum(before, 0.0).ravel(), np.maximum(after, 0.0).ravel()
    closed = before - after
    order = np.argsort(-closed)
    enough = np.searchsorted(np.cumsum(closed[order]), OWN_PART * closed[closed > 0].sum()) + 1
    own = order[:enough]
    return float(1.0 - after[own].sum() / before[own].sum()) if before[own].sum() > 0.0 else 0.0
