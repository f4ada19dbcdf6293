"""The detector: a matched filter bank in two parts, an amplitude check, a warped comparison, and a gate that opens early.

    beginning seen  -> provisional: the gate opens while the change may be going on
    whole pattern   -> confirmed: beginning and end fit together, the size is right, what lies between looks right
    no end in time  -> retracted

A pattern begins after the last one that was confirmed; one that ends within the template's length after it belongs to the same
event, and holds the gate open. One that looks complete before a captured change would be is held open for as long as that.
Times are in samples of period_s.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from enum import StrEnum
from functools import cached_property
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from twin.transient.evidence import BLOCK, FEED, KINDS, Weighing, longest, probability
from twin.transient.history import OTHERS, SAMPLES, History
from twin.transient.level import QUANTA, level
from twin.transient.matching import append, best_parts, best_pattern
from twin.transient.template import SAMPLES_MAX, Template
from twin.transient.warping import BAND, shape_of, warped_distance

Floats = NDArray[np.float64]
FEATURES = ("correlation", "likeness", f"{FEED} at rest", f"{BLOCK} stands")
"""Features that weigh the evidence: rho of the pattern, 1 − half its warped distance, and the two run lengths."""
HAVE_TYPICAL = (False, False, True, True)
"""Which of them should be neither smaller nor larger than in the captures."""

MATCHED_S = 0.04
"""Least time between two searches for a pattern that takes seconds, however finely it is sampled."""
DISTANCE_ANY = 2.0
"""No two standardised shapes are further apart along the best path."""


class Phase(StrEnum):
    """The phase of a tool change, as known now."""

    NONE = "none"
    PROVISIONAL = "provisional"
    CONFIRMED = "confirmed"
    RETRACTED = "retracted"


OPEN = (Phase.PROVISIONAL, Phase.CONFIRMED)
"""In these the gate is open."""


@dataclass(frozen=True, slots=True)
class Limits:
    """From which values on something counts.

    start_rho, end_rho: of the two parts; pattern_score: of the whole, at the stated rate of false gates
    distance_max: of the warped comparison; deviation_min, deviation_max: of the pattern, captured transients = 1
    """

    start_rho: float
    end_rho: float
    pattern_score: float
    distance_max: float
    deviation_min: float
    deviation_max: float


class PatternMatch(NamedTuple):
    """A pattern that ends now. begun_samples: since its beginning; features: as FEATURES, None = not known."""

    rho: float
    distance: float
    stretch: float
    begun_samples: int
    feed_at_rest: float | None
    block_stands: float | None
    logit: float | None

    @property
    def score(self) -> float:
        """rho of beginning and end, times the correlation along the warped path: 1 − distance² / 2, as both are standardised."""
        return self.rho * (1.0 - 0.5 * self.distance * self.distance)


class Gate(NamedTuple):
    """The phase, in samples since the stream began.

    until: the phase ends there; opened: the present or last provisional one; after: the last confirmed pattern ended there
    is_low: the correlation of the beginning has been low since it last opened the gate
    """

    phase: Phase = Phase.NONE
    until: int = 0
    opened: int = 0
    after: int = 0
    is_low: bool = True
    confidence: float = 0.0


class State(NamedTuple):
    """The state that the future depends on."""

    history: History
    gate: Gate


@dataclass(frozen=True, eq=False)
class Detector:
    """A template with its limits. scale: deviation of the captured transients, in the level of `signal`.

    weighing: where other signals may speak; it then decides in place of pattern_score and distance_max, while they are known
    shown_s: how long the outcome stays on view
    """

    signal: str
    template: Template
    scale: float
    limits: Limits
    weighing: Weighing | None = None
    shown_s: float = 2.0

    @cached_property
    def quantum(self) -> float:
        """Level of one quantum."""
        return self.scale / QUANTA

    @cached_property
    def shape(self) -> Floats:
        """The whole template, ready to be compared."""
        return np.asarray(shape_of(self.template.whole))

    @cached_property
    def shown(self) -> int:
        """Samples for which an outcome is on view."""
        return max(1, round(self.shown_s / self.template.period_s))

    @cached_property
    def patience(self) -> int:
        """Samples after the beginning within which the pattern has to be whole."""
        terms = self.template.bank.terms
        return int((terms[1] + terms[3]).max())

    @cached_property
    def limits_in_quanta(self) -> tuple[float, float]:
        """The limits of the deviation, in quanta."""
        return self.limits.deviation_min * QUANTA, self.limits.deviation_max * QUANTA

    def begun(self) -> State:
        """The state before the first sample."""
        return State(History.empty(self.template.bank.samples + 1, len(KINDS)), Gate())

    def with_score(self, score: float) -> "Detector":
        """The detector that, by the signal alone, confirms every pattern of that score, whatever its distance."""
        return replace(self, limits=replace(self.limits, pattern_score=score, distance_max=DISTANCE_ANY))

    def warmed_up(self) -> None:
        """Compile all that is compiled when it is first called, so that no sample waits for it."""
        state = self.begun()
        for value in [*self.template.whole.tolist(), *self.template.whole.tolist()]:
            state, _ = self.searched_level(state, value * self.scale, -1.0, -1.0)

    @property
    def samples_min(self) -> int:
        """Before so many have come, nothing can be said: a change may have been going on."""
        return round(self.template.seconds / self.template.period_s)

    def advanced(self, state: State, value: float, feed_rest: float, block_stand: float) -> tuple[State, PatternMatch | None]:
        """The state after one sample: `value` of the signal, and the run lengths as of now. With what was confirmed by it."""
        state, found = self.searched(state, value, feed_rest, block_stand)
        if found is None or not self.confirms(found):
            return state, None
        is_new = state.gate.after == 0 or state.history.seen - state.gate.after > self.samples_min
        return self._confirmed(state, found), found if is_new else None

    def confirms(self, found: PatternMatch) -> bool:
        """Return True where this is a tool change."""
        if found.logit is not None:
            return found.logit >= 0.0
        return found.score >= self.limits.pattern_score and found.distance <= self.limits.distance_max

    def searched(self, state: State, value: float, feed_rest: float, block_stand: float) -> tuple[State, PatternMatch | None]:
        """The state after one sample, unconfirmed, and the best pattern that ends now, whatever it is worth."""
        return self.searched_level(state, level(self.signal, value), feed_rest, block_stand)

    def searched_level(
        self, state: State, level_now: float, feed_rest: float, block_stand: float
    ) -> tuple[State, PatternMatch | None]:
        """As `searched`, where the level is known already."""
        history, gate = state
        history = history.with_room()
        weights, terms, low, high, quantum, hop, out = self._running
        rows, end, _, seen = history
        append(rows, end, level_now / quantum, feed_rest, block_stand)
        history = history.grown()
        if (seen + 1) % hop:
            return State(history, gate), None
        rho_start, rho_end = best_parts(rows, end + 1, weights, terms, low, high, out)
        if rho_start >= self.limits.start_rho or gate.until or not gate.is_low:
            gate = self._phased(gate, seen + 1, rho_start)
        state = State(history, gate)
        if rho_end < self.limits.end_rho:
            return state, None
        return state, self._found(state)

    @cached_property
    def _running(self) -> tuple[Floats, Floats, float, float, float, int, Floats]:
        """Return what each sample needs. The last is scratch: nothing in it outlives a sample."""
        bank = self.template.bank
        out = np.zeros((4, bank.terms.shape[1]))
        hop = max(1, int(MATCHED_S / self.template.period_s + 1e-9))
        return bank.weights, bank.terms, *self.limits_in_quanta, self.quantum, hop, out

    @cached_property
    def _start_samples(self) -> int:
        """A beginning that is seen so soon after a confirmed pattern is a part of that."""
        return int(self.template.bank.terms[0].max())

    def _phased(self, gate: Gate, now: int, rho: float) -> Gate:
        """The gate as of sample `now`, where the correlation of the beginning is `rho`."""
        phase, until, opened, after, is_low, confidence = gate
        is_begun = rho >= self.limits.start_rho and now - after >= self._start_samples
        if until and now >= until:
            if phase is Phase.PROVISIONAL:
                phase, until = Phase.RETRACTED, now + self.shown
            else:
                phase, until, confidence = Phase.NONE, 0, 0.0
        if is_begun and phase is Phase.PROVISIONAL:
            if is_low or rho > confidence:
                until, confidence = min(now + self.patience, opened + 3 * self.patience), rho
        elif is_begun and is_low:
            phase, until, opened, confidence = Phase.PROVISIONAL, now + self.patience, now, rho
        return Gate(phase, until, opened, after, not is_begun, confidence)

    def _confirmed(self, state: State, found: PatternMatch) -> State:
        confidence = found.score if found.logit is None else probability(found.logit)
        now = state.history.seen
        until = self.shown + max(now, now - found.begun_samples + self.samples_min)
        gate = state.gate._replace(phase=Phase.CONFIRMED, until=until, after=now, confidence=confidence, is_low=False)
        return State(state.history, gate)

    def _found(self, state: State) -> PatternMatch | None:
        """The best pattern that ends now."""
        history, bank, template = state.history, self.template.bank, self.template
        low, high = self.limits_in_quanta
        since = max(0, history.end - (history.seen - state.gate.after))
        rho, k, gap, deviation = best_pattern(
            history.rows, history.end, since, self.limits.end_rho, bank.weights, bank.terms, self._running[-1]
        )
        if rho < 0.0 or not low <= deviation <= high:
            return None
        d, r = int(bank.terms[0, k]), int(bank.terms[1, k])
        window = history.rows[:, history.end - d - gap - r : history.end]
        distance = float(warped_distance(shape_of(window[SAMPLES]), self.shape, BAND))
        feed, block = (longest(window[OTHERS + n], template.period_s) for n in range(len(KINDS)))
        logit = None
        if self.weighing is not None and feed is not None and block is not None:
            logit = self.weighing.logit((rho, 1.0 - distance / 2.0, feed, block))
        return PatternMatch(rho, distance, template.stretches[k], d + gap + r, feed, block, logit)


def restored(kept: Sequence[Sequence[float]], length: int, seen: int, gate: Sequence[Any]) -> State:
    """The state whose parts these were: what its history kept, how long it is, samples seen, and the gate.

    Raises ValueError where they are not such parts.
    """
    if (
        not 0 < length <= SAMPLES_MAX + 1
        or len(kept) != 1 + len(KINDS)
        or len({len(row) for row in kept} | {min(seen, length)}) > 1
    ):
        raise ValueError("this is no state of a detector")
    phase, until, opened, after, is_low, confidence = gate
    return State(
        History.of(kept, length, seen), Gate(Phase(phase), int(until), int(opened), int(after), bool(is_low), float(confidence))
    )
