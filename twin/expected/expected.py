"""An expectation at one place of a program, and one run of a line with the force along it.

    r = (feed / speed) over (planned feed / programmed speed)       F = F(r), linear in r for a force without edge and size effect

F is the mean tangential force over the distance; at an even feed that is its mean over time.
"""

from bisect import bisect_left
from collections.abc import Sequence
from typing import NamedTuple

RATIOS = (0.25, 0.5, 0.75, 1.0, 1.25, 1.5, 2.0, 3.0)
"""The advances, over the planned one, at which a force that is no straight line through 0 is sampled."""


class Expected(NamedTuple):
    """The expectation at a line. feed_mm_min, spindle_rpm, time_s: as planned, whatever is run.

    cut_load_pct, load_pct, force_n: at the feed and speed that are run, mean tangential force; NaN where they are not known
    time_s: of the line from its beginning to its end; feed_mm_min: its mean, with starts and stops in it
    """

    cut_load_pct: float
    load_pct: float
    feed_mm_min: float
    spindle_rpm: float
    force_n: float
    time_s: float


class Stretch(NamedTuple):
    """A part of a line that ends `until_mm` after its beginning. forces_n: at RATIOS, or one figure where F grows with r"""

    until_mm: float
    forces_n: tuple[float, ...]


class Run(NamedTuple):
    """One run of a line: number of the line as the control tells it, tool, plan, and the force along it.

    feed_mm_min: length over time in motion; spindle_rpm: as programmed, positive; time_s: with waits and halts
    stretches: empty where the force is not known, which `why_not` explains
    """

    line: int
    tool: int
    feed_mm_min: float
    spindle_rpm: float
    diameter_mm: float
    length_mm: float
    time_s: float
    stretches: tuple[Stretch, ...]
    why_not: str = ""


def force_at(forces_n: Sequence[float], ratio: float) -> float:
    """Return the force at an advance of `ratio` times the planned one; beyond RATIOS along the last straight line, from 0 below.

    >>> force_at((200.0,), 0.5), force_at((120.0, 140.0, 160.0, 180.0, 200.0, 220.0, 260.0, 340.0), 1.125)
    (100.0, 190.0)
    """
    if len(forces_n) == 1:
        return forces_n[0] * ratio
    if ratio <= RATIOS[0]:
        return forces_n[0] * ratio / RATIOS[0]
    k = min(bisect_left(RATIOS, ratio), len(RATIOS) - 1)
    part = (ratio - RATIOS[k - 1]) / (RATIOS[k] - RATIOS[k - 1])
    return forces_n[k - 1] + part * (forces_n[k] - forces_n[k - 1])


def mean_forces(stretches: Sequence[Stretch]) -> tuple[float, ...]:
    """Return the mean over the distance of forces in a row of stretches.

    >>> mean_forces((Stretch(10.0, (0.0,)), Stretch(40.0, (200.0,))))
    (150.0,)
    """
    if len(stretches) == 1:
        return stretches[0].forces_n
    total_mm = stretches[-1].until_mm
    sums = [0.0] * max(len(one.forces_n) for one in stretches)
    before_mm = 0.0
    for until_mm, forces in stretches:
        full = forces if len(forces) == len(sums) else tuple(forces[0] * ratio for ratio in RATIOS)
        for k, force_n in enumerate(full):
            sums[k] += force_n * (until_mm - before_mm)
        before_mm = until_mm
    return tuple(one / total_mm for one in sums)
