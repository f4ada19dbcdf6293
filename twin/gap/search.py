"""The search for effects: added to the machine one by one, refitted with its constants, and judged on runs that were not fitted.

    base → screen all candidates by signature → fit those that survive, and those far from linear in any case → take the best
    that a healthy machine would not show → drop what is no longer needed → again, until nothing more is accepted; pairs where no
    single one is

A candidate is accepted where it beats its parent on the judging runs by more sigmas, and takes away more of the gap, than it does
on healthy machines (`twin.gap.null`).
"""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from itertools import combinations

import numpy as np
from numpy.typing import NDArray

from twin.effects.catalogue import effect_named
from twin.effects.effect import On
from twin.gap.diagnosis import Effected
from twin.gap.evidence import Advantage, advantage, evidence_of
from twin.gap.fitting import Fitted, dropped, fitted, settled, with_only, without_effect
from twin.gap.naming.certain import certain_of
from twin.gap.naming.instead import instead_of_constants
from twin.gap.naming.moved import has_to_be_beyond
from twin.gap.naming.outlasting import outlasts
from twin.gap.naming.siblings import only_completes
from twin.gap.naming.stops import stops_are_at_odds
from twin.gap.null import NULL, Null
from twin.gap.screening import Guess, guesses, unexplained
from twin.gap.stages.stage import Model, Stage

Floats = NDArray[np.float64]
SCREENED_MAX = 9
CLOSES_LEAST = 0.02
ROUNDS_MAX = 4
STEPS_FIRST, STEPS_MAX = 6, 14
REFINED = 3
SWAPPED_WITH = 3
SWAP_SIGMAS = 2.0
CHANCE = 6.0
"""Floors², summed over the judged samples, that have to tell one hypothesis from another: a likelihood ratio of 20."""
HARDLY = 0.1
"""Floors² in a signal by which no twin is better than another one: no machine is quite the catalogue's equation."""
THETA_NULL = 1e-4
"""θ below which an effect is null: the fit has taken it away."""
PAIR_GAP = 3.0
PAIRS_OF = 6
CHANCE_BLOCKS = 2
FITTED_WORST = 1.25
"""Factor by which a healthy twin may leave more of the runs that it was fitted to than of another one."""


@dataclass(frozen=True, slots=True, eq=False)
class Tried:
    """A candidate on top of a parent. screened: its score there; found, over: None where it was screened out"""

    effected: Effected
    screened: float
    found: Fitted | None
    over: Advantage | None


@dataclass(frozen=True, slots=True, eq=False)
class Explained:
    """The effects found in a stage.

    base: the machine with its constants refitted; best: with the accepted effects; tried: in the first round, best first
    rivals: effect → what cannot be told from it; evidence: effect → its advantage over the same without it
    beyond: constants of the base have to be further from what is stated than two deviations, and no effect puts them back
    alike: what the remainder partly looks like: effects that were accepted and are not certain (`twin.gap.naming.certain`)
    stops: the axis comes to rest with another torque than the twin's, and no effect was accepted
    notes: sentences on why an effect is not named
    """

    stage: Stage
    base: Fitted
    best: Fitted
    tried: tuple[Tried, ...]
    rivals: dict[Effected, tuple[Effected, ...]]
    evidence: dict[Effected, Advantage]
    beyond: bool = False
    alike: tuple[Effected, ...] = ()
    stops: bool = False
    notes: tuple[str, ...] = ()


