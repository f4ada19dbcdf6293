"""The usual course of an operation: for each section and signal a centre and a variance, from as few parts as possible.

    centre ← centre + (mean of the part − centre) / (min(n, memory) + 1)
    variance = (n₀ · prior + n · own) / (n₀ + n) · (1 + 1 / n)          prior: of the signal in steady sections, n₀ = 3 parts

Centres are of ln ratios less the levels of wear and material (`levels.py`). While no part has come to a
section, the twin's expectation stands in for it (`residuals.py`).
"""

import math
from collections.abc import Sequence
from typing import NamedTuple

from twin.anomaly.parts.moment import Mark

MEMORY_PARTS = 20
PRIOR_PARTS = 3.0
OUTLIER = 4.0
FROZEN_PARTS = 3


class Usual(NamedTuple):
    """marks: where sections begin; end: the furthest moment; parts: that were learned; duration_ticks: usual number that tell
    centre, variance, parts_told, weight: by section, each by signal; weight = 1 / spread with what is not known yet
    frozen: centre of the load with the levels it was learned at,
        by section, from the first parts
    """

    marks: tuple[Mark, ...]
    end: Mark
    parts: int
    duration_ticks: float
    centre: tuple[tuple[float, ...], ...]
    variance: tuple[tuple[float, ...], ...]
    told: tuple[tuple[int, ...], ...]
    weight: tuple[tuple[float, ...], ...]
    frozen: tuple[float | None, ...]


class Sums(NamedTuple):
    """The sums of a section in one part: for each signal ticks that told, residuals, their squares."""

    count: tuple[int, ...]
    total: tuple[float, ...]
    squares: tuple[float, ...]

    def plus(self, other: "Sums") -> "Sums":
        """Return the sums of both."""
        return Sums(*(tuple([a + b for a, b in zip(x, y, strict=True)]) for x, y in zip(self, other, strict=True)))


Rows = tuple[tuple[float | None, ...], ...]
"""Residuals of the ticks of a section, by signal."""


def with_rows(sections: tuple[tuple[int, Sums], ...], section: int, rows: Rows) -> tuple[tuple[int, Sums], ...]:
    """Return the sums of an operation's sections with those of one more.

    >>> with_rows((), 4, ((0.5, None), (1.5, None)))
    ((4, Sums(count=(2, 0), total=(2.0, 0.0), squares=(2.5, 0.0))),)
    """
    columns = [[value for value in column if value is not None] for column in zip(*rows, strict=True)]
    sums = Sums(
        tuple([len(column) for column in columns]),
        tuple([round(math.fsum(column), 4) for column in columns]),
        tuple([round(math.fsum([value * value for value in column]), 6) for column in columns]),
    )
    return (*sections, (section, sums))


def weights(variance: Sequence[float], told: Sequence[int], prior: Sequence[float], floor: Sequence[float]) -> tuple[float, ...]:
    """Return 1 / spread of each signal in a section; 0 where no part has told of it.

    >>> [round(w, 2) for w in weights((0.01, 0.01, 1.0), (1, 100, 0), (0.01, 0.01, 0.01), (1e-4, 1e-4, 1e-4))]
    [7.07, 9.95, 0.0]
    """
    found = []
    for own, n, usual, least in zip(variance, told, prior, floor, strict=True):
        mixed = (PRIOR_PARTS * usual + n * own) / (PRIOR_PARTS + n)
        found.append(0.0 if n == 0 else (max(mixed, least) * (1.0 + 1.0 / n)) ** -0.5)
    return tuple(found)


def begun_usual(marks: tuple[Mark, ...], end: Mark, signals: int) -> Usual:
    """Return the usual course before any part: sections without parts."""
    count = len(marks)
    zero = (0.0,) * signals
    return Usual(
        marks,
        end,
        0,
        0.0,
        (zero,) * count,
        (zero,) * count,
        ((0,) * signals,) * count,
        (zero,) * count,
        (None,) * count,
    )


def extended(usual: Usual, marks: tuple[Mark, ...], end: Mark, signals: int) -> Usual:
    """Return the course with the sections that a part formed beyond it."""
    new = begun_usual(marks, end, signals)
    return usual._replace(
        marks=usual.marks + new.marks,
        end=max(usual.end, end),
        centre=usual.centre + new.centre,
        variance=usual.variance + new.variance,
        told=usual.told + new.told,
        weight=usual.weight + new.weight,
        frozen=usual.frozen + new.frozen,
    )


def learned_section(
    usual: Usual, section: int, sums: Sums, prior: Sequence[float], floor: Sequence[float]
) -> tuple[tuple[float, ...], tuple[float, ...], tuple[int, ...], tuple[float, ...]]:
    """Return centre, variance, parts and weight of a section after one more healthy part; sums: of residuals to the centre."""
    centre, variance, parts = [], [], []
    rows = zip(usual.centre[section], usual.variance[section], usual.told[section], *sums, prior, strict=True)
    for c, v, n, count, total, squares, usual_variance in rows:
        if not count:
            centre.append(c)
            variance.append(v)
            parts.append(n)
            continue
        mean, square = total / count, squares / count
        if n == 0:
            centre.append(round(c + mean, 4))
            variance.append(round(max(0.0, square - mean * mean), 6))
            parts.append(1)
            continue
        spread = (max(v, usual_variance)) ** 0.5
        share = 1.0 / (min(n, MEMORY_PARTS) + 1)
        limit = OUTLIER * spread
        centre.append(round(c + share * max(-limit, min(limit, mean)), 4))
        variance.append(round(v + share * (min(square, limit * limit) - v), 6))
        parts.append(min(n + 1, 1000))
    return tuple(centre), tuple(variance), tuple(parts), weights(variance, parts, prior, floor)


def froze(before: float | None, parts: int, now: float) -> float | None:
    """Return the frozen quantity of a section: the mean of its first parts, whatever wear and material were then.

    >>> froze(0.2, 1, 0.4), froze(0.2, 3, 9.0)
    (0.3, 0.2)
    """
    if parts >= FROZEN_PARTS:
        return before
    return round(now if before is None else (before * parts + now) / (parts + 1), 4)
