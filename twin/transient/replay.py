"""A detector over a recorded stream: what the gate did, and what was looked at."""

from collections.abc import Iterator
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from twin.transient.detector import OPEN, Detector, Gate, PatternMatch, Phase
from twin.transient.stream import Stream

APART_S = 1.0
"""Patterns found at samples closer than this are one."""


class Candidate(NamedTuple):
    """A pattern that ended at `at_s`, whatever it is worth."""

    at_s: float
    found: PatternMatch


class Confirmed(NamedTuple):
    """A tool change as the gate saw it.

    begun_s: of the pattern; opened_s: of the provisional gate, None where there was none
    at_s: when it was confirmed; last_s: when it was for the last time, by a later end of the same event
    """

    begun_s: float
    opened_s: float | None
    at_s: float
    last_s: float
    found: PatternMatch


@dataclass(frozen=True, slots=True)
class Outcome:
    """The outcome of a stream. opened_s: each time that the provisional gate opened; active: (n,), whether any gate was open."""

    confirmed: tuple[Confirmed, ...]
    opened_s: tuple[float, ...]
    active: NDArray[np.bool_]


def replayed(detector: Detector, stream: Stream) -> Outcome:
    """Run the gate over a stream."""
    state, before = detector.begun(), Gate()
    confirmed: list[Confirmed] = []
    opened: list[float] = []
    active = np.zeros(len(stream.values), dtype=bool)
    for n, (value, feed, block) in enumerate(_rows(stream)):
        state, found = detector.advanced(state, value, feed, block)
        gate, at_s = state.gate, stream.begin_s + n * stream.period_s
        active[n] = gate.phase in OPEN
        if gate.phase is Phase.PROVISIONAL and gate.opened != before.opened:
            opened.append(at_s)
        if found is not None:
            begun_s = at_s - found.begun_samples * stream.period_s
            opened_s = opened[-1] if before.phase is Phase.PROVISIONAL else None
            confirmed.append(Confirmed(begun_s, opened_s, at_s, at_s, found))
        elif gate.after != before.after:
            confirmed[-1] = confirmed[-1]._replace(last_s=at_s)
        before = gate
    return Outcome(tuple(confirmed), tuple(opened), active)


def candidates(detector: Detector, stream: Stream) -> Iterator[Candidate]:
    """The best of each group of patterns that end within APART_S of each other, confirmed or not."""
    state, best, last_s = detector.begun(), None, 0.0
    for n, (value, feed, block) in enumerate(_rows(stream)):
        state, found = detector.searched(state, value, feed, block)
        at_s = stream.begin_s + n * stream.period_s
        if best is not None and at_s - last_s > APART_S:
            yield best
            best = None
        if found is not None:
            last_s = at_s
            if best is None or found.score > best.found.score:
                best = Candidate(at_s, found)
    if best is not None:
        yield best


def _rows(stream: Stream) -> Iterator[tuple[float, float, float]]:
    return zip(stream.values.tolist(), stream.feed_rest.tolist(), stream.block_stand.tolist(), strict=True)
