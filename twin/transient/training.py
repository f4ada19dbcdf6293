"""A detector from streams with known changes: the template, then from which values on something counts.

* The gates of both parts are those that captures pass, and copies of the template that were stretched, stalled and put into the
  captures' noise.
* The pattern's threshold is the one that the null stream, all time outside of changes, passes at the stated rate (`extremes`).
  Where that stream is far too short to say, it is what the captures pass, each by the others' template.
* Where feed and block are known, a weighing is fitted: changes against all else that ends like one.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from twin.transient.copies import copies_of
from twin.transient.detector import DISTANCE_ANY, FEATURES, HAVE_TYPICAL, Detector, Limits, PatternMatch
from twin.transient.errors import TransientError
from twin.transient.evidence import UNKNOWN, Weighing, weighing_of
from twin.transient.extremes import FalseRate, false_rate, threshold_for
from twin.transient.learning import Learned, fitted, learned
from twin.transient.level import levels
from twin.transient.replay import Candidate, Outcome, candidates, replayed
from twin.transient.stream import Stream

Floats = NDArray[np.float64]
COPIES = 60
FAILING = 0.03
"""Share of the copies that may fail a gate."""
MARGIN = 0.95
LOOKED_AT_RHO = 0.3
"""Below this a part is not even looked at."""
KNOWN_FROM = 0.1
"""Fewest false gates expected in the null stream from which its tail gives their rate."""
SCORE_MAX = 0.999
SMALLER, LARGER = 0.5, 2.0
"""A change may be so much smaller or larger than those captured."""


@dataclass(frozen=True, slots=True)
class TrainingSettings:
    """Settings of a training run.

    signal: the one that shows the change; before_s, after_s: of the window around a given time that holds the change
    stall_s: how much longer the change may take; false_gates_per_day: the rate that the threshold aims at
    """

    signal: str
    before_s: float = 12.0
    after_s: float = 8.0
    stall_s: float = 4.0
    false_gates_per_day: float = 1.0


@dataclass(frozen=True, eq=False)
class Trained:
    """The detector, and what is known of it.

    captured: times of changes that the template was found in; not_found: of those that it was not
    asked_score: the threshold for the rate that was asked for, None = too little null to say
    rate: of the threshold that is used, by the signal alone
    provisional_per_day: gates that open and are retracted; provisional_s_per_day: the time that these hold scores back
    confirmed: known changes that the detector confirms, of `changes`
    weighed_peaks: null events that the weighing takes for a change; copies_found: share of the copies, by the signal alone
    """

    detector: Detector
    captured: tuple[float, ...]
    not_found: tuple[float, ...]
    asked_score: float | None
    rate: FalseRate
    provisional_per_day: float
    provisional_s_per_day: float
    changes: int
    confirmed: int
    weighed_peaks: int | None
    copies_found: float


def trained(streams: Sequence[Stream], settings: TrainingSettings, rng: np.random.Generator) -> Trained:
    """A detector of the changes in `streams`. Raises TransientError where there are none, or they have nothing in common."""
    changes = [(stream, at_s) for stream in streams for at_s in stream.changes_s]
    if not changes:
        raise TransientError("no change is known in these runs: give times with --at, or runs with tool_change_active")
    windows = [levels(settings.signal, stream.window(at_s, settings.before_s, settings.after_s)) for stream, at_s in changes]
    found = learned(windows, streams[0].period_s, settings.stall_s)
    copies = copies_of(found, COPIES, rng)
    loose = _loose(settings, found, copies)
    seen = [(stream, list(candidates(loose, stream))) for stream in streams]
    null = [one.found for stream, some in seen for one in some if not _is_near(stream, one.at_s, settings)]
    hours = max(1e-6, sum(stream.hours for stream in streams) - len(changes) * (settings.before_s + settings.after_s) / 3600.0)

    held_out = [
        _best(_with(loose, found, n), window) for n, (window, fit) in enumerate(zip(windows, found.fits, strict=True)) if fit
    ]
    copied = [_best(loose, window) for window in copies]
    own = [one for one in held_out if one is not None]
    distance_max = _distance_max(own, [one for one in copied if one is not None])
    peaks = np.array([one.score for one in null if one.distance <= distance_max])
    asked_score = threshold_for(peaks, hours, settings.false_gates_per_day)
    passed_score = MARGIN * min((one.score for one in own if one.distance <= distance_max), default=1.0)
    limits = replace(
        loose.limits, pattern_score=_pattern_score(asked_score, passed_score, hours, settings), distance_max=distance_max
    )
    weighing = _weighing(seen, settings)
    detector = replace(loose, limits=limits, weighing=weighing)
    outcomes = [(stream, replayed(detector, stream)) for stream in streams]
    opened = sum(not _is_near(stream, at_s, settings) for stream, outcome in outcomes for at_s in outcome.opened_s)
    return Trained(
        detector=detector,
        captured=tuple(at_s for (_, at_s), fit in zip(changes, found.fits, strict=True) if fit is not None),
        not_found=tuple(at_s for (_, at_s), fit in zip(changes, found.fits, strict=True) if fit is None),
        asked_score=asked_score,
        rate=false_rate(peaks, hours, limits.pattern_score, rng),
        provisional_per_day=24.0 * opened / hours,
        provisional_s_per_day=24.0 * sum(_open_s(stream, outcome, settings) for stream, outcome in outcomes) / hours,
        changes=len(changes),
        confirmed=sum(
            any(one.begun_s - settings.after_s <= at_s <= one.at_s + settings.after_s for one in outcome.confirmed)
            for stream, outcome in outcomes
            for at_s in stream.changes_s
        ),
        weighed_peaks=None if weighing is None else sum(_is_taken(weighing, one) for one in null),
        copies_found=float(np.mean([one is not None and _passes(limits, one) for one in copied])),
    )


def _pattern_score(asked_score: float | None, passed_score: float, hours: float, settings: TrainingSettings) -> float:
    """The threshold: that of the rate; where the null stream is too short to know that, what captures pass, if it is lower."""
    if asked_score is None:
        return passed_score
    is_known = hours * settings.false_gates_per_day / 24.0 >= KNOWN_FROM
    return min(asked_score, SCORE_MAX) if is_known else min(asked_score, passed_score)


def _loose(settings: TrainingSettings, found: Learned, copies: Sequence[Floats]) -> Detector:
    """A detector that finds all that could be one."""
    fits = [fit for fit in found.fits if fit is not None]
    copied = [fit for window in copies if (fit := fitted(found.template, window)) is not None]

    def gate(own: Sequence[float], of_copies: Sequence[float]) -> float:
        passed = float(np.quantile(of_copies, FAILING)) if of_copies else 1.0
        return max(LOOKED_AT_RHO, MARGIN * min(passed, *own))

    deviations = [fit.deviation / found.scale for fit in fits]
    limits = Limits(
        start_rho=gate([fit.start_rho for fit in fits], [fit.start_rho for fit in copied]),
        end_rho=gate([fit.end_rho for fit in fits], [fit.end_rho for fit in copied]),
        pattern_score=1.0,
        distance_max=DISTANCE_ANY,
        deviation_min=SMALLER * min(deviations),
        deviation_max=LARGER * max(deviations),
    )
    return Detector(settings.signal, found.template, found.scale, limits)


def _with(loose: Detector, found: Learned, n: int) -> Detector:
    """The detector as it is without capture n."""
    return replace(loose, template=found.without(n))


def _best(detector: Detector, window: Floats) -> PatternMatch | None:
    """The best pattern in a window of levels."""
    state, best = detector.begun(), None
    for value in window.tolist():
        state, found = detector.searched_level(state, value, UNKNOWN, UNKNOWN)
        if found is not None and (best is None or found.score > best.score):
            best = found
    return best


def _passes(limits: Limits, found: PatternMatch) -> bool:
    return found.score >= limits.pattern_score and found.distance <= limits.distance_max


def _distance_max(own: Sequence[PatternMatch], copied: Sequence[PatternMatch]) -> float:
    """The distance that nearly all captures and copies stay below."""
    of_copies = [float(np.quantile([one.distance for one in copied], 1.0 - FAILING))] if copied else []
    of_own = [float(np.median([one.distance for one in own])) * LARGER] if own else []
    return max([0.2, *of_copies, *of_own]) / MARGIN


def _open_s(stream: Stream, outcome: Outcome, settings: TrainingSettings) -> float:
    """Return how long the gate was open where no known change may have caused it, s."""
    times_s = stream.begin_s + np.flatnonzero(outcome.active) * stream.period_s
    return stream.period_s * sum(not _is_near(stream, at_s, settings) for at_s in times_s.tolist())


def _is_near(stream: Stream, at_s: float, settings: TrainingSettings) -> bool:
    """Return True where a known change may have caused what happened then."""
    after_s = settings.after_s + settings.stall_s
    return any(change_s - settings.before_s <= at_s <= change_s + after_s for change_s in stream.changes_s)


def _is_taken(weighing: Weighing, found: PatternMatch) -> bool:
    features = _features(found)
    return features is not None and weighing.logit(features) >= 0.0


def _features(found: PatternMatch) -> tuple[float, ...] | None:
    if found.feed_at_rest is None or found.block_stands is None:
        return None
    return found.rho, 1.0 - found.distance / 2.0, found.feed_at_rest, found.block_stands


def _weighing(seen: Sequence[tuple[Stream, Sequence[Candidate]]], settings: TrainingSettings) -> Weighing | None:
    """Return the weighing of changes against all else; None where feed or block is not known, or there is too little of either.

    What ends before the given time of a change is not the change, but what looks like its beginning and end: as good an example
    of what is none as there is.
    """
    rows, is_change = [], []
    for stream, some in seen:
        taken: set[float] = set()
        for change_s in stream.changes_s:
            after = [one for one in some if change_s <= one.at_s <= change_s + settings.after_s + settings.stall_s]
            best = max(after, key=lambda one: one.found.score, default=None)
            if best is not None and (features := _features(best.found)) is not None:
                taken.add(best.at_s)
                rows.append(features)
                is_change.append(True)
        for one in some:
            is_after = any(
                change_s <= one.at_s <= change_s + settings.after_s + settings.stall_s for change_s in stream.changes_s
            )
            features = None if is_after else _features(one.found)
            if features is not None:
                rows.append(features)
                is_change.append(False)
    if min(sum(is_change), len(is_change) - sum(is_change)) < 3:
        return None
    return weighing_of(FEATURES, HAVE_TYPICAL, np.array(rows), np.array(is_change))
