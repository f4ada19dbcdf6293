"""The number of machines that one core holds, from trials with several numbers."""

from collections.abc import Sequence
from itertools import pairwise
from typing import Any

KEPT_PCT = 99.0


def by_time(trials: Sequence[dict[str, Any]]) -> float | None:
    """Return the number of machines at which the processors take a whole core, on the line through the trials on both sides.

    Only trials that kept up are asked, and the line is drawn on past the last of them.

    >>> made = [{"machines": n, "used": {"processors": {"cores": c}}, "in_time_pct": 100.0} for n, c in ((10, 0.2), (20, 0.3))]
    >>> round(by_time(made))
    90
    """
    spent: dict[int, list[float]] = {}
    for one in trials:
        if has_kept_up(one):
            spent.setdefault(one["machines"], []).append(one["used"]["processors"]["cores"])
    points = sorted((machines, sum(cores) / len(cores)) for machines, cores in spent.items())
    if not points:
        return None
    if len(points) == 1:
        return points[0][0] / points[0][1]
    pairs = list(pairwise(points))
    (low, low_cores), (high, high_cores) = next((pair for pair in pairs if pair[1][1] >= 1.0), pairs[-1])
    if high_cores <= low_cores:
        return high / high_cores
    return low + (high - low) * (1.0 - low_cores) / (high_cores - low_cores)


def in_time(trials: Sequence[dict[str, Any]]) -> int | None:
    """Return the largest number of machines of which 99 % of the values reached the reader within a second."""
    return max((t["machines"] for t in trials if has_kept_up(t)), default=None)


def has_kept_up(trial: dict[str, Any]) -> bool:
    """Return True if 99 % of the values came in time, or none was asked for and the processors have dealt with what came."""
    share = trial["in_time_pct"]
    return share >= KEPT_PCT if share is not None else (trial.get("folded_share") or 0.0) > 0.95


def told(trials: Sequence[dict[str, Any]]) -> str:
    """Return both as a sentence."""
    machines, largest = by_time(trials), in_time(trials)
    if machines is None:
        return "no trial kept up"
    return (
        f"a core holds {machines:.0f} machines by its time; {largest} is the largest trial that had 99 % of the values within 1 s"
    )
