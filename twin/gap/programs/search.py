"""Which effects of the control explain the seconds of recorded programs: sets of them are fitted, and judged on other runs.

All single effects and all pairs are tried, then larger sets on top of the best. Each is fitted to the runs to learn from; its
energy is Σ 2 (√(1 + g²) − 1) over windows of 10 s or more of the runs to be judged on, g the gap of a window in seconds: so an
operator's hand on a knob counts once, and not squared. An effect is needed in a set where the set without it has at least a tenth
more reducible energy (and three thousandths of the whole), and where that is more than a healthy machine would give by chance:

    healthy: what is left of the set, each window's sign drawn again, on top of the set without the effect. A linear fit of the
    effect to that, parameters of one side kept to their side, gains some energy on the runs judged on; p is how often it gains as
    much.

The set with the least energy in which every effect is needed, and told by the runs rather than by a bound, is the answer.
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from itertools import combinations

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import nnls

from twin.effects.catalogue import effect_named
from twin.gap.programs.fit import LONG_WINDOW_S, Fitted, Model, Values, Watched, fit, is_one_sided, small_values
from twin.gap.programs.trial import Trial
from twin.motion.limits import Limits

Floats = NDArray[np.float64]
Names = frozenset[str]

SHORT_WINDOW_S = 1.0
ALL_UP_TO = 2
"""Sets of so many effects are all tried; larger ones add to the best so far, for as long as that needs one more."""
NEEDED = 0.1
STARTS = 2
MATERIAL = 0.003
"""Part of the whole reducible energy below which nothing is named: the fit of a larger effect may be off by as much."""
NOTHING_LEFT = 4.0
"""A set that leaves up to this many times the recorder's own energy needs nothing more."""
SIGNIFICANT = 0.01
"""Level of significance of all candidates together: each is held to its part."""
DRAWS = 999
PROBE = 0.1
NOISE_MOST_S = 3.0
"""Largest remainder of a window that counts as chance."""
AS_WELL = 0.05
"""Part of the resampled runs in which another effect has to be as good to be said not to be told apart."""
AT_BOUND = 1e-3
"""Part of its value by which a parameter may be off a bound and still counts as held there: no run tells it."""
RESAMPLED = 400
RESAMPLED_BLOCK = 5


@dataclass(frozen=True)
class Tried:
    """A set of effects, fitted. gap: (windows,) twin minus recording on the runs judged on, s."""

    names: Names
    fitted: Fitted
    gap: Floats

    @cached_property
    def energy(self) -> Floats:
        """Return the energy of each window, s²."""
        return np.asarray(2.0 * (np.sqrt(1.0 + self.gap**2) - 1.0))


@dataclass(frozen=True)
class Search:
    """The sets tried, the one chosen, and how sure that is.

    p_alone: effect → p of closing so much, alone, on a healthy machine; probability: effect → part of resampled runs in which the
    best set has it; alike: effect of the answer → effects that do as well in its place
    """

    tried: Mapping[Names, Tried]
    chosen: Tried
    floor: float
    p_alone: Mapping[str, float]
    probability: Mapping[str, float]
    alike: Mapping[str, tuple[str, ...]]

    def part(self, names: Names) -> float:
        """Part of the reducible energy that a set closes."""
        none = float(self.tried[frozenset()].energy.sum()) - self.floor
        return 1.0 - (float(self.tried[names].energy.sum()) - self.floor) / none if none > 0.0 else 0.0


def search(
    learnt: Sequence[Trial],
    judged: Sequence[Trial],
    stated: Limits,
    already: Values,
    candidates: Sequence[str],
    rng: np.random.Generator,
    progress: Callable[[str], None],
) -> Search:
    """Tries sets of `candidates` on top of the effects that there are `already`."""
    short = [Watched.of(trial, SHORT_WINDOW_S) for trial in learnt]
    fitted_on, on = ([Watched.of(trial, LONG_WINDOW_S) for trial in trials] for trials in (learnt, judged))
    tried: dict[Names, Tried] = {}

    def attempt(names: Names) -> None:
        """Fit a set, beginning at the two best with one effect less: at one of them an effect may hide what the other shows."""
        if names in tried:
            return
        for name in sorted(names):
            attempt(names - {name})
        smaller = sorted((tried[names - {name}] for name in sorted(names)), key=_total)
        progress(f"time: {' with '.join(sorted(names)) or 'as stated'}")
        near: list[Model | None] = [one.fitted.model for one in smaller[:STARTS]] or [None]
        fitted = min((fit(short, stated, sorted(names), already, model) for model in near), key=lambda one: one.cost)
        tried[names] = Tried(names, fitted, _gaps(on, fitted.model))

    for pair in combinations(candidates, min(ALL_UP_TO, len(candidates))):
        attempt(frozenset(pair))
    attempt(frozenset())
    best = min(tried.values(), key=_total)
    while more := [best.names | {name} for name in candidates if name not in best.names]:
        for names in more:
            attempt(names)
        next_best = min((tried[names] for names in more), key=_total)
        if _total(next_best) > (1.0 - NEEDED) * _total(best):
            break
        best = next_best
    floor = float(sum(_floor_energy(run) for run in on))
    chance = _Chance(fitted_on, on, rng)
    alpha = SIGNIFICANT / max(len(candidates), 1)
    answers = [one for one in tried.values() if _all_needed(one, tried, floor, chance, alpha)]
    chosen = min(answers, key=_total)
    bare = tried[frozenset()]
    p_alone = {name: chance.p(bare, tried[frozenset({name})], chosen.fitted.model) for name in candidates}
    probability, alike = _resampled(tried, chosen, floor, rng)
    return Search(tried, chosen, floor, p_alone, probability, alike)


