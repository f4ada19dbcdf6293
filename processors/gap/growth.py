"""A chart of growth: the figures of its blocks (hours), against what they were while the machine was healthy.

Neighbouring hours are alike, so the mean of n of them is not √n times better known than one. The sum over n figures of an AR(1)
process with correlation φ varies like that of independent ones which scatter ω times as much, so each figure x is taken as

    e = (x − μ) / (ω σ),   ω² = (1 + φ) / (1 − φ)

with μ, σ and φ learned from healthy blocks only, and both sides are summed up (Page, Biometrika 41, 1954):

    S = max(0, S ± e − κ)

The gap grows when S exceeds h. Without growth, that takes L blocks on average (Siegmund, Sequential Analysis, 1985, chapter 2;
less than the truth, since his correction for overshoot is left out), from which h follows:

    L = (exp(2 κ h) − 2 κ h − 1) / (2 κ²)

κ is half of the smallest growth that is worth an alarm, as it shows in e, and three standard errors of μ more, since what was
learned is not known exactly; for the same reason φ is taken two of its standard errors larger, and σ 1.64. A figure further than
3 σ from μ counts as 3 (where κ is larger than that, as one more than κ), so that no alarm comes of a single block.
"""

import math
from functools import lru_cache
from typing import NamedTuple

BLOCKS_MIN = 40
INDEPENDENT_MIN = 8.0
"""The healthy blocks that make a baseline, and how many of them have to be independent of each other."""
BASELINES_MAX = 10_000
"""Baselines whose rules are cached; they are fixed once they are learned."""
CORRELATION_MAX = 0.98
PAIRS_MIN = 10
DOUBT = 3.0
STRAY = 3.0
ALLOWANCE_MIN, ALLOWANCE_MAX = 0.1, 2.0
THRESHOLD_MIN = 4.0
CAP = 1.25
"""The cap of S, in thresholds: it goes no higher, so that a gap that has gone is seen to be gone in time."""


class Baseline(NamedTuple):
    """Statistics of the figures of healthy blocks, one added after the other.

    m2: sum of squares about the mean; pairs: neighbours, with the sum of their products and their sum, both from `origin` on
    """

    blocks: int = 0
    mean: float = 0.0
    m2: float = 0.0
    origin: float = 0.0
    pairs: int = 0
    products: float = 0.0
    pair_sums: float = 0.0


class Chart(NamedTuple):
    """The two sums in standard deviations of e, since when each is above 0, and which of them has passed its threshold.

    grows: +1 or −1, 0 while the gap does not grow; level: the larger sum over its threshold
    """

    up: float = 0.0
    down: float = 0.0
    up_since_s: float = 0.0
    down_since_s: float = 0.0
    grows: int = 0
    since_s: float = 0.0
    level: float = 0.0


class Rule(NamedTuple):
    """sigma σ, in the unit of the figure; widening ω; allowance κ and threshold h of the chart."""

    sigma: float
    widening: float
    allowance: float
    threshold: float


def learned(baseline: Baseline, figure: float, before: float | None) -> Baseline:
    """The baseline with the figure of one more healthy block; `before`: of the block just before it, if any."""
    if baseline.blocks == 0:
        return Baseline(blocks=1, mean=figure, origin=figure)
    blocks = baseline.blocks + 1
    step = figure - baseline.mean
    mean = baseline.mean + step / blocks
    m2 = baseline.m2 + step * (figure - mean)
    pairs, products, sums = baseline.pairs, baseline.products, baseline.pair_sums
    if before is not None:
        here, there = figure - baseline.origin, before - baseline.origin
        pairs, products, sums = pairs + 1, products + here * there, sums + here + there
    return Baseline(blocks, mean, m2, baseline.origin, pairs, products, sums)


