"""Effects that leave no more than the one that was found: what a few slow signals cannot tell apart stands in one class.

The search fits what its signatures suggest. Where a machine goes through the same cycle again and again, constants take up much
of what an effect does, and a signature says little. So each effect of an answer is replaced by each other candidate, fitted from
the machine as it is stated. One that closes about as much, and leaves no more than a healthy machine's twin does, is not told
from it. One that leaves clearly less takes its place, and so does one that is not told from it where machines are not known to
have the first as large as it would have to be.
"""

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from twin.effects.catalogue import effect_named
from twin.gap.diagnosis import Effected
from twin.gap.evidence import advantage, evidence_of
from twin.gap.fitting import Fitted, fitted, settled
from twin.gap.naming.outlasting import outlasts
from twin.gap.search import CHANCE_BLOCKS, Explained, is_nothing
from twin.gap.stages.free import Form, effect_parameters
from twin.gap.stages.stage import Stage

Floats = NDArray[np.float64]
AS_MUCH = 0.9
"""Part of what the answer closes that its twin has to close."""
BETTER_SIGMAS, BETTER = 2.0, 0.1
"""The certainty, and the floors², by which another effect has to leave less to be the answer."""
STEPS_MAX = 12


def with_twins(stage: Stage, found: Explained) -> Explained:
    """Return the same with all that cannot be told from each of its effects."""
    for effected in found.best.effects:
        instead = [one for c in stage.candidates if (one := instead_of(stage, found, effected, c)) is not None]
        likelier = [f for c, f in instead if _is_clearer(f, found.best)]
        if not likelier and not is_known(found.best, effected):
            known = [f for c, f in instead if is_known(f, c) and leaves_no_more(stage, f, found)]
            likelier = [f for f in known if not _is_clearer(found.best, f)]
        if likelier:
            best = settled(stage, min(likelier, key=lambda f: f.left.excess()), rounds=1)
            rivals = {e: r for e, r in found.rivals.items() if e in best.effects}
            found = replace(found, best=best, rivals=rivals, evidence=evidence_of(stage, found.base, best))
            return with_twins(stage, found)
        twins = tuple(c for c, f in instead if leaves_no_more(stage, f, found))
        before = tuple(e for e in found.rivals.get(effected, ()) if e not in twins)
        found = replace(found, rivals={**found.rivals, effected: (*before, *twins)})
    return found


def instead_of(stage: Stage, found: Explained, effected: Effected, other: Effected) -> tuple[Effected, Fitted] | None:
    """Return the answer with another effect in place of one of its own; None where that comes to nothing."""
    best = found.best
    if other in best.effects:
        return None
    model = best.model.without(effected).with_effect(other)
    constants = np.zeros(len(model.constants))
    place = dict(best.model.places())[effected]
    kept = np.delete(best.theta, np.arange(place.start, place.stop))[len(constants) :]
    fits = [fitted(stage, model, np.concatenate([constants, kept, own]), steps_max=STEPS_MAX) for own in _starts(stage, other)]
    one = min(fits, key=lambda f: f.left_fit.gap())
    if outlasts(stage, other, one.values[other]):
        return None
    moved = np.abs(one.theta[model.size_places(other)]).max(initial=0.0) > 0.0
    return (other, one) if moved and not is_nothing(other, one.values[other]) else None


def _starts(stage: Stage, effected: Effected) -> list[Floats]:
    """θ of an effect to start from: as its file guesses, else its usual size, of either sign where it may have one."""
    free, effect = effect_parameters(effect_named(effected.effect)), effect_named(effected.effect)
    names = [p.name.partition("__")[2] for p in free]
    guesses = stage.first_guesses(effected) or (effect.typical_values(),)
    starts = [
        np.array([p.theta_of(g[n]) if n in g else 0.0 for n, p in zip(names, free, strict=True)], dtype=np.float64)
        for g in guesses
    ]
    signed = [p.form is Form.LINEAR and p.low < 0.0 for p in free]
    if any(signed) and not stage.first_guesses(effected):
        starts += [np.where(signed, -one, one) for one in starts]
    return starts


def is_known(found: Fitted, effected: Effected) -> bool:
    """Return True where machines are known to have an effect as large as it is in a hypothesis."""
    return effect_named(effected.effect).is_known_of(found.values[effected])


def _is_clearer(one: Fitted, best: Fitted) -> bool:
    over = advantage(best.left, one.left)
    return over.sigmas > BETTER_SIGMAS and over.closes > BETTER and one.left_fit.gap() <= best.left_fit.gap() + BETTER


def leaves_no_more(stage: Stage, one: Fitted, found: Explained) -> bool:
    """Return True where a hypothesis leaves what a healthy twin may, and closes about as much as the answer."""
    unseen, seen = one.left.rms_but_worst(CHANCE_BLOCKS), one.left_fit.rms_but_worst(CHANCE_BLOCKS)
    allowed = np.maximum(stage.healthy_rms, found.best.left.rms_but_worst(CHANCE_BLOCKS))
    if bool((unseen > allowed).any() or (seen > max(stage.healthy_rms, float(found.best.left_fit.gap()))).any()):
        return False
    mine, other = (_closed(found.base, f) for f in (found.best, one))
    return mine <= 0.0 or other >= AS_MUCH * mine


def _closed(base: Fitted, found: Fitted) -> float:
    """Return by how much a hypothesis is nearer than the bare machine, in floors² of all signals, on all runs."""
    before, after = (float(np.sum(f.left.rms() ** 2 + f.left_fit.rms() ** 2)) for f in (base, found))
    return before - after
