"""The best speed and feed of each line by itself, exactly. Where lines do not depend on each other, that is the best program.

A line of length L, with its share t of the time that nothing is cut, costs at the speed n, with f(n) = f_max(n),

    g(n) = (L / f(n)) (R + w n^m) + t (R + v n^m)

R: worth of a second; w n^m, v n^m: worth of the tool life that a second takes. For time alone w = v = 0. f(n) is k n up to a
speed at which the feed range (constant) or the power (falling, or constant) takes over. On k n, g has one minimum, at the root of

    −R / n² + (m − 1) w n^(m−2) + (t k / L) m v n^(m−1) = 0

whose left side grows; beyond the corner g grows. So the best n is a corner, that root, or an end of a span: a few candidates.
"""

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from twin.optimisation.allowed import Allowed, Span

Floats = NDArray[np.float64]
BISECTIONS = 80
TIE = 1e-12


@dataclass(frozen=True, slots=True, eq=False)
class Worth:
    """What g weighs, (lines,): length_mm and beside_s of each; wear, wear_beside: w and v; per_second: R; exponent: m."""

    length_mm: Floats
    beside_s: Floats
    wear: Floats
    wear_beside: Floats
    per_second: float
    exponent: float

    def of_line(self, line: int, feed: Floats, rpm: Floats) -> Floats:
        """g of one line at feeds (mm/min of real feed) and speeds."""
        power = rpm**self.exponent
        first = 60.0 * self.length_mm[line] / feed * (self.per_second + self.wear[line] * power)
        return np.asarray(first + self.beside_s[line] * (self.per_second + self.wear_beside[line] * power))


def best_alone(allowed: Allowed, worth: Worth, tie: Worth | None = None, near_rpm: Floats | None = None) -> tuple[Floats, Floats]:
    """Feed word and speed of each line by itself, (lines,) each.

    tie: among speeds that are equally good, the one that is best by this; near_rpm: else the one nearest to these. Lines in air
    have no speed of their own: theirs is 0.
    """
    feed, rpm = np.full(len(allowed), allowed.feed_high), np.zeros(len(allowed))
    for line in np.flatnonzero(allowed.cutting).tolist():
        one = allowed.line(line)
        speeds = np.unique(np.concatenate([np.array(list(_candidates(one, worth, line, span))) for span in allowed.spans[line]]))
        if tie is not None:
            more = [np.array(list(_candidates(one, tie, line, span))) for span in allowed.spans[line]]
            speeds = np.unique(np.concatenate([speeds, *more]))
        if near_rpm is not None:
            inside = [min(max(near_rpm[line], a), b) for a, b in allowed.spans[line]]
            speeds = np.unique(np.concatenate([speeds, inside]))
        feeds = one.feed_max(speeds[:, None])[:, 0]
        value = worth.of_line(line, feeds * allowed.feed_ratio, speeds)
        good = np.flatnonzero(value <= value.min() * (1.0 + TIE))
        if tie is not None:
            good = good[np.argsort(tie.of_line(line, feeds[good] * allowed.feed_ratio, speeds[good]), kind="stable")]
        elif near_rpm is not None:
            good = good[np.argsort(np.abs(speeds[good] - near_rpm[line]), kind="stable")]
        rpm[line], feed[line] = speeds[good[0]], feeds[good[0]]
    return feed, rpm


def _candidates(one: Allowed, worth: Worth, line: int, span: Span) -> Iterator[float]:
    """The speeds of a span of which one is the best."""
    low, high = span
    yield from span
    chip = float(one.advance_max_mm[0] * one.teeth[0] / one.feed_ratio)  # k, of the feed word
    corner = one.feed_high / chip
    yield min(max(corner, low), high)
    if one.spindle is not None:
        yield from _power_corners(one, low, high)
    root = _stationary(worth, line, chip * one.feed_ratio, low, high)
    yield root


def _power_corners(one: Allowed, low: float, high: float) -> Iterator[float]:
    """Where the power begins or ends to be the limit, and the speeds with the highest feed: by a grid, then by bisection."""
    grid = np.linspace(low, high, 65)
    by_power = one.advance_by_power_mm(grid[:, None])[:, 0] * float(one.teeth[0]) * grid / one.feed_ratio
    others = np.minimum(one.feed_high, float(one.advance_max_mm[0]) * float(one.teeth[0]) * grid / one.feed_ratio)
    binds = by_power < others
    for k in np.flatnonzero(binds[1:] != binds[:-1]).tolist():
        a, b = float(grid[k]), float(grid[k + 1])
        for _ in range(BISECTIONS):
            middle = np.array([[0.5 * (a + b)]])
            power = one.advance_by_power_mm(middle)[0, 0] * one.teeth[0] * middle[0, 0] / one.feed_ratio
            other = min(one.feed_high, float(one.advance_max_mm[0] * one.teeth[0] * middle[0, 0] / one.feed_ratio))
            same = (power < other) == binds[k]
            a, b = (float(middle[0, 0]), b) if same else (a, float(middle[0, 0]))
        yield a
        yield b
    yield from grid[binds].tolist()


def _stationary(worth: Worth, line: int, chip: float, low: float, high: float) -> float:
    """The root of g' on k n within the span, or the end of it that is nearer."""
    wear, beside, length = worth.wear[line], worth.wear_beside[line], worth.length_mm[line]
    m, share = worth.exponent, worth.beside_s[line] * chip / (60.0 * length)

    def slope(n: float) -> float:
        return float(-worth.per_second / n**2 + (m - 1.0) * wear * n ** (m - 2.0) + share * m * beside * n ** (m - 1.0))

    if slope(low) >= 0.0 or slope(high) <= 0.0:
        return low if slope(low) >= 0.0 else high
    for _ in range(BISECTIONS):
        middle = 0.5 * (low + high)
        low, high = (middle, high) if slope(middle) < 0.0 else (low, middle)
    return 0.5 * (low + high)
