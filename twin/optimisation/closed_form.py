"""The best speed of each group of lines and the feeds with it, exactly. Where groups do not depend on each other, that is the
best program. A line that shares its speed with no other is a group of one.

A line of length L, with its share t of the time that nothing is cut, costs at the speed n, with f(n) = f_max(n),

    g(n) = (L / f(n)) (R + w n^m) + t (R + v n^m)

R: worth of a second; w n^m, v n^m: worth of the tool life that a second takes. For time alone w = v = 0. f(n) is k n up to a
corner at which the feed range takes over, f(n) = F. For a group G(n) is the sum of its lines, and

    n² G'(n) = Σ before their corners (L/k) ((m − 1) w n^m − R)  +  Σ beyond (L/F) m w n^(m+1)  +  Σ t m v n^(m+1)

which grows with n, also where a line passes its corner. So G has one minimum in a span: the root, found by bisection, or an end.
For one line that is its corner, the root before it, or an end of the span.

Where power binds, f(n) falls or stays beyond a corner of its own: these corners, found by a grid and bisection, are candidates
too, and so is the grid where power binds; about the best of all a golden section ends it.
"""

from dataclasses import dataclass
from typing import Self

import numpy as np
from numpy.typing import NDArray

from twin.optimisation.allowed import Allowed
from twin.optimisation.speeds.groups import SpeedGroups

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]
BISECTIONS, SECTIONS = 80, 60
GOLDEN = 0.5 * (5.0**0.5 - 1.0)
GRID = 65
TIE = 1e-12
BLOCK = 1_000_000
"""Figures that are worked out at a time: speeds times lines."""


@dataclass(frozen=True, slots=True, eq=False)
class Worth:
    """The weights in g, (lines,): length_mm and fixed_s of each; wear, wear_fixed: w and v; per_second: R; exponent: m."""

    length_mm: Floats
    fixed_s: Floats
    wear: Floats
    wear_fixed: Floats
    per_second: float
    exponent: float

    def each(self, feed: Floats, rpm: Floats) -> Floats:
        """g of each line at feeds (mm/min of real feed) and speeds, both (…, lines)."""
        power = rpm**self.exponent
        first = 60.0 * self.length_mm / feed * (self.per_second + self.wear * power)
        return np.asarray(first + self.fixed_s * (self.per_second + self.wear_fixed * power))

    def of(self, rows: Ints, feed: Floats, rpm: Floats) -> Floats:
        """Return g of some lines that share their speed: feeds (…, rows), speeds (…)."""
        return np.asarray(self.lines(rows).each(feed, np.asarray(rpm)[..., None]).sum(axis=-1))

    def lines(self, rows: Ints) -> "Worth":
        """Some lines; each as often as it is named."""
        return Worth(
            self.length_mm[rows], self.fixed_s[rows], self.wear[rows], self.wear_fixed[rows], self.per_second, self.exponent
        )