def explain(
    stage: Stage,
    *,
    null: Null = NULL,
    progress: Callable[[str], None] = lambda _: None,
    doubtful: bool = False,
    known: Fitted | None = None,
) -> Explained:
    """The effects in a stage.

    doubtful: with those that are not certain beside what is left; known: with effects that were found in a part of it alone
    """
    base = bare_fit(stage)
    best, first = base if known is None else _with_known(stage, base, known, null), tuple[Tried, ...]()
    rivals: dict[Effected, tuple[Effected, ...]] = dict.fromkeys(best.effects, ())
    for number in range(ROUNDS_MAX):
        progress(f"{stage.name}, round {number + 1}")
        if (number or best.effects) and not _gap_left(best, null):
            break
        tried = _tried(stage, best, stage.candidates, null)
        first = first or tried
        accepted = [t for t in tried if _accepted(stage, t, null)]
        if not accepted:
            pair = _pair(stage, best, tried, null) if not number and best.left.gap() > PAIR_GAP else None
            if pair is None:
                break
            best = pair
            continue
        chosen, equals = _chosen(accepted, tried)
        assert chosen.found is not None
        settled_with = settled(stage, chosen.found, rounds=1)
        if best.effects and _is_a_second_name(base, best, settled_with, first):
            break
        rivals[chosen.effected] = equals
        best = _pruned(stage, settled_with, null)
        if len(best.effects) > 1:
            best, as_good = _swapped(stage, best, first)
            rivals |= {e: tuple(dict.fromkeys((*rivals.get(e, ()), *others))) for e, others in as_good.items()}
    beyond = not best.effects and has_to_be_beyond(stage, base)
    if beyond and (instead := instead_of_constants(stage, base)):
        best, beyond = instead[0], False
        rivals[best.effects[0]] = tuple(other.effects[0] for other in instead[1:])
    best, alike = (best, ()) if doubtful else with_certain(stage, base, best, null)
    evidence = evidence_of(stage, base, best)
    stops = not best.effects and stops_are_at_odds(stage, base)
    # what was found beside an effect is no rival of it
    others = {e: tuple(r for r in rivals[e] if r not in best.effects) for e in best.effects if e in rivals}
    return Explained(stage, base, best, first, others, evidence, beyond, alike, stops)


def with_certain(stage: Stage, base: Fitted, best: Fitted, null: Null = NULL) -> tuple[Fitted, tuple[Effected, ...]]:
    """Return the hypothesis with those of its effects that may be named beside what is left, and the others."""
    if not best.effects or not leaves_a_gap(stage, best):
        return best, ()
    certain = certain_of(stage, base, best, null)
    alike = tuple(e for e in best.effects if e not in certain)
    return (with_only(stage, base, best, certain) if alike else best), alike


def leaves_a_gap(stage: Stage, found: Fitted) -> bool:
    """Return True where a hypothesis leaves more than a healthy twin does, but for the worst blocks: those are chance.

    The bare machine has to follow what it was fitted to as well: what comes and goes with time may be in no other run.
    """
    unseen = found.left.rms_but_worst(CHANCE_BLOCKS) > stage.healthy_rms
    seen = found.left_fit.rms_but_worst(CHANCE_BLOCKS) > FITTED_WORST * stage.healthy_rms * _quieter(stage)
    return bool(unseen.any() or (not found.effects and seen.any()))


def _quieter(stage: Stage) -> float:
    """Return by how much the means of repeated runs are quieter than one of them: what a twin leaves of them is not."""
    return max([1.0, *(float(np.nanmedian(o.floor / o.sigma)) for o in stage.observed if o.fitted)])


def _with_known(stage: Stage, base: Fitted, known: Fitted, null: Null) -> Fitted:
    """The machine with the effects of another hypothesis, refitted from there; without those that this stage does not show."""
    places, model, theta = dict(known.model.places()), base.model, base.theta
    for effected in known.effects:
        if effected in stage.candidates:
            model, theta = model.with_effect(effected), np.concatenate([theta, known.theta[places[effected]]])
    if not model.effects:
        return base
    found = settled(stage, fitted(stage, model, theta), rounds=1)
    for effected in found.effects:
        without = without_effect(stage, base, found, effected)
        if not null.exceeded(effected, advantage(without.left, found.left), stage.healthy_rms):
            found = without
    return found


def bare_fit(stage: Stage) -> Fitted:
    """Return the machine with its constants refitted and no effect."""
    bare = Model(stage.constants, ())
    return settled(stage, fitted(stage, bare, bare.null_theta()))


def _gap_left(best: Fitted, null: Null) -> bool:
    return bool((best.left.rms() > null.rms_typical).any())


def _accepted(stage: Stage, tried: Tried, null: Null) -> bool:
    if tried.over is None or tried.found is None or not null.exceeded(tried.effected, tried.over, stage.healthy_rms):
        return False
    return _is_not_null(tried.found, tried.effected)


def _is_not_null(found: Fitted, effected: Effected) -> bool:
    """Return True unless the fit ended where the effect is nothing."""
    moved = bool((np.abs(found.theta[found.model.size_places(effected)]) > THETA_NULL).any())
    return moved and not is_nothing(effected, found.values[effected])


