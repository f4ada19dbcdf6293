"""The sum of the verdicts: how many of the last alarms were true, a threshold that would have been better, and what is published.

    precision = (true + known) / verdicts of the last `ALARMS_MAX` alarms that have one, with Wilson's interval of 90 %
    suggested = 0.95 · the smallest score of an alarm that was true or known, where that would have dropped false alarms

A known cause is a cause: its alarm was no false one. From `VERDICTS_MIN` verdicts on a threshold is suggested, never set: that is
a person's business (`threshold` in processors.toml). A lower one is never suggested, since nobody is asked about silence.
"""

import json
import math
from typing import Any, NamedTuple

from twin.anomaly.parts.alarms.episodes import FALSE, Episode, Memory, all_of
from twin.anomaly.parts.alarms.limits import Tolerated, factor_at
from twin.anomaly.parts.alarms.signature import NAME_MAX

ALARMS_MAX = 50
VERDICTS_MIN = 10
KEEPS = 0.95
Z_OF_90_PCT = 1.6449
SHOWN_MAX = 6
COMPACT: dict[str, Any] = {"ensure_ascii": False, "separators": (",", ":")}
TEXT_CHARACTERS_MAX = 3_900
"""The interface cuts texts at 4,000."""


class Precision(NamedTuple):
    """The share of alarms that were true, of `verdicts` that were given."""

    true: int
    verdicts: int
    low: float
    high: float

    def __str__(self) -> str:
        share = f"{self.true / self.verdicts:.2f} ({self.low:.2f}–{self.high:.2f})"
        return f"{self.true} of the last {self.verdicts} alarms with a verdict were true: {share}"


class Suggestion(NamedTuple):
    """A threshold that would have kept all alarms that were true, and dropped so many of the false ones."""

    threshold: float
    dropped: int
    false: int

    def __str__(self) -> str:
        return (
            f"threshold {self.threshold:g} would have kept all true alarms and dropped {self.dropped} of {self.false} false ones"
        )


def precision(memory: Memory) -> Precision | None:
    """Return how many of the last alarms were true; None without a verdict."""
    told = _told(memory)
    if not told:
        return None
    true = sum(_is_true(one) for one in told)
    return Precision(true, len(told), *wilson(true, len(told)))


def wilson(hits: int, of: int) -> tuple[float, float]:
    """Return Wilson's interval of a share, 90 %.

    >>> [round(end, 2) for end in wilson(9, 14)]
    [0.43, 0.81]
    """
    share, z2 = hits / of, Z_OF_90_PCT**2
    middle = (share + z2 / (2.0 * of)) / (1.0 + z2 / of)
    half = math.sqrt(z2 * (share * (1.0 - share) / of + z2 / (4.0 * of * of))) / (1.0 + z2 / of)
    return max(0.0, middle - half), min(1.0, middle + half)


def suggested(memory: Memory) -> Suggestion | None:
    """Return the threshold that the verdicts speak for; None where they are too few, or none would do better."""
    told = _told(memory)
    true, false = [one.score for one in told if _is_true(one)], [one.score for one in told if not _is_true(one)]
    if len(told) < VERDICTS_MIN or not true or not false:
        return None
    threshold = float(f"{KEEPS * min(true):.3g}")
    dropped = sum(score < threshold for score in false)
    return Suggestion(threshold, dropped, len(false)) if dropped and threshold > told[-1].threshold else None


def told_of(memory: Memory, at_s: float) -> str:
    """Return what is published of the memory, as JSON: the last alarms with who said what, raised limits, outcomes."""
    share, better = precision(memory), suggested(memory)
    raised = [one for one in memory.tolerated if factor_at(one, at_s) > 1.0]
    lists = {
        "alarms": [_alarm(memory, one) for one in reversed(all_of(memory)[-SHOWN_MAX:])],
        "limits": [_limit(one) for one in reversed(raised[-SHOWN_MAX:])],
        "outcomes": [one._asdict() for one in reversed(memory.outcomes[-SHOWN_MAX:])],
    }
    counts = {"remembered": len(all_of(memory)), "raised": len(raised)}
    sums = {"precision": None if share is None else str(share), "suggestion": None if better is None else str(better)}
    while len(text := json.dumps({"version": 1, **lists, **counts, **sums}, **COMPACT)) > TEXT_CHARACTERS_MAX:
        max(lists.values(), key=len).pop()
    return text


def _alarm(memory: Memory, one: Episode) -> dict[str, Any]:
    said = one.said
    verdict = None if said is None else {"verdict": said.verdict, "label": said.label, "by": said.by, "at_s": said.at_s}
    state = "over" if one.is_over else "on"
    if one.began_s in memory.standing:
        state = "stands"
    elif one.began_s in memory.known:
        state = "held back"
    return {
        "alarm_at_s": one.began_s,
        "ended_s": one.seen_s if one.is_over else None,
        "operation": one.signature.operation,
        "signals": [f"{share.signal}, {share.scale}" for share in one.signature.shares[:3]],
        "state": state,
        "said": verdict,
    }


def _limit(one: Tolerated) -> dict[str, Any]:
    return {
        "operation": ", ".join(one.operations)[:NAME_MAX],
        "signal": one.signal,
        "scale": one.scale,
        "side": "above" if one.side > 0 else "below",
        "factor": one.factor,
        "since_s": one.since_s,
        "by": one.by,
    }


def _told(memory: Memory) -> list[Episode]:
    """Return the last alarms that have a verdict, oldest first."""
    return [one for one in all_of(memory) if one.said is not None][-ALARMS_MAX:]


def _is_true(one: Episode) -> bool:
    return one.said is not None and one.said.verdict != FALSE