@dataclass(frozen=True, slots=True, eq=False)
class _Pieces:
    """Every span of every group, (pieces,), with the lines that share it, (elements,): a line is in each span of its group.

    first: the first element of each piece; piece: (elements,); row: (elements,) line of `Allowed`; group: (pieces,)
    lines: what is allowed of each element; low, high: of each span
    """

    lines: Allowed
    row: Ints
    piece: Ints
    first: Ints
    group: Ints
    low: Floats
    high: Floats

    @classmethod
    def of(cls, allowed: Allowed, groups: SpeedGroups) -> Self:
        spans = [(k, span) for k, rows in enumerate(groups.rows) for span in allowed.spans[int(rows[0])]]
        count = np.array([len(groups.rows[k]) for k, _ in spans], dtype=np.int64)
        row = np.concatenate([np.empty(0, dtype=np.int64), *(groups.rows[k] for k, _ in spans)])
        edges = np.array([span for _, span in spans], dtype=np.float64).reshape(-1, 2)
        return cls(
            allowed.lines(row),
            row,
            np.repeat(np.arange(len(spans)), count),
            np.concatenate([[0], np.cumsum(count)[:-1]]).astype(np.int64),
            np.array([k for k, _ in spans], dtype=np.int64),
            edges[:, 0],
            edges[:, 1],
        )

    def sums(self, values: Floats) -> Floats:
        """Return the sums over the elements of each piece, (…, pieces)."""
        return np.asarray(np.add.reduceat(values, self.first, axis=-1))

    def corner_rpm(self) -> Floats:
        """The speed at which the feed range takes over from the chip, (elements,)."""
        one = self.lines
        return np.asarray(one.feed_high * one.feed_ratio / (one.advance_max_mm * one.teeth))

    def value(self, worth: Worth, speeds: Floats) -> Floats:
        """G at speeds (candidates, pieces); worth: of the elements."""
        step = max(1, BLOCK // max(len(self.row), 1))
        parts = []
        for k in range(0, len(speeds), step):
            rpm = speeds[k : k + step, self.piece]
            parts.append(self.sums(worth.each(self.lines.feed_max(rpm) * self.lines.feed_ratio, rpm)))
        return np.concatenate(parts)


def best_together(
    allowed: Allowed, groups: SpeedGroups, worth: Worth, tie: Worth | None = None, near_rpm: Floats | None = None
) -> tuple[Floats, Floats]:
    """Feed word and speed of each line, (lines,) each, at the best speed of its group.

    tie: among speeds that are equally good, the one that is best by this; near_rpm: else the one nearest to these, (lines,).
    Lines in air have no speed of their own: theirs is 0.
    """
    feed, rpm = np.full(len(allowed), allowed.feed_high), np.zeros(len(allowed))
    if not len(groups):
        return feed, rpm
    made = _Pieces.of(allowed, groups)
    speeds = [made.low, made.high, *_stationary(made, worth.lines(made.row))]
    if tie is not None:
        speeds += _stationary(made, tie.lines(made.row))
    near = near_rpm[groups.lead][made.group] if near_rpm is not None else made.low
    speeds.append(np.clip(near, made.low, made.high))
    candidates, binds = np.array(speeds), np.zeros(len(made.group), dtype=np.bool_)
    if allowed.spindle is not None:
        candidates, binds = _with_power(made, candidates)
    candidates = np.sort(candidates, axis=0)
    own = worth.lines(made.row)
    value = made.value(own, candidates)
    if binds.any():
        best = _sectioned(made, own, candidates, value)
        candidates = np.concatenate([candidates, best[None]])
        value = np.concatenate([value, made.value(own, best[None])])
    second = np.abs(candidates - near) if tie is None else made.value(tie.lines(made.row), candidates)
    chosen = _chosen(made, value, second, len(groups))
    for k, (candidate, piece) in enumerate(chosen):
        rpm[groups.rows[k]] = candidates[candidate, piece]
    own_speed = groups.of_row >= 0
    feed[own_speed] = allowed.feed_max(rpm)[own_speed]
    return feed, rpm


def _chosen(made: _Pieces, value: Floats, second: Floats, groups: int) -> list[tuple[int, int]]:
    """Candidate and piece of each group: the least value, among equal ones the least `second`, then the first."""
    least = np.full(groups, np.inf)
    np.minimum.at(least, made.group, value.min(axis=0))
    second = np.where(value <= least[made.group] * (1.0 + TIE), second, np.inf)
    at = np.argmin(second, axis=0)
    of_piece = second[at, np.arange(len(made.group))]
    edges = np.searchsorted(made.group, np.arange(groups + 1))
    pieces = [a + int(np.argmin(of_piece[a:b])) for a, b in zip(edges[:-1].tolist(), edges[1:].tolist(), strict=True)]
    return [(int(at[piece]), piece) for piece in pieces]


def _stationary(made: _Pieces, worth: Worth) -> list[Floats]:
    """Return, for each piece, the speed where n² G' comes to zero, or the nearer end, and the corner that is nearest to it."""
    corner, m = made.corner_rpm(), worth.exponent
    before_s = 60.0 * worth.length_mm * corner / (made.lines.feed_high * made.lines.feed_ratio)  # 60 L / k
    beyond_s = 60.0 * worth.length_mm / (made.lines.feed_high * made.lines.feed_ratio)

    def slope(speed: Floats) -> Floats:
        n = speed[made.piece]
        power = n**m
        before = before_s * ((m - 1.0) * worth.wear * power - worth.per_second)
        beyond = beyond_s * m * worth.wear * power * n
        return made.sums(np.where(n < corner, before, beyond) + worth.fixed_s * m * worth.wear_fixed * power * n)

    low, high = made.low.copy(), made.high.copy()
    rises = slope(low) >= 0.0
    falls = slope(high) < 0.0
    for _ in range(BISECTIONS):
        middle = 0.5 * (low + high)
        below = slope(middle) < 0.0
        low, high = np.where(below, middle, low), np.where(below, high, middle)
    root = np.where(rises, made.low, np.where(falls, made.high, high))
    far = np.abs(corner - root[made.piece])
    order = np.lexsort((far, made.piece))
    nearest = corner[order[made.first]]
    return [root, np.clip(nearest, made.low, made.high)]


def _with_power(made: _Pieces, candidates: Floats) -> tuple[Floats, NDArray[np.bool_]]:
    """The candidates, with the speeds at which power begins or ends to bind and the grid where it binds; and in which pieces."""
    grid = np.linspace(made.low, made.high, GRID)
    binds = _power_binds(made, grid[:, made.piece])
    if not binds.any():
        return candidates, np.zeros(len(made.group), dtype=np.bool_)
    more: list[tuple[int, float]] = []
    where, cell = np.nonzero((binds[1:] != binds[:-1]).T)
    place = np.arange(len(where)) - np.searchsorted(where, where)
    for turn in range(int(place.max(initial=-1)) + 1):
        mine = place == turn
        low, high = made.low[made.piece].copy(), made.low[made.piece].copy()
        low[where[mine]] = grid[cell[mine], made.piece[where[mine]]]
        high[where[mine]] = grid[cell[mine] + 1, made.piece[where[mine]]]
        at_low = binds[0].copy()
        at_low[where[mine]] = binds[cell[mine], where[mine]]
        for _ in range(BISECTIONS):
            middle = 0.5 * (low + high)
            same = _power_binds(made, middle[None])[0] == at_low
            low, high = np.where(same, middle, low), np.where(same, high, middle)
        for edge in (low, high):
            more += zip(made.piece[where[mine]].tolist(), edge[where[mine]].tolist(), strict=True)
    any_binds = made.sums(binds.astype(np.float64)) > 0.0
    for k, piece in np.argwhere(any_binds).tolist():
        more.append((piece, float(grid[k, piece])))
    return np.concatenate([candidates, _layers(more, made.low)]), np.asarray(any_binds.any(axis=0))


def _power_binds(made: _Pieces, rpm: Floats) -> NDArray[np.bool_]:
    """Return True where the power allows less feed than chip and range do, (…, elements)."""
    one = made.lines
    per_chip = one.teeth * rpm / one.feed_ratio
    return np.asarray(one.advance_by_power_mm(rpm) * per_chip < np.minimum(one.feed_high, one.advance_max_mm * per_chip))


def _layers(pairs: list[tuple[int, float]], fill: Floats) -> Floats:
    """Speeds of pieces as a table (candidates, pieces), `fill` where a piece has fewer."""
    piece = np.array([k for k, _ in pairs], dtype=np.int64)
    order = np.argsort(piece, kind="stable")
    piece, speed = piece[order], np.array([n for _, n in pairs], dtype=np.float64)[order]
    place = np.arange(len(piece)) - np.searchsorted(piece, piece)
    table = np.tile(fill, (int(place.max()) + 1, 1))
    table[place, piece] = speed
    return table


def _sectioned(made: _Pieces, worth: Worth, candidates: Floats, value: Floats) -> Floats:
    """The best speed between the neighbours of the best candidate of each piece, by golden section."""
    at, every = np.argmin(value, axis=0), np.arange(len(made.group))
    best = candidates[at, every]
    low = np.where(candidates < best, candidates, made.low).max(axis=0)
    high = np.where(candidates > best, candidates, made.high).min(axis=0)
    a, b = high - GOLDEN * (high - low), low + GOLDEN * (high - low)
    at_a, at_b = (made.value(worth, one[None])[0] for one in (a, b))
    for _ in range(SECTIONS):
        left = at_a <= at_b
        low, high = np.where(left, low, a), np.where(left, b, high)
        new = np.where(left, high - GOLDEN * (high - low), low + GOLDEN * (high - low))
        at_new = made.value(worth, new[None])[0]
        a, b = np.where(left, new, b), np.where(left, a, new)
        at_a, at_b = np.where(left, at_new, at_b), np.where(left, at_a, at_new)
    return np.asarray(np.where(at_a <= at_b, a, b))
