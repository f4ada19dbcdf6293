"""The place of a truth file on the machine's clock: cross-correlation of what both have seen.

Normalised over the samples that both have at each lag (Padfield 2012, IEEE Trans. Image Process. 21(5)). An offset stands where
its correlation is far from chance, for as many lags as were tried, and no other offset away from it comes close: a part that is
made again and again fits itself every cycle. n samples of two series that forget with integral times τ₁ and τ₂ are worth
n (1/τ₁ + 1/τ₂) pairs that are independent (Bartlett 1935, for exponential memories).
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.fft import irfft, next_fast_len, rfft

from cnctwin.validation.track import Grid, Track, averaged, held
from twin.gap.significance import correlation_time

Floats = NDArray[np.float64]
R_MIN = 0.5
RIVAL_MAX = 0.95
"""The share of the best one that a rival may reach."""
Z_MIN = 5.0
OVERLAP_MIN = 0.5
SAMPLES_MIN = 20
CHANGES = "changes of "
"""Looked at beside the signals themselves: a spindle that starts once makes a slow signal, which fits many places."""


@dataclass(frozen=True, slots=True)
class Clock:
    """offset_s: to be added to times of the truth; r: correlation there; rival: the best one elsewhere; by: what was compared"""

    offset_s: float
    r: float
    rival: float
    by: str


@dataclass(frozen=True, slots=True, eq=False)
class Pair:
    """The same thing, as the truth has seen it and as the machine or its twin tells it."""

    by: str
    truth: Track
    other: Track


def placed(pairs: Sequence[Pair], from_s: float, to_s: float, every_s: float, reach_s: tuple[float, float]) -> Clock | str:
    """The offset by the pair that tells it best, within `reach_s`; why there is none."""
    tried = [_placed(pair, Grid.over(from_s, to_s, every_s), reach_s, of) for pair in pairs for of in ("", CHANGES)]
    found = [one for one in tried if isinstance(one, tuple)]
    if not found:
        why = "; ".join(str(one) for one in tried) or "it has no signal that the machine or its twin tells too"
        return f"the truth's clock cannot be placed: {why}"
    return max(found, key=lambda one: one[0])[1]


def _placed(pair: Pair, grid: Grid, reach_s: tuple[float, float], of: str) -> tuple[float, Clock] | str:
    from_s, every_s = grid.from_s, grid.every_s
    own_s = float(pair.truth.t_s[0])
    own = Grid.over(own_s, float(pair.truth.t_s[-1]) + every_s, every_s)
    truth, other = _filled(pair.truth, own, every_s), _filled(pair.other, grid, every_s)
    by = f"{of}{pair.by}"
    if of == CHANGES:
        truth, other = np.diff(truth, prepend=np.nan), np.diff(other, prepend=np.nan)
    least = max(SAMPLES_MIN, int(OVERLAP_MIN * min(np.isfinite(truth).sum(), np.isfinite(other).sum())))
    lags, r, overlap = correlations(truth, other, least)
    offsets = lags * every_s + from_s - own_s
    inside = np.isfinite(r) & (offsets >= reach_s[0] - every_s) & (offsets <= reach_s[1] + every_s)
    if not inside.any():
        return f"{by}: both report too little of it, or it does not change"
    r = np.where(inside, r, -np.inf)
    best = int(np.argmax(r))
    peak = float(r[best])
    left = best - int(np.argmax(r[best::-1] < 0.5 * peak)) if (r[best::-1] < 0.5 * peak).any() else 0
    right = best + int(np.argmax(r[best:] < 0.5 * peak)) if (r[best:] < 0.5 * peak).any() else len(r) - 1
    away = np.concatenate([r[:left], r[right + 1 :]])
    rival = float(max(away.max(initial=-1.0), -1.0))
    pieces = float(overlap[best]) * min(1.0, 1.0 / _time(truth) + 1.0 / _time(other))
    z = float(np.arctanh(min(peak, 0.999999)) * np.sqrt(max(pieces - 3.0, 0.0)))
    if peak < R_MIN or z < Z_MIN:
        return f"{by}: the best correlation is {peak:.2f}, over {pieces:.0f} independent pieces"
    if rival > RIVAL_MAX * peak:
        return (
            f"{by}: two offsets fit equally well ({peak:.3f} and {rival:.3f}), as with a series of equal parts; "
            "give t_s in seconds since 1970"
        )
    return z, Clock(float(offsets[best]) + every_s * _between(r, best), peak, rival, by)


def _between(r: Floats, best: int) -> float:
    """Vertex of the parabola through the peak and its neighbours, in lags."""
    if not 0 < best < len(r) - 1 or not np.isfinite(r[best - 1 : best + 2]).all():
        return 0.0
    before, peak, after = r[best - 1 : best + 2].tolist()
    bend = before - 2.0 * peak + after
    return 0.0 if bend >= 0.0 else float(np.clip(0.5 * (before - after) / bend, -0.5, 0.5))


def _filled(track: Track, grid: Grid, every_s: float) -> Floats:
    """Window means; where a window is empty, what was told last, for ten windows."""
    means = averaged(track, grid)
    return np.where(np.isfinite(means), means, held(track, grid, 10.0 * every_s))


def _time(series: Floats) -> float:
    known = np.isfinite(series)
    return correlation_time(np.where(known, series - np.mean(series[known]), 0.0))


def correlations(truth: Floats, other: Floats, least: int) -> tuple[Floats, Floats, Floats]:
    """Lags (m,), correlation r (m,), samples in common (m,), truth[i] beside other[i + lag]; r is NaN where there is too little.

    >>> other = np.random.default_rng(1).standard_normal(500)
    >>> lags, r, _ = correlations(other[100:300], other, 50)
    >>> int(lags[np.nanargmax(r)])
    100
    """
    count = len(truth) + len(other) - 1
    size = next_fast_len(count, real=True)
    there, known = np.isfinite(truth), np.isfinite(other)
    one = np.where(there, truth - np.mean(truth[there]) if there.any() else 0.0, 0.0)
    two = np.where(known, other - np.mean(other[known]) if known.any() else 0.0, 0.0)

    def crossed(a: Floats, b: Floats) -> Floats:
        product = irfft(np.conj(rfft(a, size)) * rfft(b, size), size)
        return np.asarray(np.concatenate([product[size - len(truth) + 1 :], product[: len(other)]]))

    mask, other_mask = there.astype(np.float64), known.astype(np.float64)
    n = np.rint(crossed(mask, other_mask))
    many = np.maximum(n, 1.0)
    sum_one, sum_two = crossed(one, other_mask), crossed(mask, two)
    square_one = crossed(one**2, other_mask) - sum_one**2 / many
    square_two = crossed(mask, two**2) - sum_two**2 / many
    scale = np.sqrt(np.maximum(square_one, 0.0) * np.maximum(square_two, 0.0))
    # a stretch that does not change has no correlation: what is left of it is rounding
    least_square = 1e-9 * float(np.sqrt((one**2).sum() * (two**2).sum()))
    enough = (n >= least) & (scale > least_square)
    r = np.where(enough, (crossed(one, two) - sum_one * sum_two / many) / np.where(enough, scale, 1.0), np.nan)
    return np.arange(-(len(truth) - 1), len(other), dtype=np.float64), np.clip(r, -1.0, 1.0), n
