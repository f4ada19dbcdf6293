"""The change of the cut in an operation, beside what the levels of wear and material foretold, tested as it goes on.

    N ← N + r z,  S ← S + r²                     since the operation began; z in spreads, r as in `scales.py`
    t = N / √(S (P S + a))                       N / S: the change; P: variance of what the levels foretell, in spreads²
    a = (1 + φ) / (1 − φ)                        φ: correlation of neighbouring ticks, which says less than as many free ones

As the levels are a Kalman filter's, N / S is its innovation, and t has a standard deviation of about 1 at any tick (Bar-Shalom,
Li and Kirubarajan 2001, section 5.4). One operation in fifty may chatter or be run at another override, so a fault that lasts is
asked for twice: by the same tool in its last operation as well, or by the last four operations together.
"""

from collections.abc import Sequence
from math import sqrt
from typing import NamedTuple

TOGETHER = 4
CLIP = 5.0
"""An operation counts for so much at most among the last four."""
TICKS_MIN = 5


class Gathered(NamedTuple):
    """The sums of an operation: N and S by signal; late: means of the last seconds of each load, as what peers feel is a mean
    off: of the variance that the override brings; ticks: that told
    """

    total: tuple[float, ...] = ()
    weight: tuple[float, ...] = ()
    late: tuple[tuple[float, float], ...] = ()
    off: float = 0.0
    ticks: int = 0


def begun_operation(count: int) -> Gathered:
    """Return the sums of an operation that begins, of so many signals."""
    return Gathered((0.0,) * count, (0.0,) * count, ((0.0, 0.0),) * count)


def gathered(
    before: Gathered, z: Sequence[float], tells: Sequence[float], late: Sequence[tuple[float, float]], off: float
) -> Gathered:
    """Return the sums after one more tick.

    >>> gathered(begun_operation(1), (2.0,), (1.0,), ((0.2, 0.1),), 0.5)
    Gathered(total=(2.0,), weight=(1.0,), late=((0.2, 0.1),), off=0.5, ticks=1)
    """
    return Gathered(
        tuple([n + one for n, one in zip(before.total, z, strict=True)]),
        tuple([s + one for s, one in zip(before.weight, tells, strict=True)]),
        tuple(late),
        before.off + off,
        before.ticks + 1,
    )


def statistic(n: float, s: float, variance: float, alike: float) -> float:
    """Return t.

    >>> round(statistic(40.0, 20.0, 0.5, 4.0), 2)
    2.39
    """
    return n / sqrt(s * (variance * s + alike)) if s > 0.0 else 0.0


def together(now: float, past: Sequence[Sequence[float]], at: int) -> float:
    """Return the figure of the last four operations, of which one is running; past: of the three before, by signal."""
    total = CLIP if now > CLIP else -CLIP if now < -CLIP else now
    for one in past:
        total += one[at]
    return 0.5 * total


def both(now: float, last: float) -> float:
    """Return the lesser of two figures of a tool; 0 where they are on different sides.

    >>> both(5.0, 3.0), both(-2.0, -4.0), both(5.0, -3.0)
    (3.0, -2.0, 0.0)
    """
    if now > 0.0 and last > 0.0:
        return min(now, last)
    return max(now, last) if now < 0.0 and last < 0.0 else 0.0


def clipped(figures: Sequence[float]) -> tuple[float, ...]:
    """Return the figures of an operation as they count among the last four."""
    return tuple([max(-CLIP, min(CLIP, one)) for one in figures])
