"""Screens candidates by their signatures: what each would change in what is shown, beside what is left to be explained.

    s = f(θ, φ) − f(θ, 0),   score = 1 − ‖r − S a‖² / ‖r‖²,   with what the parent's free numbers can do projected out of r and S

Cheap, and only good for choosing what to fit and where to start: an effect is never judged by its signature.
"""

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from twin.effects.catalogue import effect_named
from twin.gap.diagnosis import Effected
from twin.gap.fitting import Fitted
from twin.gap.stages.free import Form, Free, effect_parameters
from twin.gap.stages.stage import Model, Stage

Floats = NDArray[np.float64]
STEP_PROBE = 1e-3


def sensitivities(stage: Stage, parent: Fitted) -> list[Floats]:
    """Slopes of what is shown over the free numbers of a hypothesis, in σ, (n, p), for each run that is fitted."""
    count = len(parent.theta)
    if not count:
        return [np.zeros((len(o.measured), 0)) for o in stage.observed if o.fitted]
    low, high = (np.array([getattr(p, key) for p in parent.model.free]) for key in ("low", "high"))
    up, down = (np.minimum(parent.theta + STEP_PROBE, high), np.maximum(parent.theta - STEP_PROBE, low))
    both = np.concatenate([parent.theta + np.diag(end - parent.theta) for end in (up, down)])
    found = []
    for i, observed in enumerate(stage.observed):
        if observed.fitted:
            shown = stage.predict(parent.model, both, i) / observed.sigma
            found.append(np.nan_to_num((shown[:count] - shown[count:]).T / np.maximum(up - down, 1e-12)))
    return found


@dataclass(frozen=True, slots=True, eq=False)
class Unexplained:
    """The residual of a hypothesis on the runs that are fitted, with what its own free numbers can do about it projected out.

    weights: (n,) of each run; shown: (n,) of each run; basis: orthonormal, of those free numbers; residual: projected, (n + p,)
    """

    weights: tuple[Floats, ...]
    shown: tuple[Floats, ...]
    basis: Floats
    residual: Floats

    def projected(self, signatures: Floats) -> Floats:
        """Return signatures, (n, probes), projected likewise, (n + p, probes)."""
        whole = np.zeros((len(self.residual), signatures.shape[1]))
        whole[: len(signatures)] = signatures
        return np.asarray(whole - self.basis @ (self.basis.T @ whole))


def unexplained(stage: Stage, parent: Fitted) -> Unexplained:
    """Return what a hypothesis leaves unexplained.

    Constants may not go far from what the machine states, so moves of three of their deviations cost as much as the residual.
    """
    residuals, weights, shows, moves = [], [], [], []
    runs = [i for i, o in enumerate(stage.observed) if o.fitted]
    for i, slope in zip(runs, sensitivities(stage, parent), strict=True):
        observed = stage.observed[i]
        shown = stage.predict(parent.model, parent.theta[None, :], i)[0]
        residual = np.nan_to_num((observed.measured - shown) / observed.sigma)
        weight = np.isfinite(observed.measured) / np.sqrt(1.0 + (residual / 20.0) ** 2)
        residuals.append(residual * weight)
        weights.append(weight)
        shows.append(shown)
        moves.append(slope * weight[:, None])
    left = np.concatenate(residuals)
    cost = np.linalg.norm(left) / 3.0 / np.array([p.sigma for p in parent.model.free])
    basis, _ = np.linalg.qr(np.concatenate([*moves, np.diag(cost)]))
    whole = np.concatenate([left, -cost * parent.theta])
    return Unexplained(tuple(weights), tuple(shows), basis, whole - basis @ (basis.T @ whole))


@dataclass(frozen=True, slots=True, eq=False)
class Guess:
    """A start for an effect. closes: part of the residual's energy that it would take away, were it linear."""

    effected: Effected
    theta: Floats
    closes: float


