"""Chatter: the axial depth up to which a milling cut is stable, by spindle speed (the zero-order stability lobes).

The equations are in twin/process/oriented.py: at a chatter frequency ω the oriented response has two eigenvalues λ(ω), and each
with Re λ > 0 is a limit b = 1 / (K_t Re λ) at the tooth periods T = (π + 2 arg λ + 2πk) / ω. Speed n = 60 / (N T).

Two questions are answered without walking over the chart. The limit at a speed: of the frequencies at which ωT − π − 2 arg λ is
a whole number of turns, the one with the largest Re λ. The speeds at a depth: where Re λ ≥ 1 / (K_t b), ω runs over ranges; each
with each k covers one interval of T that is unstable, and what they leave is stable. No pocket is too narrow to be found.

What zero order does not know: see docs/explanation/chatter.md.
"""

import math
from collections.abc import Iterator, Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from twin.errors import TwinError
from twin.machine import Mode
from twin.process.oriented import ChatterCut, Floats, Ints, Oriented

__all__ = ["ChatterCut", "depth_limit_mm", "stable_speeds"]

PERIODS_AT_A_TIME = 32
CORRECTIONS = 4
FINER = 4
FALSI = 8
LOBES_AT_A_TIME = 2000


def depth_limit_mm(modes: Sequence[Mode], cut: ChatterCut, spindle_rpm: ArrayLike) -> Floats:
    """Axial depth up to which every cut is stable at each of the speeds, (speeds,) mm; inf where no depth is unstable.

    One mode, across the feed of a slot with 4 teeth of K_e = 0.4 (A0 = −0.8 there): at no speed less than
    4 ζ (1 + ζ) k / (0.8 K_t) = 0.9067 mm, and far more in the pocket where a tooth follows at each wave (7500 rev/min: 500 Hz).

    >>> mode = Mode(direction="y", frequency_hz=500.0, damping_ratio=0.02, stiffness_n_per_mm=8000.0)
    >>> cut = ChatterCut(4, 900.0, 0.4, 0.0, math.pi)
    >>> depth_limit_mm([mode], cut, [5000.0, 7500.0]).round(2).tolist()
    [1.64, 14.42]

    Raises TwinError where a speed is not above 0.
    """
    speeds = np.atleast_1d(np.asarray(spindle_rpm, dtype=np.float64))
    for speed in speeds[~(speeds > 0.0)]:
        raise TwinError(f"spindle_rpm has {speed}; a speed at which a cut can chatter is above 0")
    limit = np.full(len(speeds), math.inf)
    if not modes or not len(speeds):
        return limit
    period = 60.0 / (cut.teeth * speeds)
    oriented = Oriented.of(modes, cut, float(period.min()))
    cells = _Cells.of(oriented)
    if len(cells.gain):
        gain = _largest_gain(oriented, cells, period)
        np.divide(1.0 / cut.tangential_coefficient_n_per_mm2, gain, out=limit, where=gain > 0.0)
    return limit


def stable_speeds(
    modes: Sequence[Mode], cut: ChatterCut, depth_mm: float, low_rpm: float, high_rpm: float
) -> tuple[tuple[float, float], ...]:
    """The intervals of speed from low to high in which this depth and any smaller one is stable; ends good to 0.1 rev/min.

    Two modes may leave a depth stable above one that chatters; it does not count, for a tool goes through the smaller one first.

    >>> mode = Mode(direction="y", frequency_hz=500.0, damping_ratio=0.02, stiffness_n_per_mm=8000.0)
    >>> cut = ChatterCut(4, 900.0, 0.4, 0.0, math.pi)
    >>> [(round(a), round(b)) for a, b in stable_speeds([mode], cut, 2.0, 3000.0, 12000.0)]
    [(3143, 3912), (5133, 8135)]
    >>> stable_speeds([], cut, 2.0, 3000.0, 12000.0)
    ((3000.0, 12000.0),)

    Raises TwinError where the range is none.
    """
    if not 0.0 < low_rpm <= high_rpm < math.inf:
        raise TwinError(f"speeds from {low_rpm} to {high_rpm} rev/min are no range; it has to begin above 0 and end no lower")
    unstable: list[tuple[float, float]] = []
    if modes and depth_mm > 0.0:
        factor = 60.0 / cut.teeth
        oriented = Oriented.of(modes, cut, factor / high_rpm)
        level = max(1.0 / (cut.tangential_coefficient_n_per_mm2 * depth_mm), oriented.least_gain())
        for branch in (0, 1):
            for frequency in _ranges(oriented, branch, level):
                phase = math.pi + 2.0 * np.angle(oriented.exact(branch, frequency))
                for shortest, longest in _unstable_periods(frequency, phase, factor / low_rpm):
                    unstable.append((factor / longest, factor / shortest))
    return _left_over(unstable, low_rpm, high_rpm)


