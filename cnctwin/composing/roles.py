"""The parts of a history that are fitted and judged on: what came first is fitted, what came after it is the judge.

One moment divides them, so that nothing is both. Where there are several days, it lies between two of them; else between two
stretches, or in the middle of one where no end of a stretch divides them well.
"""

from collections.abc import Sequence
from dataclasses import replace
from typing import NamedTuple

from cnctwin.composing.executions import Execution
from cnctwin.composing.history import Span
from cnctwin.composing.stretches import STRETCH_S_MIN, Stretch

FIT_PART = 2.0 / 3.0
DAY_MS = 86_400_000
BETWEEN_DAYS, BETWEEN_STRETCHES, WITHIN = (0.25, 0.9), (0.5, 0.85), (0.4, 0.8)
"""Part of what was recorded that may be fitted: where days divide it, where stretches do, where the end of a program does."""
TURNING_MIN = 0.1
"""Part of the time in which the spindle turned that the judge has to have."""
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


def divided(stretches: Sequence[Stretch], executions: Sequence[Execution], turning: Sequence[Span] = ()) -> Division:
    """Return the division of a history by its stretches, or by its programs where there are no stretches.

    turning: the spans in which the spindle turned. A judge in which it never does cannot tell how it heats, so a single stretch
    is divided by the time that it turned where it stood at the end.
    """
    spans = [s.span_ms for s in stretches] or [e.span_ms for e in executions]
    if not spans:
        return Division(None, "")
    whole = sum(b - a for a, b in spans)
    before = [sum(b - a for a, b in spans[:n]) / whole for n in range(len(spans))]
    later = [n for n in range(1, len(spans)) if spans[n][0] // DAY_MS > spans[n - 1][0] // DAY_MS]
    for some, (least, most), how in (
        (later, BETWEEN_DAYS, "between two days"),
        (range(1, len(spans)), BETWEEN_STRETCHES if stretches else (0.0, 1.0), "between two stretches of a day"),
    ):
        fair = [n for n in some if least <= before[n] <= most]
        if fair:
            first = min(fair, key=lambda n: abs(before[n] - FIT_PART))
            share = 100.0 * before[first]
            return Division(spans[first][0], f"divided in time, {how}: the first {share:.0f} % of what was recorded are fitted")
    if whole < 1000 * ALONE_S_MIN or not stretches:
        return Division(None, "there is too little to be divided: the twin would be judged on what it was fitted to")
    at_ms = _within(spans, whole, executions)
    turned = [(a, b) for a, b in turning if any(c <= a and b <= d for c, d in spans)]
    total, after = (sum(b - max(a, t) for a, b in turned if b > t) for t in (0, at_ms))
    if after < TURNING_MIN * total:
        at_ms = min(at_ms, _moment(turned, FIT_PART * total))
    share = 100.0 * sum(max(0, min(b, at_ms) - a) for a, b in spans) / whole
    which = "there is one stretch only" if len(spans) == 1 else "a single stretch is most of it"
    return Division(at_ms, f"{which}, divided in time: the first {share:.0f} % are fitted, the rest is the judge")


def _within(spans: Sequence[Span], whole: int, executions: Sequence[Execution]) -> int:
    """Return a moment within a stretch, at the end of a program where there is one near."""
    low, wanted, high = (_moment(spans, part * whole) for part in (WITHIN[0], FIT_PART, WITHIN[1]))
    ends = [e.to_ms for e in executions if low <= e.to_ms <= high]
    return min(ends, key=lambda t: abs(t - wanted), default=wanted)


def _moment(spans: Sequence[Span], recorded: float) -> int:
    """Return the moment up to which so many milliseconds were recorded."""
    for begin, end in spans:
        if recorded <= end - begin:
            return round(begin + recorded)
        recorded -= end - begin
    return spans[-1][1]


def cut_at(stretches: Sequence[Stretch], at_ms: int | None) -> list[Stretch]:
    """Return the stretches, one that lies over the moment as two."""
    found = []
    for one in stretches:
        if at_ms is not None and one.from_ms < at_ms < one.to_ms:
            found += [replace(one, to_ms=at_ms), replace(one, from_ms=at_ms, rested=False)]
        else:
            found.append(one)
    return found