def is_nothing(effected: Effected, values: Mapping[str, float]) -> bool:
    """Return True where a fit ended at nothing: at the null value, or stiffer than the effect's file calls finite."""
    sizes = [p for p in effect_named(effected.effect).parameters if p.null is not None]
    return all(values[p.name] == p.null or (np.isinf(p.null or 0.0) and values[p.name] > p.high) for p in sizes)


def _tried(stage: Stage, parent: Fitted, candidates: tuple[Effected, ...], null: Null) -> tuple[Tried, ...]:
    """All candidates on top of a parent, best first."""
    left = unexplained(stage, parent)
    screened = [guesses(stage, parent, c, left) for c in candidates if c not in parent.effects]
    screened.sort(key=lambda g: -g[0].closes)
    wanted = [g for g in screened if g[0].closes > CLOSES_LEAST][:SCREENED_MAX]
    if _gap_left(parent, null):
        wanted += [g for g in screened if effect_named(g[0].effected.effect).far_from_linear and g not in wanted]
    scale = np.maximum(parent.left_fit.rms(), 1.0)
    fits = {g[0].effected: _best_fit(stage, parent, g, scale) for g in wanted}
    for effected in sorted(fits, key=lambda e: fits[e].left_fit.excess())[: REFINED if len(fits) > 1 else 0]:
        closer = np.maximum(fits[effected].left_fit.rms(), 1.0)
        fits[effected] = fitted(stage, fits[effected].model, fits[effected].theta, scale=closer, steps_max=STEPS_MAX)
    tried = []
    for g in screened:
        found = fits.get(g[0].effected)
        found = None if found is None or outlasts(stage, found.effects[-1], found.values[found.effects[-1]]) else found
        tried.append(Tried(g[0].effected, g[0].closes, found, None if found is None else advantage(parent.left, found.left)))
    return tuple(sorted(tried, key=lambda t: -np.inf if t.over is None else t.over.gain, reverse=True))


def _best_fit(stage: Stage, parent: Fitted, found: tuple[Guess, ...], scale: Floats) -> Fitted:
    """From the best guess, and where the parent's constants were driven to their bounds, from the stated ones as well."""
    model = parent.model.with_effect(found[0].effected)
    one = fitted(stage, model, found[0].theta, scale=scale, steps_max=STEPS_FIRST)
    constants = len(model.constants)
    bounds = np.array([p.high for p in model.constants])
    driven = bool((np.abs(parent.theta[:constants]) > 0.95 * bounds).any())
    if not driven and not (effect_named(found[0].effected.effect).far_from_linear and len(found) > 1):
        return one
    again = (found[1] if len(found) > 1 and not driven else found[0]).theta.copy()
    if driven:
        again[:constants] = 0.0
    other = fitted(stage, model, again, scale=scale, steps_max=STEPS_FIRST)
    return min((one, other), key=lambda f: f.left_fit.excess())


def _chosen(accepted: list[Tried], tried: tuple[Tried, ...]) -> tuple[Tried, tuple[Effected, ...]]:
    """The best one, and what cannot be told from it; among equals the simplest, the machine before its sensors.

    Where samples are few, what was not accepted may follow as well but for chance: it stands beside what was.
    """
    best = max(accepted, key=lambda t: t.over.gain if t.over else 0.0)
    assert best.found is not None and best.over is not None
    half = 0.5 * best.over.closes
    equals = [t for t in accepted if t.found is not None and (t is best or _equal(t.found, best.found))]
    chosen = min(equals, key=_plainness)
    nearly = [t for t in accepted if t not in equals and t.found is not None and _as_a_healthy_twin_may(t.found, best.found)]
    beside = [t for t in tried if t not in accepted and t.found is not None and t.over is not None and t.over.closes > half]
    equals += [*nearly, *(t for t in beside if t.found is not None and _within_chance(t.found, best.found))]
    return chosen, tuple(t.effected for t in sorted(equals, key=_plainness) if t is not chosen)


def _equal(one: Fitted, best: Fitted) -> bool:
    over = advantage(one.left, best.left)
    return _within_chance(one, best) or over.gain < min(max(2.0 * over.error, 0.02), 0.25)


