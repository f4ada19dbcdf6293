"""The shares of the gap that the refitted constants take up, each by itself: a finding like a cause.

The share of a constant is its Shapley value among those that moved and all else that was fitted, on the runs not fitted:

    closed(S) = 1 − Σ max(rms_S² − 1, 0) / Σ max(rms_stated² − 1, 0),   S at what was found, the others as stated
"""

from collections.abc import Iterable, Sequence
from itertools import combinations

import numpy as np
from numpy.typing import NDArray

from twin.gap.diagnosis import MovedConstant
from twin.gap.fitting import lefts_by
from twin.gap.naming.moved import deviations
from twin.gap.naming.siblings import above
from twin.gap.refitted import constant_path, with_constants
from twin.gap.search import Explained
from twin.gap.shares import EXACT_MAX, shapley
from twin.gap.wording import constant_words, percent
from twin.machine import MachineFile

Floats = NDArray[np.float64]
NOTABLE = 1.0
"""Stated deviations from which on a constant has moved."""
CLOSES_LEAST = 0.02
SAID_FROM, SAID_CLOSURE, SAID_MAX = 1.5, 0.1, 3
"""A constant gets a word in the sentence from these on: deviations, part of the gap; and how many do at most."""
REST = -1


def moved_constants(machine: MachineFile, stages: Iterable[Explained]) -> tuple[MovedConstant, ...]:
    """Return the constants that moved and take a part of the gap, largest part first."""
    found = [constant for stage in stages for constant in _of_stage(machine, stage)]
    return tuple(sorted(found, key=lambda c: -c.closure))


def _of_stage(machine: MachineFile, explained: Explained) -> list[MovedConstant]:
    stage, best = explained.stage, explained.best
    away = deviations(best)
    moved = tuple(int(i) for i in np.flatnonzero(np.abs(away) >= NOTABLE))
    if not moved:
        return []
    shares = _shares(explained, moved)
    refitted = with_constants(machine, stage, best)
    listed = []
    for i in moved:
        closure = float(np.clip(shares[i], 0.0, 1.0))
        if closure >= CLOSES_LEAST:
            path = constant_path(machine, stage, best.model.constants[i].name)
            stated, now = (_at(one, path) for one in (machine, refitted))
            listed.append(MovedConstant(path, stated, now, round(abs(float(away[i])), 2), round(closure, 4)))
    return listed


def _shares(explained: Explained, moved: tuple[int, ...]) -> dict[int, float]:
    """Return what each moved constant closes; all else that was fitted is one part beside them."""
    stage, best = explained.stage, explained.best
    rest = [i for i in range(len(best.theta)) if i not in moved]
    parts = (*moved, *((REST,) if any(best.theta[i] for i in rest) else ()))
    exact = len(parts) <= EXACT_MAX
    sizes = range(len(parts) + 1) if exact else (0, len(parts) - 1, len(parts))
    sets = [frozenset(some) for size in sizes for some in combinations(parts, size)]
    theta = np.zeros((len(sets), len(best.theta)))
    for row, some in zip(theta, sets, strict=True):
        for part in some:
            places = rest if part == REST else [part]
            row[places] = best.theta[places]
    gaps = [above(left) for left in lefts_by(stage, best.model, theta, fitted=False)]
    stated = gaps[0]
    closed = {some: 1.0 - gap / stated if stated > 0.0 else 0.0 for some, gap in zip(sets, gaps, strict=True)}
    return shapley(parts, closed.__getitem__)


def _at(machine: MachineFile, path: str) -> float:
    """Return the constant at a path in machine.toml; the mean of one that differs by direction."""
    value: object = machine
    for key in path.split("."):
        value = value[key] if isinstance(value, dict) else getattr(value, key)
    return float(np.mean(np.asarray(value, dtype=np.float64)))


def said_of(constants: Sequence[MovedConstant]) -> str:
    """Return what the constants that take up most are, in words; empty where none is worth one.

    >>> said_of([MovedConstant("axes.y.mass_kg", 320.0, 339.0, 2.1, 0.4)])
    'the mass of Y 6 % larger than stated (2.1 σ)'
    """
    worth = [c for c in constants if c.deviations >= SAID_FROM and c.closure >= SAID_CLOSURE][:SAID_MAX]
    return " and ".join(_words(c) for c in worth)


def _words(constant: MovedConstant) -> str:
    by = constant.found / constant.stated - 1.0
    than = "larger" if by > 0.0 else "smaller"
    return f"{constant_words(constant.name)} {percent(abs(by))} {than} than stated ({constant.deviations:.1f} σ)"
