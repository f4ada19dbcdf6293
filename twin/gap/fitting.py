"""Fits a hypothesis to the runs that may be learned from, and keeps what it leaves on those it is judged on."""

from collections.abc import Mapping
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from twin.effects.catalogue import effect_named
from twin.gap.descent import Bounds, descend
from twin.gap.diagnosis import Effected
from twin.gap.free import Form, Free, effect_parameters
from twin.gap.stage import Model, Observed, Stage

Floats = NDArray[np.float64]
Ints = NDArray[np.intp]
TOLERANCE = 1e-4
STEP_PROBE = 1e-3


@dataclass(frozen=True, slots=True, eq=False)
class Left:
    """What a fitted hypothesis leaves on the runs that judge it, in floors.

    squares: (blocks, signals) sums of the squared residual over floor²; counts: (blocks, signals) samples
    """

    signals: tuple[str, ...]
    squares: Floats
    counts: Floats

    def rms(self) -> Floats:
        """By signal, (signals,); 0 where there is no sample."""
        return np.asarray(np.sqrt(self.squares.sum(axis=0) / np.maximum(self.counts.sum(axis=0), 1.0)))

    def gap(self) -> float:
        """Of all signals: rms over the floor, each signal counted alike."""
        there = self.counts.sum(axis=0) > 0
        return float(np.sqrt(np.mean(self.rms()[there] ** 2))) if there.any() else 0.0

    def excess(self) -> float:
        """Σ ln(rms/floor) over the signals, each at least 0: how many factors of e there are to close."""
        return float(np.sum(np.log(np.maximum(self.rms(), 1.0))))


@dataclass(frozen=True, eq=False)
class Fitted:
    """A hypothesis at its best. known: (p,) part of what is known of θ that comes from the recordings, 0 to 1."""

    model: Model
    theta: Floats
    covariance: Floats
    known: Floats
    left: Left
    left_fit: Left
    evaluations: int

    @property
    def effects(self) -> tuple[Effected, ...]:
        """The effects in it."""
        return self.model.effects

    @cached_property
    def values(self) -> dict[Effected, dict[str, float]]:
        """The parameters of each effect."""
        return {e: {k: float(v[0]) for k, v in p.items()} for e, p in self.model.values(self.theta[None, :]).items()}


def left_by(stage: Stage, model: Model, theta: Floats, *, fitted: bool) -> Left:
    """What the hypothesis at θ leaves on the runs that are fitted, or on those that are not."""
    signals = tuple(dict.fromkeys(s for o in stage.observed for s in o.signals))
    squares, counts = [], []
    for number, observed in enumerate(stage.observed):
        if observed.fitted is fitted:
            residual = (stage.predict(model, theta[None, :], number)[0] - observed.measured) / observed.floor
            if fitted:  # the mean of repeated runs is quieter than one of them
                residual = residual * observed.floor / observed.sigma
            one, count = _by_block(observed, residual, signals)
            squares.append(one)
            counts.append(count)
    if not squares:
        return Left(signals, np.zeros((0, len(signals))), np.zeros((0, len(signals))))
    return Left(signals, np.concatenate(squares), np.concatenate(counts))


def _by_block(observed: Observed, residual: Floats, signals: tuple[str, ...]) -> tuple[Floats, Floats]:
    known = np.isfinite(residual)
    _, block = np.unique(observed.block, return_inverse=True)
    column = np.array([signals.index(s) for s in observed.signals])[observed.signal]
    shape = (int(block.max()) + 1 if len(block) else 0, len(signals))
    place = block[known] * len(signals) + column[known]
    squares = np.bincount(place, weights=residual[known] ** 2, minlength=shape[0] * shape[1]).reshape(shape)
    counts = np.bincount(place, minlength=shape[0] * shape[1]).reshape(shape).astype(np.float64)
    return squares, counts