def _as_a_healthy_twin_may(one: Fitted, best: Fitted) -> bool:
    """Return True where a hypothesis leaves hardly more than another one, by what the twin of a healthy machine may leave."""
    return advantage(one.left, best.left).closes < HARDLY


def _within_chance(one: Fitted, best: Fitted) -> bool:
    """Return True where the judged samples are too few to tell the two, as they are where a recording is slow."""
    return float(one.left.squares.sum() - best.left.squares.sum()) < CHANCE


def _plainness(tried: Tried) -> tuple[bool, bool, int, bool, float]:
    """The machine's own before its sensors, and last what no machine is known to have so large, or what a loop acts on: a drive
    does not misread its own command."""
    effect, on = effect_named(tried.effected.effect), tried.effected.on
    unheard_of = tried.found is not None and not effect.is_known_of(tried.found.values[tried.effected])
    in_the_loop = effect.on is On.SIGNAL and on.endswith(("_pos_mm", "_torque_a"))
    unlikely = effect.is_of_measurement or not effect.is_usual_on(on)
    return (in_the_loop, unheard_of, len(effect.parameters), unlikely, -(tried.over.gain if tried.over else 0.0))


def _pair(stage: Stage, parent: Fitted, tried: tuple[Tried, ...], null: Null) -> Fitted | None:
    """Two effects that only help together."""
    front = [t for t in sorted(tried, key=lambda t: -t.screened) if t.found is not None][:PAIRS_OF]
    scale = np.maximum(parent.left_fit.rms(), 1.0)
    best: Fitted | None = None
    for one, other in combinations(front, 2):
        assert one.found is not None and other.found is not None
        model = one.found.model.with_effect(other.effected)
        own = other.found.theta[len(parent.theta) :]
        found = fitted(stage, model, np.concatenate([one.found.theta, own]), scale=scale, steps_max=STEPS_MAX)
        if best is None or found.left.excess() < best.left.excess():
            best = found
    if best is None:
        return None
    over = advantage(parent.left, best.left)
    return best if all(null.exceeded(e, over, stage.healthy_rms) for e in best.effects) else None


def _swapped(stage: Stage, best: Fitted, first: tuple[Tried, ...]) -> tuple[Fitted, dict[Effected, tuple[Effected, ...]]]:
    """With one of its effects replaced by another one that was good alone, where that is better.

    The first that was taken may have been the best single likeness of two. With it: effect → those that are as good in its place.
    """
    others = [t for t in first if t.found is not None and t.effected not in best.effects][:SWAPPED_WITH]
    scale = np.maximum(best.left_fit.rms(), 1.0)
    as_good: dict[Effected, tuple[Effected, ...]] = {}
    for effected in best.effects[:-1]:
        for other in others:
            assert other.found is not None
            model = best.model.without(effected).with_effect(other.effected)
            place = dict(best.model.places())[effected]
            kept = np.delete(best.theta, np.arange(place.start, place.stop))
            own = other.found.theta[dict(other.found.model.places())[other.effected]]  # it may stand on top of known effects
            found = fitted(stage, model, np.concatenate([kept, own]), scale=scale, steps_max=STEPS_FIRST)
            over = advantage(best.left, found.left)
            if not _is_not_null(found, other.effected):
                continue
            if over.sigmas > SWAP_SIGMAS and over.closes > 0.0:
                return settled(stage, found, rounds=1), {}
            if _equal(found, best) or _as_a_healthy_twin_may(found, best):
                as_good[effected] = (*as_good.get(effected, ()), other.effected)
    return best, as_good


def _pruned(stage: Stage, best: Fitted, null: Null) -> Fitted:
    """Without the effects that the others have made needless."""
    for effected in best.effects[:-1]:
        without = dropped(stage, best, effected)
        if not null.exceeded(effected, advantage(without.left, best.left), stage.healthy_rms):
            best = without
    return best


def _is_a_second_name(base: Fitted, before: Fitted, best: Fitted, first: tuple[Tried, ...]) -> bool:
    """Return True where the effect that came last is a second name for what the others explain."""
    alone = next((t.found for t in first if t.effected == best.effects[-1] and t.found is not None), None)
    return alone is not None and only_completes(base.left, before.left, alone.left, best.left)


def without(explained: Explained) -> Explained:
    """The same with nothing accepted."""
    return replace(explained, best=explained.base, rivals={}, evidence={})