def _total(one: Tried) -> float:
    return float(one.energy.sum())


def _gaps(runs: Sequence[Watched], model: Model) -> Floats:
    return np.concatenate([run.gap_s(model) for run in runs])


def _floor_energy(run: Watched) -> float:
    """Return the energy of the recorder alone: two ends of each window, each uniform over what lies between two rows."""
    return len(run.recorded_s) * run.trial.resolution_s**2 / 6.0


def _all_needed(one: Tried, tried: Mapping[Names, Tried], floor: float, chance: "_Chance", alpha: float) -> bool:
    """Return whether no effect of a set can be left out."""
    left = float(one.energy.sum())
    for name in sorted(one.names):
        less = tried[one.names - {name}]
        gained = float(less.energy.sum()) - left
        least = max(NEEDED * (gained + left - floor), MATERIAL * (_total(tried[frozenset()]) - floor))
        if gained <= 0.0 or gained < least or gained + left <= NOTHING_LEFT * floor:
            return False
        if chance.p(less, one, one.fitted.model) > alpha or not _is_told(one.fitted, name):
            return False
    return True


def _is_told(fitted: Fitted, name: str) -> bool:
    """Return True where a parameter of an effect is away from nothing with its whole interval, and not held at a bound."""
    intervals = fitted.intervals(name)
    for p in effect_named(name).parameters:
        found = intervals[p.name]
        at_bound = min(abs(found.value - p.low), abs(found.value - p.high)) < AT_BOUND * abs(found.value)
        if p.null is not None and not at_bound and not found.low <= p.null <= found.high:
            return True
    return False


@dataclass(frozen=True)
class _Chance:
    """The gain that an effect has on a healthy machine by chance."""

    learnt: Sequence[Watched]
    judged: Sequence[Watched]
    rng: np.random.Generator

    def p(self, less: Tried, more: Tried, left: Model) -> float:
        """p of gaining as much as `more` does over `less`, one effect less, where nothing but what is `left` is amiss."""
        (name,) = more.names - less.names
        base = less.fitted.model
        columns = [
            np.concatenate([self._slopes(base, name, p, sign, runs) for runs in (self.learnt, self.judged)])
            for p in effect_named(name).parameters
            if p.null is not None
            for sign in ((1.0,) if is_one_sided(p) else (1.0, -1.0))
        ]
        noise = np.concatenate([_gaps(self.learnt, left), _gaps(self.judged, left)])
        return self._part(np.column_stack(columns), np.clip(noise, -NOISE_MOST_S, NOISE_MOST_S), less, more)

    def _slopes(self, base: Model, name: str, p: object, sign: float, runs: Sequence[Watched]) -> Floats:
        """Return what a little of one parameter changes in each window."""
        effect = effect_named(name)
        small = small_values(effect, next(one for one in effect.parameters if one is p), sign * PROBE)
        model = Model(base.stated, {**base.effects, name: small}, base.reference_mm)
        return _gaps(runs, model) - _gaps(runs, base)

    def _part(self, columns: Floats, noise: Floats, less: Tried, more: Tried) -> float:
        seen = float(less.energy.sum() - more.energy.sum())
        learnt = len(noise) - len(less.gap)
        size = np.maximum(np.sqrt(np.sum(columns**2, axis=0)), 1e-12)
        base, triangle = np.linalg.qr(columns[:learnt] / size)
        on = columns[learnt:] / size
        as_much = 0
        for _ in range(DRAWS):
            drawn = noise * self.rng.choice((-1.0, 1.0), len(noise))
            x, _rest = nnls(triangle, -base.T @ drawn[:learnt])
            judged = drawn[learnt:]
            as_much += float(np.sum(judged**2) - np.sum((judged + on @ x) ** 2)) >= seen
        return (1 + as_much) / (1 + DRAWS)


def _resampled(
    tried: Mapping[Names, Tried], chosen: Tried, floor: float, rng: np.random.Generator
) -> tuple[dict[str, float], dict[str, tuple[str, ...]]]:
    """Return how often each effect is in the best set, and what does as well, when blocks of windows are drawn again."""
    sets = list(tried)
    energy = np.array([tried[names].energy for names in sets])
    blocks = np.arange(energy.shape[1]) // RESAMPLED_BLOCK
    by_block = np.array([np.bincount(blocks, row) for row in energy])
    drawn = rng.integers(0, by_block.shape[1], (RESAMPLED, by_block.shape[1]))
    sums = np.stack([by_block[:, one].sum(axis=1) for one in drawn])
    score = np.log(np.maximum(sums - floor, 1e-3 * floor + 1e-9)) + NEEDED * np.array([len(names) for names in sets])
    best = np.argmin(score, axis=1)
    every = sorted(set().union(*sets))
    probability = {name: float(np.mean([name in sets[k] for k in best])) for name in every}
    mine = sums[:, sets.index(chosen.names)]

    def does_as_well(name: str, other: str) -> bool:
        instead = chosen.names - {name} | {other}
        return instead in tried and bool(np.mean(sums[:, sets.index(instead)] <= (1.0 + NEEDED) * mine) > AS_WELL)

    others = [name for name in every if name not in chosen.names]
    alike = {name: tuple(other for other in others if does_as_well(name, other)) for name in sorted(chosen.names)}
    return probability, alike
