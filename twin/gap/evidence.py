"""Compares two hypotheses by what they leave on runs that neither was fitted to.

    T = Σ_signals ln(rms_A / rms_B),   positive where B follows the machine better

A sum of logarithms lets each signal speak in proportion, whatever its floor, as a likelihood with unknown noise does. Its
standard error is a delete-one jackknife over time blocks, so neighbouring samples don't count as independent evidence.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from twin.gap.diagnosis import Effected
from twin.gap.fitting import Fitted, Left, without_effect
from twin.gap.stages.stage import Stage

Floats = NDArray[np.float64]
RMS_LEAST = 0.05
TOLD_LEAST = 0.5
"""Floors below which one rms is as good as another where it is asked how sure an advantage is: there blocks differ by chance."""


@dataclass(frozen=True, slots=True)
class Advantage:
    """The advantage of one hypothesis over another.

    gain: T; error: its standard error; closes: largest decrease of a signal's mean square, in floors²
    share: of the gap above the floor that is gone, in the signal where most is; told: T over its standard error without what is
        below half a floor
    """

    gain: float
    error: float
    closes: float
    share: float
    told: float = -np.inf

    @property
    def sigmas(self) -> float:
        """T over its standard error."""
        return max(self.gain / max(self.error, 1e-6), self.told)


def advantage(one: Left, other: Left) -> Advantage:
    """Return the advantage of `other` over `one`; over the blocks that both have."""
    there = one.counts.sum(axis=0) > 0
    if not there.any():
        return Advantage(0.0, 1.0, 0.0, 0.0)
    blocks = np.flatnonzero(one.counts.sum(axis=1) > 0)
    a, b, n = one.squares[blocks][:, there], other.squares[blocks][:, there], one.counts[blocks][:, there]
    total = np.array([a.sum(axis=0), b.sum(axis=0)])
    samples = n.sum(axis=0)
    fewer = np.maximum(samples - n, 1.0)

    def jackknifed(least: float) -> tuple[float, float]:
        whole = _log_ratio(total[0], total[1], samples, least)
        left_out = _log_ratio(total[0] - a, total[1] - b, fewer, least)
        count = len(blocks)
        error = np.sqrt((count - 1) / count * np.sum((left_out - left_out.mean()) ** 2)) if count > 1 else np.inf
        return float(whole), float(error)

    gain, error = jackknifed(RMS_LEAST)
    above_half, its_error = jackknifed(TOLD_LEAST)
    decrease = (total[0] - total[1]) / samples
    best = int(np.argmax(decrease))
    above = float(total[0][best] / samples[best]) - 1.0
    share = float(decrease[best]) / above if above > 0.0 else 0.0
    return Advantage(gain, error, float(decrease[best]), share, above_half / max(its_error, 1e-6))


def _log_ratio(one: Floats, other: Floats, samples: Floats, least: float) -> Floats:
    one, other = (np.maximum(squares / samples, least**2) for squares in (one, other))
    return np.asarray(0.5 * np.sum(np.log(one / other), axis=-1))


def evidence_of(stage: Stage, base: Fitted, best: Fitted) -> dict[Effected, Advantage]:
    """Return each effect of a hypothesis with its advantage over the same hypothesis without it."""
    return {e: advantage(without_effect(stage, base, best, e).left, best.left) for e in best.effects}