class _Cells(NamedTuple):
    """Pieces of both branches between two nodes, where a part of them has Re λ > 0. Each (cells, 1) but the branch, (cells,).

    frequency, phase (ε), gain (Re λ): at the end where the gain is larger; steps: what must be added to be at the other
    """

    branch: Ints
    frequency: Floats
    phase: Floats
    gain: Floats
    frequency_step: Floats
    phase_step: Floats
    gain_step: Floats

    @classmethod
    def of(cls, oriented: Oriented) -> "_Cells":
        frequency = np.broadcast_to(oriented.frequency_rad_s, oriented.eigenvalue.shape)
        phase = math.pi + 2.0 * np.unwrap(np.angle(oriented.eigenvalue))
        gain = oriented.eigenvalue.real
        rising = gain[:, 1:] >= gain[:, :-1]
        chosen = np.maximum(gain[:, 1:], gain[:, :-1]) > oriented.least_gain()
        tops = [np.where(rising, v[:, 1:], v[:, :-1])[chosen][:, None] for v in (frequency, phase, gain)]
        feet = [np.where(rising, v[:, :-1], v[:, 1:])[chosen][:, None] for v in (frequency, phase, gain)]
        return cls(np.nonzero(chosen)[0], *tops, *(foot - top for foot, top in zip(feet, tops, strict=True)))


def _largest_gain(oriented: Oriented, cells: _Cells, period_s: Floats) -> Floats:
    """The largest Re λ at which (ωT − ε) / 2π is a whole number, (periods,); 0 where there is none.

    The best cell of each period is found on straight lines; its frequency is then corrected on the exact response.
    """
    best, share, slope = (np.empty(len(period_s), dtype=t) for t in (np.int64, np.float64, np.float64))
    for first in range(0, len(period_s), PERIODS_AT_A_TIME):
        some = slice(first, first + PERIODS_AT_A_TIME)
        best[some], share[some], slope[some] = _best_cell(cells, period_s[some])
    there = share <= 1.0
    share = np.where(there, share, 0.0)
    branch, top, step = cells.branch[best], cells.frequency[best, 0], cells.frequency_step[best, 0]
    value = oriented.exact(branch, top + share * step)
    for _ in range(CORRECTIONS):
        off = (top + share * step) * period_s / (2.0 * math.pi) - 0.5 - np.angle(value) / math.pi
        moved = np.divide(off - np.round(off), slope, out=np.zeros_like(off), where=there & (slope != 0.0))
        share = np.clip(share - moved, 0.0, 1.0)
        value = oriented.exact(branch, top + share * step)
    return np.where(there, np.maximum(value.real, 0.0), 0.0)


def _best_cell(cells: _Cells, period_s: Floats) -> tuple[Ints, Floats, Floats]:
    """By period: the cell with the largest gain at a whole number of turns, its share of the way from top to foot, turns on it.

    Turns and gain are straight lines within a cell, so the number to be taken is the one next to the top. A share above 1: none.
    """
    turns = (cells.frequency * period_s - cells.phase) / (2.0 * math.pi)
    slope = (cells.frequency_step * period_s - cells.phase_step) / (2.0 * math.pi)
    turns *= np.sign(slope)
    share = np.ceil(turns) - turns
    share = np.divide(share, np.abs(slope), out=np.full_like(share, math.inf), where=slope != 0.0)
    gain = np.where(share <= 1.0, cells.gain + np.minimum(share, 1.0) * cells.gain_step, -math.inf)
    best, each = gain.argmax(axis=0), np.arange(len(period_s))
    return best, share[best, each], slope[best, each]


