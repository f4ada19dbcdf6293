"""When a score is an alarm: dwell before it, hysteresis after it.

    on:  score ≥ threshold in `dwell_ticks` ticks in a row
    off: score < clear_fraction · threshold in the last `calm_ticks` ticks that were judged

A dwell of k ticks is a running minimum over k ticks that reaches the threshold (`dwell_score`); thresholds are fitted on that. A
tick that is gated or has no score is no evidence, neither that a fault came nor that it went: it interrupts the first count and
the second one waits. So a fault that stands through a tool change is one alarm, one that comes in a gate is one `dwell_ticks`
after it, and one that shows in every part is one alarm where `calm_ticks` is longer than a part.
"""

from dataclasses import dataclass
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import NDArray


@dataclass(frozen=True, slots=True)
class AlarmRule:
    """calm_ticks: 0 = as many as `dwell_ticks`, in a row.

    Raises ValueError where the threshold is not above 0, the dwell below one tick, or the fraction not within 0 and 1.
    """

    threshold: float
    dwell_ticks: int = 3
    clear_fraction: float = 0.8
    calm_ticks: int = 0

    def __post_init__(self) -> None:
        if not self.threshold > 0.0:
            raise ValueError(f"threshold is {self.threshold!r}; it has to be above 0, where a gated or common score is put")
        if self.dwell_ticks < 1:
            raise ValueError(f"dwell_ticks is {self.dwell_ticks!r}; one tick is the least")
        if not 0.0 < self.clear_fraction <= 1.0:
            raise ValueError(f"clear_fraction is {self.clear_fraction!r}; it has to be above 0 and at most 1")
        if self.calm_ticks < 0:
            raise ValueError(f"calm_ticks is {self.calm_ticks!r}; 0 is the least")


@dataclass(frozen=True, slots=True)
class AlarmState:
    """is_on: the alarm; high_ticks, calm_ticks: ticks in a row at the threshold, and below what clears, as far as they count."""

    is_on: bool = False
    high_ticks: int = 0
    calm_ticks: int = 0


def after_tick(rule: AlarmRule, state: AlarmState, score: float | None, is_gated: bool) -> AlarmState:
    """The state after one more tick; score None = not known.

    >>> rule, state = AlarmRule(threshold=2.0, dwell_ticks=2), AlarmState()
    >>> for score in (3.0, 3.0, 1.7, 0.0):
    ...     state = after_tick(rule, state, score, False)
    >>> state
    AlarmState(is_on=True, high_ticks=0, calm_ticks=1)
    >>> after_tick(rule, state, 0.0, False).is_on
    False
    """
    if score is None or is_gated:
        return AlarmState(state.is_on, 0, state.calm_ticks if rule.calm_ticks else 0)
    calm_ticks = rule.calm_ticks or rule.dwell_ticks
    high = min(state.high_ticks + 1, rule.dwell_ticks) if score >= rule.threshold else 0
    calm = min(state.calm_ticks + 1, calm_ticks) if score < rule.clear_fraction * rule.threshold else 0
    return AlarmState(high >= rule.dwell_ticks or (state.is_on and calm < calm_ticks), high, calm)


def is_alarm(rule: AlarmRule, scores: "NDArray[np.float64]", gated: "NDArray[np.bool_]") -> "NDArray[np.bool_]":
    """Return the ticks at which the alarm is on, of scores (T,) or (T, N), NaN = not known; as folding `after_tick` does."""
    import numpy as np  # noqa: PLC0415  the stream needs none

    high = dwell_score(scores, gated, rule.dwell_ticks) >= rule.threshold
    low = calm_score(scores, gated, rule.dwell_ticks, rule.calm_ticks) < rule.clear_fraction * rule.threshold
    place = np.arange(len(scores)).reshape(-1, *[1] * (scores.ndim - 1))
    raised = np.maximum.accumulate(np.where(high, place, -1), axis=0)
    cleared = np.maximum.accumulate(np.where(low, place, -1), axis=0)
    return np.asarray(raised > cleared, dtype=np.bool_)


def onsets(is_on: "NDArray[np.bool_]") -> "NDArray[np.intp]":
    """Ticks at which an alarm (T,) comes on.

    >>> import numpy as np
    >>> onsets(np.array([False, True, True, False, True])).tolist()
    [1, 4]
    """
    import numpy as np  # noqa: PLC0415

    return np.flatnonzero(np.diff(is_on.astype(np.int8), prepend=np.int8(0)) == 1)


def dwell_score(scores: "NDArray[np.float64]", gated: "NDArray[np.bool_]", dwell_ticks: int) -> "NDArray[np.float64]":
    """The least of the last `dwell_ticks` scores: what has to reach the threshold. −inf where one is gated or not known.

    >>> import numpy as np
    >>> dwell_score(np.array([1.0, 3.0, 2.0, 5.0]), np.zeros(4, bool), 2).tolist()
    [-inf, 1.0, 2.0, 2.0]
    """
    import numpy as np  # noqa: PLC0415

    known = np.where(gated | np.isnan(scores), -np.inf, scores)
    least = known.copy()
    for back in range(1, min(dwell_ticks, len(known))):
        least[back:] = np.minimum(least[back:], known[:-back])
    least[: dwell_ticks - 1] = -np.inf
    return np.asarray(least, dtype=np.float64)


def calm_score(
    scores: "NDArray[np.float64]", gated: "NDArray[np.bool_]", dwell_ticks: int, calm_ticks: int
) -> "NDArray[np.float64]":
    """The largest of the last `calm_ticks` judged scores, (T,) or (T, N), which has to be below what clears; ∞ = not known.

    >>> import numpy as np
    >>> calm_score(np.array([1.0, 3.0, 2.0, 0.5, 1.0]), np.array([False, False, True, False, False]), 1, 2).tolist()
    [inf, 3.0, inf, 3.0, 1.0]
    """
    import numpy as np  # noqa: PLC0415

    if not calm_ticks:
        return -dwell_score(-scores, gated, dwell_ticks)
    if scores.ndim > 1:
        columns = [calm_score(scores[:, at], gated[:, at], dwell_ticks, calm_ticks) for at in range(scores.shape[1])]
        return np.stack(columns, axis=1)
    found = np.full(len(scores), np.inf)
    judged = np.flatnonzero(~(gated | np.isnan(scores)))
    if len(judged) >= calm_ticks:
        known = scores[judged]
        block = np.concatenate([known, np.full(-len(known) % calm_ticks, -np.inf)]).reshape(-1, calm_ticks)
        ahead = np.maximum.accumulate(block, axis=1).ravel()
        behind = np.maximum.accumulate(block[:, ::-1], axis=1)[:, ::-1].ravel()
        last = len(known) - calm_ticks + 1
        found[judged[calm_ticks - 1 :]] = np.maximum(behind[:last], ahead[calm_ticks - 1 : len(known)])
    return found
