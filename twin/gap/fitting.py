"""Fits a hypothesis to the runs that may be learned from, and keeps what it leaves on those it is judged on."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from twin.gap.descent import STEP, Bounds, Minimum, descend
from twin.gap.diagnosis import Effected
from twin.gap.stages.stage import Model, Observed, Stage, Stepped

Floats = NDArray[np.float64]
Ints = NDArray[np.intp]
TOLERANCE = 1e-4
REGIMES_MAX = 8
STEPS_WITHOUT = 14


@dataclass(frozen=True, slots=True, eq=False)
class Left:
    """The gap that a fitted hypothesis leaves on the runs that judge it, in floors.

    squares: (blocks, signals) sums of the squared residual over floor²; counts: (blocks, signals) samples
    cells: (signals, regimes) sums of the squared residual over floor²; cell_counts: (signals, regimes) samples
    """

    signals: tuple[str, ...]
    squares: Floats
    counts: Floats
    cells: Floats
    cell_counts: Floats

    def rms(self) -> Floats:
        """By signal, (signals,); 0 where there is no sample."""
        return np.asarray(np.sqrt(self.squares.sum(axis=0) / np.maximum(self.counts.sum(axis=0), 1.0)))

    def rms_but_worst(self, blocks: int) -> Floats:
        """By signal, without its worst few blocks: how an axis comes to rest once is chance, a gap shows again and again."""
        order = np.argsort(self.squares, axis=0)[: max(len(self.squares) - blocks, 1)]
        squares, counts = (np.take_along_axis(v, order, axis=0).sum(axis=0) for v in (self.squares, self.counts))
        return np.asarray(np.sqrt(squares / np.maximum(counts, 1.0)))

    def gap(self) -> float:
        """Return the gap of all signals: rms over the floor, each signal counted alike."""
        there = self.counts.sum(axis=0) > 0
        return float(np.sqrt(np.mean(self.rms()[there] ** 2))) if there.any() else 0.0

    def excess(self) -> float:
        """Σ ln(rms/floor) over the signals, each at least 0: how many factors of e there are to close."""
        return float(np.sum(np.log(np.maximum(self.rms(), 1.0))))


@dataclass(frozen=True, eq=False)
class Fitted:
    """A hypothesis at its best. minimum: the end of its descent; again: of another one from there, None where there was none."""

    model: Model
    theta: Floats
    minimum: Minimum
    left: Left
    left_fit: Left
    again: Minimum | None = None

    @property
    def covariance(self) -> Floats:
        """Covariance of θ, (p, p)."""
        return (self.again or self.minimum).covariance

    @property
    def known(self) -> Floats:
        """Part of what is known of θ that comes from the recordings, (p,), 0 to 1."""
        return self.minimum.known

    @property
    def effects(self) -> tuple[Effected, ...]:
        """The effects in it."""
        return self.model.effects

    @cached_property
    def values(self) -> dict[Effected, dict[str, float]]:
        """The parameters of each effect."""
        return {e: {k: float(v[0]) for k, v in p.items()} for e, p in self.model.values(self.theta[None, :]).items()}


def left_by(stage: Stage, model: Model, theta: Floats, *, fitted: bool) -> Left:
    """Return what the hypothesis at θ leaves on the runs that are fitted, or on the others; where there are none, on the
    fitted."""
    return lefts_by(stage, model, theta[None, :], fitted=fitted)[0]


def lefts_by(stage: Stage, model: Model, theta: Floats, *, fitted: bool) -> tuple[Left, ...]:
    """The same at each row of θ, (lanes, p)."""
    judging = any(not o.fitted and np.isfinite(o.measured).any() for o in stage.observed)
    runs = [i for i, o in enumerate(stage.observed) if o.fitted is (fitted or not judging)]
    shown = {i: stage.predict(model, theta, i) for i in runs}
    return tuple(_left(stage, {i: lanes[lane] for i, lanes in shown.items()}, fitted) for lane in range(len(theta)))


def _left(stage: Stage, shown: dict[int, Floats], fitted: bool) -> Left:
    """Return the remainder of a hypothesis. shown: number of the run → (n,)"""
    signals = tuple(dict.fromkeys(s for o in stage.observed for s in o.signals))
    squares, counts = [], []
    cells, cell_counts = np.zeros((len(signals), REGIMES_MAX)), np.zeros((len(signals), REGIMES_MAX))
    for number, observed in enumerate(stage.observed):
        if number in shown:
            residual = (shown[number] - observed.measured) / observed.floor
            if fitted:  # the mean of repeated runs is quieter than one of them
                residual = residual * np.maximum(observed.floor / observed.sigma, 1.0)
            one, count = _by_block(observed, residual, signals)
            squares.append(one)
            counts.append(count)
            known = np.isfinite(residual)
            where = (np.array([signals.index(s) for s in observed.signals])[observed.signal][known], observed.regime[known])
            np.add.at(cells, where, residual[known] ** 2)
            np.add.at(cell_counts, where, 1.0)
    if not squares:
        return Left(signals, np.zeros((0, len(signals))), np.zeros((0, len(signals))), cells, cell_counts)
    return Left(signals, np.concatenate(squares), np.concatenate(counts), cells, cell_counts)


def _by_block(observed: Observed, residual: Floats, signals: tuple[str, ...]) -> tuple[Floats, Floats]:
    known = np.isfinite(residual)
    _, block = np.unique(observed.block, return_inverse=True)
    column = np.array([signals.index(s) for s in observed.signals])[observed.signal]
    shape = (int(block.max()) + 1 if len(block) else 0, len(signals))
    place = block[known] * len(signals) + column[known]
    squares = np.bincount(place, weights=residual[known] ** 2, minlength=shape[0] * shape[1]).reshape(shape).astype(np.float64)
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
    sampled = [_sampled(stage.observed[i]) for i in runs]
    averaged = stage.averaged

    def apart(shown: Callable[[Model, Floats, int], Floats], theta: Floats, unsure: Sequence[float]) -> Floats:
        parts = []
        for i, widened, there, more in zip(runs, scales, sampled, unsure, strict=True):
            observed = stage.observed[i]
            sigma = (np.hypot(observed.sigma, more) * widened)[there]
            parts.append(
                _averaged(np.nan_to_num((shown(model, theta, i)[:, there] - observed.measured[there]) / sigma), averaged)
            )
        return np.concatenate(parts, axis=1)

    def residuals(theta: Floats) -> Floats:
        return apart(stage.predict, theta, [0.0] * len(runs))

    free = model.free
    bounds = Bounds(*(np.array([getattr(p, key) for p in free]) for key in ("sigma", "low", "high")))
    first, blocks = 0, []
    for i, there in zip(runs, sampled, strict=True):
        blocks.append(_kept(stage.observed[i].block[there], averaged) + first)
        first = int(blocks[-1].max()) + 1
    found = descend(
        residuals,
        bounds,
        np.concatenate(blocks),
        start,
        steps_max=steps_max,
        tolerance=tolerance,
        slope_step=max((stage.observed[i].slope_step for i in runs), default=STEP),
    )
    if isinstance(stage, Stepped) and any(steps := [stage.step_of(i) / np.sqrt(12.0) for i in runs]):
        unrounded = stage.unrounded
        found = replace(found, told=lambda theta: apart(unrounded, theta, steps))
    return Fitted(
        model,
        found.theta,
        found,
        left_by(stage, model, found.theta, fitted=False),
        left_by(stage, model, found.theta, fitted=True),
    )


def _averaged(residual: Floats, count: int) -> Floats:
    """Sums of `count` neighbours over √count, so that a residual of noise stays one of noise; (lanes, n // count)."""
    if count == 1:
        return residual
    whole = residual.shape[1] // count * count
    return np.asarray(residual[:, :whole].reshape(len(residual), -1, count).sum(axis=2) / np.sqrt(count))


def _sampled(observed: Observed) -> Ints:
    """Places at which there is a sample; all of them where there is none, so that a fit has something to go by."""
    there = np.flatnonzero(np.isfinite(observed.measured))
    return there if len(there) else np.arange(len(observed.measured))


def _kept(block: Ints, count: int) -> Ints:
    return block[: len(block) // count * count : count] if count > 1 else block


def _scales(observed: Observed, stage: Stage, scale: Floats | None) -> Floats:
    if scale is None:
        return np.ones(len(observed.measured))
    signals = tuple(dict.fromkeys(s for o in stage.observed for s in o.signals))
    return np.asarray(scale[np.array([signals.index(s) for s in observed.signals])][observed.signal])


def settled(stage: Stage, parent: Fitted, rounds: int = 3) -> Fitted:
    """The hypothesis fitted until another fit gains nothing: a parent that has not converged lets any child win."""
    scale = np.maximum(parent.left_fit.rms(), 1.0)
    for _ in range(rounds):
        again = fitted(stage, parent.model, parent.theta, scale=scale)
        if parent.left_fit.excess() - again.left_fit.excess() < 1e-3:
            return again if again.left_fit.excess() < parent.left_fit.excess() else replace(parent, again=again.minimum)
        parent, scale = again, np.maximum(again.left_fit.rms(), 1.0)
    return parent


def without_effect(stage: Stage, base: Fitted, best: Fitted, effected: Effected) -> Fitted:
    """Return a hypothesis without one of its effects, refitted; `base`, the machine with none, where it was the only one."""
    return base if len(best.effects) == 1 else dropped(stage, best, effected)


def dropped(stage: Stage, best: Fitted, effected: Effected) -> Fitted:
    """Return a hypothesis without one of its effects, refitted on a stage that may be another one than its own."""
    place = dict(best.model.places())[effected]
    theta = np.delete(best.theta, np.arange(place.start, place.stop))
    scale = np.maximum(best.left_fit.rms(), 1.0)
    return fitted(stage, best.model.without(effected), theta, scale=scale, steps_max=STEPS_WITHOUT)


def with_only(stage: Stage, base: Fitted, best: Fitted, kept: tuple[Effected, ...]) -> Fitted:
    """Return a hypothesis with only some of its effects, refitted; `base` where none is kept."""
    for effected in best.effects if kept else ():
        if effected not in kept:
            best = without_effect(stage, base, best, effected)
    return best if kept else base