def _ranges(oriented: Oriented, branch: int, level: float) -> Iterator[Floats]:
    """The ranges of frequency where Re λ ≥ level, each from end to end on nodes fine enough to see how the period turns."""
    nodes = oriented.frequency_rad_s
    above = np.concatenate([[False], oriented.eigenvalue[branch].real >= level, [False]])
    begins, ends = np.flatnonzero(~above[:-1] & above[1:]), np.flatnonzero(above[:-1] & ~above[1:]) - 1
    inside = np.concatenate([begins, ends])
    outside = np.clip(np.concatenate([begins - 1, ends + 1]), 0, len(nodes) - 1)
    edges = _crossings(oriented, branch, level, nodes[outside], nodes[inside])
    for begin, end, low, high_end in zip(begins, ends, edges[: len(begins)], edges[len(begins) :], strict=True):
        coarse = np.concatenate([[low], nodes[begin : end + 1], [high_end]])
        places = np.linspace(0.0, len(coarse) - 1.0, FINER * (len(coarse) - 1) + 1)
        fine = np.interp(places, np.arange(len(coarse)), coarse)
        yield fine[fine > 0.0]


def _crossings(oriented: Oriented, branch: int, level: float, below: Floats, above: Floats) -> Floats:
    """Return where Re λ = level between each pair of frequencies, by regula falsi (Illinois); `above` where both are above."""
    under, over = (oriented.exact(branch, ends).real - level for ends in (below, above))
    place, was_high = above, np.zeros(len(above), dtype=np.int8)
    between = (under < 0.0) & (over > 0.0)
    for _ in range(FALSI):
        share = np.divide(over, over - under, out=np.zeros_like(over), where=between)
        place = above + share * (below - above)
        value = oriented.exact(branch, place).real - level
        high = value >= 0.0
        # an end that stays for the second time counts half
        under = np.where(high, np.where(was_high == 1, 0.5 * under, under), value)
        over = np.where(high, value, np.where(was_high == -1, 0.5 * over, over))
        below, above = np.where(high, below, place), np.where(high, place, above)
        was_high = np.where(high, 1, -1).astype(np.int8)
    return place


def _unstable_periods(frequency: Floats, phase: Floats, longest_s: float) -> Iterator[tuple[float, float]]:
    """Shortest and longest tooth period that each lobe covers, up to `longest_s`.

    From some lobe on, each reaches into the next one, for the distance of its ends grows with k: there they are one.
    """
    low, high = 1.0 / frequency[-1], 1.0 / frequency[0]
    needed = (phase[-1] + 2.0 * math.pi) * low - phase[0] * high
    together = max(0.0, math.ceil(needed / (2.0 * math.pi * (high - low)))) if high > low else math.inf
    lobes = min(together, math.floor(frequency[-1] * longest_s / (2.0 * math.pi)) + 1.0)
    for first in range(0, int(lobes) + 1, LOBES_AT_A_TIME):
        k = np.arange(first, min(first + LOBES_AT_A_TIME, int(lobes) + 1))
        periods = (phase + 2.0 * math.pi * k[:, None]) / frequency
        shortest, longest = periods.min(axis=1), periods.max(axis=1)
        longest[k == together] = math.inf
        yield from zip(shortest.tolist(), longest.tolist(), strict=True)


def _left_over(unstable: list[tuple[float, float]], low: float, high: float) -> tuple[tuple[float, float], ...]:
    """Return what the unstable intervals leave of the range from low to high."""
    stable: list[tuple[float, float]] = []
    for begin, end in sorted(unstable):
        if end <= low:
            continue
        if begin > low:
            stable.append((low, min(begin, high)))
        low = max(low, end)
        if low >= high:
            return tuple(stable)
    return (*stable, (low, high))