def fitted(
    stage: Stage,
    model: Model,
    start: Floats,
    *,
    tolerance: float = TOLERANCE,
    scale: Floats | None = None,
    steps_max: int = 30,
) -> Fitted:
    """The hypothesis fitted from θ = `start`.

    scale: (signals,) factors on the noise of each signal, where the parent leaves more than noise; keeps signals in proportion
    """
    runs = [i for i, o in enumerate(stage.observed) if o.fitted]
    scales = [_scales(stage.observed[i], stage, scale) for i in runs]

    def residuals(theta: Floats) -> Floats:
        parts = []
        for i, widened in zip(runs, scales, strict=True):
            observed = stage.observed[i]
            away = np.nan_to_num((stage.predict(model, theta, i) - observed.measured) / (observed.sigma * widened))
            parts.append(_averaged(away, stage.averaged))
        return np.concatenate(parts, axis=1)

    free = model.free
    bounds = Bounds(*(np.array([getattr(p, key) for p in free]) for key in ("sigma", "low", "high")))
    first, blocks = 0, []
    for i in runs:
        blocks.append(_kept(stage.observed[i].block, stage.averaged) + first)
        first = int(blocks[-1].max()) + 1
    found = descend(residuals, bounds, np.concatenate(blocks), start, steps_max=steps_max, tolerance=tolerance)
    return Fitted(
        model,
        found.theta,
        found.covariance,
        found.known,
        left_by(stage, model, found.theta, fitted=False),
        left_by(stage, model, found.theta, fitted=True),
        found.evaluations,
    )


def _averaged(residual: Floats, count: int) -> Floats:
    """Sums of `count` neighbours over √count, so that a residual of noise stays one of noise; (lanes, n // count)."""
    if count == 1:
        return residual
    whole = residual.shape[1] // count * count
    return np.asarray(residual[:, :whole].reshape(len(residual), -1, count).sum(axis=2) / np.sqrt(count))