def correlation(baseline: Baseline) -> float:
    """Return the correlation of neighbouring blocks, 0 to CORRELATION_MAX; corrected for being estimated from few, and one
    standard error higher.

    A figure that goes up and down by turns is not correlated in a way that hides a growth:

    >>> baseline = Baseline()
    >>> for k in range(30):
    ...     baseline = learned(baseline, float(k % 2), float((k - 1) % 2) if k else None)
    >>> correlation(baseline)
    0.0
    """
    variance = baseline.m2 / max(baseline.blocks, 1)
    if baseline.pairs < PAIRS_MIN or variance <= 0.0:
        return 0.0
    mean = baseline.mean - baseline.origin
    covariance = (baseline.products - mean * baseline.pair_sums + baseline.pairs * mean * mean) / baseline.pairs
    rough = min(max(covariance / variance, -1.0), 1.0)
    better = rough + (1.0 + 3.0 * rough) / baseline.pairs
    upper = better + 2.0 * math.sqrt(max(1.0 - better * better, 0.0) / baseline.pairs)
    return min(max(upper, 0.0), CORRELATION_MAX)


@lru_cache(maxsize=BASELINES_MAX)
def is_enough(baseline: Baseline) -> bool:
    """True once enough is known of the healthy machine to judge growth."""
    phi = correlation(baseline)
    return baseline.blocks >= BLOCKS_MIN and baseline.blocks * (1.0 - phi) / (1.0 + phi) >= INDEPENDENT_MIN


@lru_cache(maxsize=BASELINES_MAX)
def rule_of(baseline: Baseline, worth: float, blocks_between_alarms: float) -> Rule | None:
    """Return the rule by which the chart of this baseline judges; None while it knows too little.

    worth: the smallest growth that is worth an alarm, in the unit of the figure
    blocks_between_alarms: between two false alarms of one side of one chart, on average
    """
    if not is_enough(baseline):
        return None
    phi = correlation(baseline)
    independent = max(baseline.blocks * (1.0 - phi * phi) / (1.0 + phi * phi), 2.0)
    sigma = math.sqrt(baseline.m2 / (baseline.blocks - 1)) * (1.0 + 1.64 / math.sqrt(2.0 * independent))
    sigma = max(sigma, worth / 10.0)
    widening = math.sqrt((1.0 + phi) / (1.0 - phi))
    allowance = min(max(worth / sigma / widening / 2.0, ALLOWANCE_MIN), ALLOWANCE_MAX) + DOUBT / math.sqrt(baseline.blocks)
    return Rule(sigma, widening, allowance, threshold(allowance, blocks_between_alarms))


def threshold(allowance: float, blocks_between_alarms: float) -> float:
    """h of one side. At κ = 0.5, one side of h = 5 has (e⁵ − 5 − 1) / 0.5 = 284.8 blocks between alarms:

    >>> round(threshold(0.5, 284.8), 2)
    5.0
    """
    low, high = 0.0, 1.0 + math.log1p(2.0 * blocks_between_alarms) / allowance
    for _ in range(60):
        middle = (low + high) / 2.0
        run = (math.exp(2.0 * allowance * middle) - 2.0 * allowance * middle - 1.0) / (2.0 * allowance**2)
        low, high = (middle, high) if run < blocks_between_alarms else (low, middle)
    return max(high, THRESHOLD_MIN)


def charted(chart: Chart, rule: Rule, baseline: Baseline, figure: float, start_s: float, *, down: bool = True) -> Chart:
    """The chart with the figure of one more block, begun at `start_s`. down: whether a fall is a growth of the gap too."""
    most = max(STRAY / rule.widening, rule.allowance + 1.0)
    e = min(max((figure - baseline.mean) / rule.sigma / rule.widening, -most), most)
    cap = CAP * rule.threshold
    up = min(max(chart.up + e - rule.allowance, 0.0), cap)
    fall = min(max(chart.down - e - rule.allowance, 0.0), cap) if down else 0.0
    up_since_s = chart.up_since_s if chart.up > 0.0 else start_s
    down_since_s = chart.down_since_s if chart.down > 0.0 else start_s
    grows, since_s = chart.grows, chart.since_s
    if (grows > 0 and up == 0.0) or (grows < 0 and fall == 0.0):
        grows, since_s = 0, 0.0
    if grows == 0 and max(up, fall) > rule.threshold:
        grows, since_s = (1, up_since_s) if up >= fall else (-1, down_since_s)
    level = max(up, fall) / rule.threshold
    return Chart(up, fall, up_since_s, down_since_s, grows, since_s, level)