def guesses(stage: Stage, parent: Fitted, effected: Effected, left: Unexplained) -> tuple[Guess, ...]:
    """Return where to start the parameters of an effect, best first.

    Each linear parameter is tried at the size that machines show, with the sensitivities of the parent projected out; an angle by
    two signatures 90° apart; shapes, and what is infinite where there is no effect, over a grid. A size that
    the recordings suggest is started from as it is, and counts with the part of it that fits best.
    """
    free = effect_parameters(effect_named(effected.effect))
    suggested = stage.first_guesses(effected)
    linear = [] if suggested else [i for i, p in enumerate(free) if p.form is Form.LINEAR and not p.is_angle]
    angle = next((i for i, p in enumerate(free) if p.is_angle), None)
    together = max(len(linear), 1) * (1 if angle is None else 2)
    shapes = [_theta(free, s) for s in suggested] or _shapes(free)
    own = np.concatenate([_probes(shape, free, linear, angle) for shape in shapes])
    offset = len(parent.theta)
    theta = np.concatenate([np.tile(parent.theta, (len(own), 1)), own], axis=1)
    residual, signature = left.residual, left.projected(_signatures(stage, parent.model.with_effect(effected), theta, left))
    low, high = (np.array([getattr(p, key) for p in free]) for key in ("low", "high"))
    found: list[tuple[float, Guess]] = []
    for first in range(0, len(own), together):
        columns, guess = signature[:, first : first + together], theta[first].copy()
        amplitude: Floats = np.ones(together)
        if linear:
            gram = columns.T @ columns
            ridge = 1e-9 * np.eye(together) * max(float(np.trace(gram)), 1e-12)
            amplitude = np.asarray(np.linalg.solve(gram + ridge, columns.T @ residual), dtype=np.float64)
            _place(guess, amplitude, offset, linear, angle, theta[first : first + together])
        rest = residual - columns @ amplitude
        guess[offset:] = np.clip(guess[offset:], low, high)
        energy = max(float(np.sum(residual**2)), 1e-12)
        closes = as_it_is = 1.0 - float(np.sum(rest**2)) / energy
        if suggested:
            along, across = float(columns[:, 0] @ residual), float(columns[:, 0] @ columns[:, 0])
            part = min(max(along, 0.0) / max(across, 1e-300), 1.0)
            closes = part * (2.0 * along - part * across) / energy
        found.append((as_it_is, Guess(effected, guess, closes)))
    return tuple(guess for _, guess in sorted(found, key=lambda one: -one[0]))


def _probes(shape: Floats, free: tuple[Free, ...], linear: list[int], angle: int | None) -> Floats:
    """θ of the effect for each signature that is needed at one shape, (signatures, parameters)."""
    probes = []
    for i in linear or [-1]:
        for turn in (0.0,) if angle is None else (0.0, np.pi / 2):
            one = shape.copy()
            if i >= 0:
                one[i] = min(1.0, free[i].high)
            if angle is not None:
                one[angle] = turn
            probes.append(one)
    return np.array(probes)


def _place(guess: Floats, amplitude: Floats, offset: int, linear: list[int], angle: int | None, probes: Floats) -> None:
    if angle is None:
        for a, i, probe in zip(amplitude, linear, probes, strict=True):
            guess[offset + i] = a * probe[offset + i]
        return
    along, across = amplitude[:2]
    guess[offset + linear[0]] = np.hypot(along, across) * probes[0][offset + linear[0]]
    guess[offset + angle] = np.arctan2(across, along)


def _signatures(stage: Stage, model: Model, theta: Floats, left: Unexplained) -> Floats:
    """Return the change that each probe makes, (n, probes), weighted as the residual is."""
    runs = [i for i, o in enumerate(stage.observed) if o.fitted]
    parts = [
        np.nan_to_num((stage.predict(model, theta, i) - shown).T / stage.observed[i].sigma[:, None]) * weight[:, None]
        for i, shown, weight in zip(runs, left.shown, left.weights, strict=True)
    ]
    return np.concatenate(parts)


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
