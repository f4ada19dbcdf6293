"""The stretches of a machine's history in which its heat and load can be followed: from one long rest of the spindle to the next.

A stretch begins shortly before the spindle turns after a rest, so that its reading of the temperature is steady, and has the
cool-down after it. It never goes over a hole in the recording, nor over a time in which the spindle's speed was not known.
"""

from collections.abc import Iterator
from dataclasses import dataclass
from itertools import pairwise

from cnctwin.composing.history import COOLANT, RPM, TEMPERATURE, Between, History, Span

REST_S, COOLING_S = 1200.0, 10_800.0
"""Standstill after which a spindle begins again, and as much of it as is worth keeping."""
LEAD_S = 60.0
SILENCE_S = 600.0
"""Nothing told for so long is a hole: a day off, a recorder that stood."""
STRETCH_S_MAX, STRETCH_S_MIN = 14_400.0, 30.0
TURNING_RPM, TURNING_PART = 1.0, 0.05
"""A spindle turns above this speed, and above this part of the fastest that it had: jogging is rest."""
COOLS_PART = 0.3
"""Part of a stretch up to which a spindle that turns only at its beginning has cooled down rather than worked."""


@dataclass(frozen=True, slots=True)
class Stretch(Between):
    """A stretch of history. rested: it begins with a spindle that had stood long; turning: part of it in which it turned"""

    rested: bool
    turning: float

    @property
    def what(self) -> str:
        """Return what it is, in words."""
        if self.turning <= 0.0:
            return "cool-down"
        if self.rested:
            return "warm-up"
        return "cool-down" if self.turning < COOLS_PART else "production"


def stretches_of(history: History) -> list[Stretch]:
    """Return the stretches of a history in order; none of them overlap."""
    found = []
    turning_rpm = _turning_rpm(history)
    for part in _unbroken(history):
        cuts, rested = _between_rests(history, part, turning_rpm)
        for (begin, end), after_rest in zip(cuts, rested, strict=True):
            pieces = max(1, -int(-(end - begin) // (1000 * STRETCH_S_MAX)))
            edges = [begin + (end - begin) * n // pieces for n in range(pieces + 1)]
            for n, (a, b) in enumerate(pairwise(edges)):
                if b - a >= 1000 * STRETCH_S_MIN:
                    turned = sum(d - c for c, d, turns in _turning(history, (a, b), turning_rpm) if turns)
                    found.append(Stretch(a, b, after_rest and n == 0, turned / (b - a)))
    return found


def worth(history: History, span_ms: Span) -> tuple[int, float]:
    """Return how much a stretch can show: coolant that was switched, then degrees that the spindle went through."""
    switched = len(set(history.course(COOLANT).numbers(span_ms))) > 1
    shown = history.course(TEMPERATURE).numbers(span_ms)
    return int(switched), max(shown) - min(shown) if shown else 0.0


def turning_of(history: History) -> list[Span]:
    """Return the spans in which the spindle turned, in order."""
    whole = history.from_ms, history.to_ms
    return [(a, b) for a, b, turns in _turning(history, whole, _turning_rpm(history)) if turns]


def _turning_rpm(history: History) -> float:
    """Return the speed from which on the spindle is said to turn."""
    fastest = max((abs(v) for v in history.course(RPM).numbers((history.from_ms, history.to_ms))), default=0.0)
    return max(TURNING_RPM, TURNING_PART * fastest)


def _turns(rpm: object, turning_rpm: float) -> bool:
    return isinstance(rpm, int | float) and abs(rpm) >= turning_rpm


def _unbroken(history: History) -> Iterator[Span]:
    """Yield the parts of a history without a hole."""
    told = [history.from_ms, *history.told_ms] if history.told_ms[0] - history.from_ms < 1000 * SILENCE_S else [*history.told_ms]
    edges = [told[0]]
    for before, after in pairwise(told):
        if after - before > 1000 * SILENCE_S:
            edges += [before + history.window_ms, after]
    edges.append(min(told[-1] + history.window_ms, history.to_ms))
    for begin, end in zip(edges[::2], edges[1::2], strict=True):
        yield from _known(history, (begin, end))


def _known(history: History, span_ms: Span) -> Iterator[Span]:
    """Yield the parts of a stretch in which the speed of the spindle is known, but for short whiles."""
    begin = span_ms[0]
    for a, b, rpm in history.course(RPM).pieces(span_ms):
        if rpm is None and b - a > 1000 * SILENCE_S:
            if a > begin:
                yield begin, a
            begin = b
    if begin < span_ms[1]:
        yield begin, span_ms[1]


def _between_rests(history: History, span_ms: Span, turning_rpm: float) -> tuple[list[Span], list[bool]]:
    """Return the stretches of a part, each with the cool-down after it, and of each if it begins after a rest."""
    lead_ms, cooling_ms = round(1000 * LEAD_S), round(1000 * COOLING_S)
    rests = [(a, b) for a, b, turns in _turning(history, span_ms, turning_rpm) if not turns and b - a >= 1000 * REST_S]
    if rests == [span_ms]:
        return [span_ms], [False]
    cuts, rested = [], []
    begin, after_rest = span_ms[0], _stood_before(history, span_ms[0], turning_rpm)
    for a, b in rests:
        is_last = b >= span_ms[1]
        if a > begin:
            cuts.append((begin, min(b if is_last else b - lead_ms, a + cooling_ms)))
            rested.append(after_rest)
        if is_last:
            return cuts, rested
        begin, after_rest = b - lead_ms, True
    return [*cuts, (begin, span_ms[1])], [*rested, after_rest]


def _stood_before(history: History, at_ms: int, turning_rpm: float) -> bool:
    """Return True where the spindle stands at a moment and stood through the hole before it."""
    before = max((t for t in history.told_ms if t < at_ms), default=None)
    if before is None or at_ms - before < 1000 * REST_S:
        return False
    return not any(_turns(history.course(RPM).at(t), turning_rpm) for t in (before + history.window_ms - 1, at_ms))


def _turning(history: History, span_ms: Span, turning_rpm: float) -> Iterator[tuple[int, int, bool]]:
    """Yield (from, to, turning) over a stretch; a speed that is not known for a while is what it was before."""
    begun, turns = span_ms[0], _turns(history.course(RPM).at(span_ms[0]), turning_rpm)
    for a, _, rpm in history.course(RPM).pieces(span_ms):
        now = turns if rpm is None else _turns(rpm, turning_rpm)
        if now != turns:
            yield begun, a, turns
            begun, turns = a, now
    yield begun, span_ms[1], turns
