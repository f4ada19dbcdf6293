"""Which part of a history is fitted and which is judged on: what came first is fitted, what came after it is the judge.

One moment divides them, so that nothing is both. Where there are several days, it lies between two of them; where there is one
stretch only, in the middle of it.
"""

from collections.abc import Sequence
from dataclasses import replace
from typing import NamedTuple

from cnctwin.composing.executions import Execution
from cnctwin.composing.history import Span
from cnctwin.composing.stretches import STRETCH_S_MIN, Stretch

FIT_PART = 2.0 / 3.0
DAY_MS = 86_400_000
NEAR = (0.4, 0.8)
"""Part of a single stretch within which the end of a program is where it is divided."""
ALONE_S_MIN = 2.0 * STRETCH_S_MIN
"""A stretch that is shorter cannot be divided."""


class Division(NamedTuple):
    """at_ms: what ends before it is fitted, what begins there or after is the judge; None where nothing is left to judge on.

    note: how it was divided, a sentence
    """

    at_ms: int | None
    note: str

    def is_fitted(self, span_ms: Span) -> bool | None:
        """Return True for a stretch that is fitted, False for one to judge on; None for one that lies over the moment."""
        if self.at_ms is None or span_ms[1] <= self.at_ms:
            return True
        return False if span_ms[0] >= self.at_ms else None


def divided(stretches: Sequence[Stretch], executions: Sequence[Execution]) -> Division:
    """Return the division of a history by its stretches, or by its programs where there are no stretches."""
    spans = [s.span_ms for s in stretches] or [e.span_ms for e in executions]
    if not spans:
        return Division(None, "")
    if len(spans) > 1:
        lengths = [b - a for a, b in spans]
        whole = sum(lengths)
        before = [sum(lengths[:n]) for n in range(len(spans))]
        later = [n for n in range(1, len(spans)) if spans[n][0] // DAY_MS > spans[n - 1][0] // DAY_MS]
        first = min(later or range(1, len(spans)), key=lambda n: abs(before[n] - FIT_PART * whole))
        share = 100.0 * before[first] / whole
        how = "between two days" if later else "within one day"
        return Division(spans[first][0], f"divided in time, {how}: the first {share:.0f} % of what was recorded are fitted")
    begin, end = spans[0]
    if end - begin < 1000 * ALONE_S_MIN or not stretches:
        return Division(None, "there is too little to be divided: the twin would be judged on what it was fitted to")
    low, high = (begin + part * (end - begin) for part in NEAR)
    wanted = begin + FIT_PART * (end - begin)
    ends = [e.to_ms for e in executions if low <= e.to_ms <= high]
    at_ms = min(ends, key=lambda t: abs(t - wanted), default=round(wanted))
    share = 100.0 * (at_ms - begin) / (end - begin)
    return Division(
        at_ms, f"there is one stretch only, divided in time: its first {share:.0f} % are fitted, the rest is the judge"
    )


def cut_at(stretches: Sequence[Stretch], at_ms: int | None) -> list[Stretch]:
    """Return the stretches, one that lies over the moment as two."""
    found = []
    for one in stretches:
        if at_ms is not None and one.from_ms < at_ms < one.to_ms:
            found += [replace(one, to_ms=at_ms), replace(one, from_ms=at_ms, rested=False)]
        else:
            found.append(one)
    return found