def _kept(block: Ints, count: int) -> Ints:
    return block[: len(block) // count * count : count] if count > 1 else block


def _scales(observed: Observed, stage: Stage, scale: Floats | None) -> Floats:
    if scale is None:
        return np.ones(len(observed.measured))
    signals = tuple(dict.fromkeys(s for o in stage.observed for s in o.signals))
    return scale[np.array([signals.index(s) for s in observed.signals])][observed.signal]


def sensitivities(stage: Stage, parent: Fitted) -> list[Floats]:
    """Slopes of what is shown over the free numbers of a hypothesis, in σ, (n, p), for each run that is fitted."""
    count = len(parent.theta)
    moves = STEP_PROBE * np.eye(count)
    both = np.concatenate([parent.theta + moves, parent.theta - moves])
    found = []
    for i, observed in enumerate(stage.observed):
        if observed.fitted:
            shown = stage.predict(parent.model, both, i) / observed.sigma
            found.append(np.nan_to_num((shown[:count] - shown[count:]).T / (2.0 * STEP_PROBE)))
    return found


@dataclass(frozen=True, slots=True, eq=False)
class Guess:
    """A start for an effect. closes: part of the residual's energy that it would take away, were it linear."""

    effected: Effected
    theta: Floats
    closes: float


def guesses(stage: Stage, parent: Fitted, effected: Effected, slopes: list[Floats]) -> tuple[Guess, ...]:
    """Where to start the parameters of an effect, best first (screening by signature).

    Each linear parameter is tried at the size that machines show, with the sensitivities of the parent projected out; angles by a
    pair of signatures a quarter of a turn apart; shapes and what is infinite where it is not, over a grid.
    """
    model = parent.model.with_effect(effected)
    free = effect_parameters(effect_named(effected.effect))
    suggested = stage.first_guesses(effected)
    linear = [] if suggested else [i for i, p in enumerate(free) if p.form is Form.LINEAR and not p.is_angle]
    angle = next((i for i, p in enumerate(free) if p.is_angle), None)
    turns = (0.0, np.pi / 2) if angle is not None else (0.0,)
    shapes = [_theta(free, s) for s in suggested] or _shapes(free)
    probes = [(shape, i, turn) for shape in shapes for i in (linear or [None]) for turn in turns]
    offset = len(parent.theta)
    theta = np.tile(np.concatenate([parent.theta, np.zeros(len(free))]), (len(probes) + 1, 1))
    for row, (shape, i, turn) in enumerate(probes, start=1):
        theta[row, offset:] = shape
        if i is not None:
            theta[row, offset + i] = min(1.0, free[i].high)
        if angle is not None:
            theta[row, offset + angle] = turn
    residual, signature = _signatures(stage, model, theta, slopes, parent)
    found, together = [], len(linear or [None]) * len(turns)
    low, high = (
        np.concatenate([np.full(offset, bound), [getattr(p, key) for p in free]])
        for bound, key in ((-np.inf, "low"), (np.inf, "high"))
    )
    for first in range(0, len(probes), together):
        columns = signature[:, first : first + together]
        guess = theta[first + 1].copy()
        amplitude = np.ones(together)
        if linear:
            gram = columns.T @ columns
            ridge = 1e-9 * np.eye(together) * max(float(np.trace(gram)), 1e-12)
            amplitude = np.linalg.solve(gram + ridge, columns.T @ residual)
            _place(guess, amplitude, offset, linear, angle, theta[first + 1 : first + 1 + together])
        left = residual - columns @ amplitude
        closes = 1.0 - float(np.sum(left**2) / max(np.sum(residual**2), 1e-12))
        found.append(Guess(effected, np.clip(guess, low, high), closes))
    return tuple(sorted(found, key=lambda g: -g.closes))


def _place(guess: Floats, amplitude: Floats, offset: int, linear: list[int], angle: int | None, probes: Floats) -> None:
    if angle is None:
        for a, i, probe in zip(amplitude, linear, probes, strict=True):
            guess[offset + i] = a * probe[offset + i]
        return
    along, across = amplitude[:2]
    guess[offset + linear[0]] = np.hypot(along, across) * probes[0][offset + linear[0]]
    guess[offset + angle] = np.arctan2(across, along)


def _signatures(stage: Stage, model: Model, theta: Floats, slopes: list[Floats], parent: Fitted) -> tuple[Floats, Floats]:
    """Residual (n,) and what each probe changes (n, probes), with what the parent's free numbers can do about it projected out.

    Constants may not go far from what the machine states, so moves of three of their deviations cost as much as the residual.
    """
    residuals, signatures, moves = [], [], []
    for i, slope in zip([i for i, o in enumerate(stage.observed) if o.fitted], slopes, strict=True):
        observed = stage.observed[i]
        shown = stage.predict(model, theta, i)
        residual = np.nan_to_num((observed.measured - shown[0]) / observed.sigma)
        weight = 1.0 / np.sqrt(1.0 + (residual / 20.0) ** 2)
        residuals.append(residual * weight)
        signatures.append(np.nan_to_num((shown[1:] - shown[0]).T / observed.sigma[:, None]) * weight[:, None])
        moves.append(slope * weight[:, None])
    residual = np.concatenate(residuals)
    deviation = np.array([p.sigma for p in parent.model.free])
    cost = np.linalg.norm(residual) / 3.0 / deviation
    basis, _ = np.linalg.qr(np.concatenate([*moves, np.diag(cost)]))
    probes = theta.shape[0] - 1
    both = np.zeros((len(residual) + len(deviation), 1 + probes))
    both[: len(residual), 0], both[len(residual) :, 0] = residual, -cost * parent.theta
    both[: len(residual), 1:] = np.concatenate(signatures)
    both -= basis @ (basis.T @ both)
    return both[:, 0], both[:, 1:]


def _theta(free: tuple[Free, ...], values: Mapping[str, float]) -> Floats:
    """θ of an effect's parameters, given by their own names; the rest 0."""
    names = [p.name.partition("__")[2] for p in free]
    return np.array([p.theta_of(values[n]) if n in values else 0.0 for n, p in zip(names, free, strict=True)])


def _shapes(free: tuple[Free, ...]) -> list[Floats]:
    """θ of the parameters that have no linear part, over a grid; the rest 0."""
    grid = [np.zeros(len(free))]
    for i, p in enumerate(free):
        if p.form is Form.INVERSE:
            values = [0.15, 0.5, 1.5]
        elif p.name.endswith("__order"):
            values = [p.theta_of(n) for n in (1.0, 2.0, 3.0, 4.0, 6.0, 8.0, 12.0, 24.0)]
        elif p.form is Form.FACTOR:
            values = [v for v in (-1.4, 0.0, 1.4) if p.low <= v <= p.high]
        else:
            continue
        grid = [np.where(np.arange(len(free)) == i, v, g) for g in grid for v in values]
    return grid


def settled(stage: Stage, parent: Fitted, rounds: int = 3) -> Fitted:
    """The hypothesis fitted until another fit gains nothing: a parent that has not converged lets any child win."""
    scale = np.maximum(parent.left_fit.rms(), 1.0)
    for _ in range(rounds):
        again = fitted(stage, parent.model, parent.theta, scale=scale)
        if parent.left_fit.excess() - again.left_fit.excess() < 1e-3:
            return again if again.left_fit.excess() < parent.left_fit.excess() else replace(parent, covariance=again.covariance)
        parent, scale = again, np.maximum(again.left_fit.rms(), 1.0)
    return parent
