"""The size of an effect: rms of what it changes in a signal, over what two healthy runs of a program differ by (over √2)."""

from collections.abc import Callable, Mapping, Sequence
from math import exp, log

import numpy as np

from cnctwin.standins.reference_machine.recording import Columns

STEPS_MAX = 24
RIGHT = 0.03
"""A size is met where it is off by no more than this part."""


def signals(columns: Columns) -> tuple[str, ...]:
    """Return the readings of the sensors: the columns in single precision."""
    return tuple(name for name, values in columns.items() if values.dtype == np.float32)


def rms_by_signal(runs: Sequence[Columns], others: Sequence[Columns]) -> dict[str, float]:
    """Root mean square of the difference of runs, pair by pair, over all of a signal's samples."""
    squares: dict[str, list[float]] = {}
    for run, other in zip(runs, others, strict=True):
        for name in signals(run):
            if name in other:
                difference = run[name].astype(np.float64) - other[name].astype(np.float64)
                kept = difference[np.isfinite(difference)]
                total = squares.setdefault(name, [0.0, 0.0])
                total[0] += float(np.sum(kept**2))
                total[1] += len(kept)
    return {name: float(np.sqrt(total / max(count, 1.0))) for name, (total, count) in squares.items()}


def sizes(changed: Mapping[str, float], floors: Mapping[str, float]) -> dict[str, float]:
    """Signal → rms over its floor; signals that are not changed at all are left out."""
    return {name: value / floors[name] for name, value in changed.items() if value > 0.0 and floors.get(name, 0.0) > 0.0}


def amplitude_for(target: float, size_of: Callable[[float], float], most: float, least: float = 1e-4) -> float:
    """The amplitude of which `size_of` is the target, by secants of the logarithms in a bracket; else one of its ends.

    >>> round(amplitude_for(8.0, lambda a: 2.0 * a**1.5, 30.0), 2)
    2.52
    """
    low, high = log(least), log(most)
    at = min(0.0, high)
    before: tuple[float, float] | None = None
    for _ in range(STEPS_MAX):
        away = log(max(size_of(exp(at)), 1e-9) / target)
        if abs(away) < RIGHT or (at == log(most) and away < 0.0) or high - low < RIGHT:
            break
        low, high = (low, min(high, at)) if away > 0.0 else (max(low, at), high)
        slope = 1.0 if before is None or away == before[1] else (away - before[1]) / (at - before[0])
        before = (at, away)
        guess = at - away / slope if slope > 0.2 else 0.5 * (low + high)
        inside = low < guess < high or (guess >= high == log(most))
        at = min(guess, high) if inside else 0.5 * (low + high)
    return exp(at)
