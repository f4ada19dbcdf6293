"""The offset of the control's clock from the edge's, how fast they part, and whether one of them was set: a pure fold.

    done = clock.step(state, clock.heard(frame, at_s, arrival_ms))     # after each frame
    state, samples, health = done

Evidence, best first (`edge/clock/bounds.py`): readings of the clock over a round trip, each of which proves an interval; the time
of documents that come one way (a ClockReading with `edge_ms` 0; most within `round_trip_ms`); the stamps of samples, which come
one way too; and the signals themselves (`edge/clock/signals.py`), where a sensor of the edge sees the spindle. It is gathered for
`BUCKET_S`, and windows of such buckets are put together.

A clock was set (a step) when the last buckets agree with each other and not with those before; the windows start again with them.
What the edge's own clock was set by is seen against its monotonic clock, and taken off all bounds. Drift is a robust line
(`edge/clock/drift.py`). A step, or a drift that has taken the offset past a second from where it began, is an alarm.

Stamps are never changed: consumers that put machines side by side subtract the offset, and only where `stamp_clock` is "control".
A control that gives no stamps has its samples stamped by the edge; there the offset is a figure about the control, and no more.
"""

from dataclasses import replace
from itertools import pairwise
from typing import Any, NamedTuple, TypeVar

from edge.clock.bounds import Bound, OneWay, above, agreed, of_reading
from edge.clock.drift import Drift, Series, drift
from edge.clock.steps import STEP_WAY_BUCKETS, Step, stepped, way_stepped
from edge.sample import ClockReading, EdgeSample, SampleSet
from sparkplug.datatype import DataType
from sparkplug.metric import MetricSpec
from sparkplug.quality import Quality

OFFSET, SPREAD, STAMPED_BY = "clock_offset_s", "clock_offset_spread_s", "stamp_clock"
SIGNALS = (OFFSET, SPREAD, STAMPED_BY)
HEALTH = (
    MetricSpec("health/clock_step", DataType.INT64, "steps", value=0),
    MetricSpec("health/clock_drift_ppm", DataType.DOUBLE, "ppm"),
    MetricSpec("health/clock_alarm", DataType.STRING, value=""),
    MetricSpec("health/clock_method", DataType.STRING, value=""),
)
NEVER_S = -1e300
BUCKET_S = 10.0
BUCKET_READINGS_MAX = 128
BUCKET_PHASES_MAX = 32  # of documents
WINDOW_BUCKETS_MAX = 60
WAY_BUCKETS_MAX = 30  # of what came one way, whose upper bound grows with its age
WINDOW_S = 3600.0  # evidence that is older is forgotten
STEADY_BUCKETS = 4
ONE_STEP_S = 2 * STEP_WAY_BUCKETS * BUCKET_S  # in which what is still found of a step is part of it
STAMP_LATENCY_S_MAX = 1.0  # of the fastest sample of a window, from its stamp to the edge
STAMP_BEHIND_S_MAX = 10.0  # stamps that are further behind the clock of their server are those of another clock
EDGE_STEP_S = 0.5
BEGINNING_S = 300.0  # after which the offset is known well enough for what it began with
ALARM_S = 1.0  # of drift
ALARM_STANDS_S = 3600.0  # after a step
ROOM_S, ROOM_SHARE = 0.025, 0.2  # that an offset may move before it is published again, and of its spread
NARROWER = 0.6  # of the spread that was published, to be published again
NARROWER_WAY = 0.8  # of what came one way, whose first spread is wide
READINGS, DOCUMENTS, STAMPS = "readings of the clock", "times of documents", "stamps of samples"
UNSTEADY = "the clock does not keep to the rate of the edge's"
OUTDATED = "the control's clock was not read for an hour"


class Heard(NamedTuple):
    """One look: the monotonic and the wall clock of the edge (read together), what the frame says of the control's.

    newest_ms: the newest stamp, where it belongs to something that happened just now
    peak: what the signals say, where they were compared
    """

    at_s: float
    arrival_ms: float
    reading: ClockReading | None = None
    newest_ms: int | None = None
    peak: Bound | None = None


def heard(frame: SampleSet, at_s: float, arrival_ms: float, peak: Bound | None = None) -> Heard:
    """Return what a frame tells of the clock. Stamps of a state as found, or of a backlog, say nothing of how long they took."""
    is_news = not frame.backlog and not any(sample.is_baseline for sample in frame.samples)
    return Heard(at_s, arrival_ms, frame.clock, frame.newest_ms if is_news else None, peak)


class OffsetEstimate(NamedTuple):
    """The offset as all the evidence has it, or as it was published. `bound` None: a null, for this reason."""

    bound: Bound | None
    reason: str
    method: str
    stamped_by: str


class State(NamedTuple):
    """The knowledge of one control's clock.

    bucket, document, stamp: of the bucket that is open until `until_s`: readings, documents, stamps
    readings, documents, stamps: one for each bucket that is closed; peaks: of the signals
    stamps_samples: as the last reading says; None while there was none
    wall_ahead_s: the edge's wall clock minus its monotonic one
    step_from_s: the offset before the last step; None where it was a step of the edge's clock
    """

    until_s: float = NEVER_S
    bucket: tuple[Bound, ...] = ()
    document: OneWay | None = None
    stamp: OneWay | None = None
    readings: tuple[Bound, ...] = ()
    documents: tuple[OneWay, ...] = ()
    stamps: tuple[OneWay, ...] = ()
    peaks: tuple[Bound, ...] = ()
    stamps_samples: bool | None = None
    newest_ms: int | None = None
    wall_ahead_s: float | None = None
    series: Series = Series()
    drift: Drift | None = None
    began: Bound | None = None
    steps: int = 0
    step_s: float = NEVER_S
    step_from_s: float | None = None
    step: str = ""
    published: OffsetEstimate | None = None


class Done(NamedTuple):
    """The state after a look, samples to publish, and values of `HEALTH` (none where nothing was looked at)."""

    state: State
    samples: tuple[EdgeSample, ...] = ()
    health: dict[str, str | int | float | None] = {}  # noqa: RUF012  never written to


def step(state: State, heard: Heard) -> Done:
    """Take a look in; judge where a bucket is full, and at the first reading."""
    ahead_s = heard.arrival_ms / 1000.0 - heard.at_s
    if state.wall_ahead_s is not None and abs(ahead_s - state.wall_ahead_s) > EDGE_STEP_S:
        state = _edge_clock_set(state, state.wall_ahead_s - ahead_s, heard.at_s)
    state = state._replace(wall_ahead_s=ahead_s, **_gathered(state, heard))
    if heard.at_s < state.until_s and not (state.published is None and state.bucket):
        return Done(state)
    if heard.at_s >= state.until_s:
        state = _closed(state, heard.at_s)
    judged = _judged(state, heard.at_s)
    if judged is None:
        return Done(state)
    state = _followed(state, judged)
    is_news, padded = _is_news(state.published, judged), _padded(judged)
    stamp_ms = state.newest_ms if state.stamps_samples and state.newest_ms is not None else round(heard.arrival_ms)
    after = state._replace(published=padded) if is_news else state
    return Done(after, _samples(padded, stamp_ms) if is_news else (), _health(after, judged, heard.at_s))


def _edge_clock_set(state: State, by_s: float, at_s: float) -> State:
    """The edge's clock was set: that moves all offsets the other way, `by_s`."""
    return state._replace(
        bucket=tuple(bound.moved(by_s) for bound in state.bucket),
        document=None if state.document is None else state.document.moved(by_s),
        stamp=None if state.stamp is None else state.stamp.moved(by_s),
        readings=tuple(bound.moved(by_s) for bound in state.readings),
        documents=tuple(way.moved(by_s) for way in state.documents),
        stamps=tuple(way.moved(by_s) for way in state.stamps),
        peaks=tuple(bound.moved(by_s) for bound in state.peaks),
        series=state.series.moved(by_s),
        began=None if state.began is None else state.began.moved(by_s),
        steps=state.steps + 1,
        step_s=at_s,
        step_from_s=None,
        step=f"the edge's own clock was set by {-by_s:+.3f} s",
    )


def _gathered(state: State, heard: Heard) -> dict[str, Any]:
    """Return what changes of the open bucket with one look more."""
    reading, changes = heard.reading, dict[str, Any]()
    if reading is not None:
        changes["stamps_samples"] = reading.stamps_samples
        if not reading.edge_ms:
            changes["document"] = _document(state.document, reading, heard)
        elif len(state.bucket) < BUCKET_READINGS_MAX:
            changes["bucket"] = (*state.bucket, of_reading(reading, heard.at_s))
    if heard.newest_ms is not None:
        way = OneWay(heard.at_s, (heard.newest_ms - heard.arrival_ms) / 1000.0, STAMP_LATENCY_S_MAX)
        changes |= {"stamp": _larger(state.stamp, way), "newest_ms": heard.newest_ms}
    if heard.peak is not None:
        changes["peaks"] = (*state.peaks, heard.peak)
    if state.until_s == NEVER_S:
        changes["until_s"] = heard.at_s + BUCKET_S
    return changes


def _document(before: OneWay | None, reading: ClockReading, heard: Heard) -> OneWay:
    """The documents of the open bucket with one more."""
    resolution_s, low_s = max(reading.resolution_ms, 1) / 1000.0, (reading.control_ms - heard.arrival_ms) / 1000.0
    phase = heard.arrival_ms / 1000.0 / resolution_s % 1.0
    way = OneWay(heard.at_s, low_s, reading.round_trip_ms / 1000.0, resolution_s, (phase,))
    if before is None:
        return way
    if resolution_s > before.resolution_s:  # a clock of milliseconds that shows a full second by chance
        way = way._replace(resolution_s=before.resolution_s, phases=before.phases)
    elif resolution_s == before.resolution_s:
        way = way._replace(phases=(*before.phases, phase)[:BUCKET_PHASES_MAX])
    return _larger(before, way)._replace(resolution_s=way.resolution_s, phases=way.phases)


def _larger(before: OneWay | None, way: OneWay) -> OneWay:
    return before if before is not None and before.low_s > way.low_s else way


def _closed(state: State, at_s: float) -> State:
    """The bucket goes into the windows, and may be the one that shows a step."""
    readings = _kept(state.readings, at_s)
    documents, stamps = _kept(state.documents, at_s, WAY_BUCKETS_MAX), _kept(state.stamps, at_s, WAY_BUCKETS_MAX)
    found: list[Step | None] = []  # steps, as the evidence has them that is read now, best first
    if state.bucket:
        readings, step = stepped((*readings, agreed(state.bucket, at_s).bound), at_s)
        found.append(step)
    if state.document is not None:
        documents, step = way_stepped((*documents, state.document), at_s)
        found.append(step)
    if state.stamp is not None and state.stamps_samples:
        stamps, step = way_stepped((*stamps, state.stamp), at_s)
        found = [step] if _is_by_stamps(state.published) else [*found, step]
    after = state._replace(
        until_s=at_s + BUCKET_S,
        bucket=(),
        document=None,
        stamp=None,
        readings=readings,
        documents=documents,
        stamps=stamps,
        peaks=_kept(state.peaks, at_s),
    )
    step = next(iter(found), None)
    if step is None:
        return after
    # A window that begins before the step shows a part of it; the rest follows when the window has moved on.
    is_rest = state.step_from_s is not None and at_s - state.step_s <= ONE_STEP_S
    steps, step_s = (state.steps, state.step_s) if is_rest else (state.steps + 1, at_s)
    from_s = state.step_from_s if is_rest and state.step_from_s is not None else step.from_s
    words = f"the control's clock was set by {step.to_s - from_s:+.3f} s"
    after = after._replace(
        steps=steps, step_s=step_s, step_from_s=from_s, step=words, series=Series(), drift=None, began=None, peaks=()
    )
    is_read = not _is_by_stamps(state.published) and bool(state.bucket or state.document)
    return after._replace(documents=() if is_read and state.bucket else documents, stamps=() if is_read else stamps)


WayT = TypeVar("WayT", Bound, OneWay)


def _kept(window: tuple[WayT, ...], at_s: float, buckets_max: int = WINDOW_BUCKETS_MAX) -> tuple[WayT, ...]:
    return tuple(one for one in window[1 - buckets_max :] if at_s - one.at_s <= WINDOW_S)


def _is_running_away(ways: tuple[OneWay, ...]) -> bool:
    """Return whether the last of them went the same way each time, by more than latencies do."""
    last = ways[-STEADY_BUCKETS:]
    moves = [(after.low_s - before.low_s) / before.doubt_s for before, after in pairwise(last)]
    return len(last) == STEADY_BUCKETS and (min(moves) > 1.0 or max(moves) < -1.0)


def _judged(state: State, at_s: float) -> OffsetEstimate | None:
    """The offset as all the evidence has it; None while there never was any."""
    stamped_by = "control" if state.stamps_samples else "edge"
    stamps = state.stamps if state.stamps_samples and len(state.stamps) >= STEADY_BUCKETS else ()
    stamps = () if _is_running_away(stamps) else stamps
    window = (*state.readings, agreed(state.bucket, at_s).bound) if state.bucket else state.readings
    if window:
        found = agreed(window, at_s)
        if 2 * found.number < len(window):
            return OffsetEstimate(None, UNSTEADY, READINGS, stamped_by)
        return _beside_stamps(state, found.bound, READINGS, stamps)
    if state.documents:
        if _is_running_away(state.documents):
            return OffsetEstimate(None, UNSTEADY, DOCUMENTS, stamped_by)
        return _beside_stamps(state, above(state.documents, at_s), DOCUMENTS, stamps)
    if stamps:
        return _by_stamps(state, above(stamps, at_s))
    return None if state.published is None else OffsetEstimate(None, OUTDATED, state.published.method, stamped_by)


def _beside_stamps(state: State, read: Bound, method: str, stamps: tuple[OneWay, ...]) -> OffsetEstimate:
    """The clock that was read, unless the stamps show that theirs is another; else they may show that it is further ahead."""
    stamped_by = "control" if state.stamps_samples else "edge"
    last = stamps[-STEP_WAY_BUCKETS:]
    if len(last) == STEP_WAY_BUCKETS:
        is_ahead = all(way.low_s > read.high_s for way in last)
        if is_ahead or all(way.low_s + STAMP_BEHIND_S_MAX < read.low_s for way in last):
            return _by_stamps(state, above(last, read.at_s), "; the clock that is read is another")
    if last and read.low_s < (low_s := above(stamps, read.at_s).low_s) <= read.high_s:
        return OffsetEstimate(read._replace(low_s=low_s), "", f"{method}, {STAMPS}", stamped_by)
    return OffsetEstimate(read, "", method, stamped_by)


def _by_stamps(state: State, stamps: Bound, but: str = "") -> OffsetEstimate:
    """Return the offset by stamps, for want of readings of their clock: the signals may know better what a sample takes."""
    if state.peaks:
        peak = agreed(state.peaks, stamps.at_s).bound
        if peak.high_s >= stamps.low_s:
            both = stamps.both(peak) if peak.meets(stamps) else peak
            return OffsetEstimate(both, "", f"{STAMPS}, signals{but}", "control")
    return OffsetEstimate(stamps, "", f"{STAMPS}{but}", "control")


def _is_by_stamps(published: OffsetEstimate | None) -> bool:
    return published is not None and published.method.startswith(STAMPS)


def _followed(state: State, judged: OffsetEstimate) -> State:
    """The series for the drift, and where it began; of another clock than before both begin again."""
    bound = judged.bound
    if bound is None:
        return state
    if _is_by_stamps(state.published) != _is_by_stamps(judged):
        state = state._replace(series=Series(), drift=None, began=None)
    series = state.series.taken(bound)
    found = state.drift if series is state.series else drift(series)
    is_beginning = bound.at_s - series.points[0].at_s <= BEGINNING_S
    return state._replace(series=series, drift=found, began=bound if is_beginning or state.began is None else state.began)


def _is_news(published: OffsetEstimate | None, judged: OffsetEstimate) -> bool:
    """Return whether what was published is no longer true, or much less than what is known."""
    if published is None or published[1:] != judged[1:] or published.bound is None or judged.bound is None:
        return published is None or published[1:] != judged[1:]
    before, now = published.bound, judged.bound.aged(judged.bound.at_s + 2.0 * BUCKET_S)  # when it is looked at again
    narrower = NARROWER if judged.method.startswith(READINGS) else NARROWER_WAY
    return now.low_s < before.low_s or now.high_s > before.high_s or _room_s(now) + now.spread_s < narrower * before.spread_s


def _padded(judged: OffsetEstimate) -> OffsetEstimate:
    """Return it as it is published: with room for what it may move before it is published again."""
    bound = judged.bound
    if bound is None:
        return judged
    room_s = _room_s(bound)
    return judged._replace(bound=Bound(bound.at_s, bound.low_s - room_s, bound.high_s + room_s))


def _room_s(bound: Bound) -> float:
    return ROOM_S + ROOM_SHARE * bound.spread_s


def _samples(judged: OffsetEstimate, stamp_ms: int) -> tuple[EdgeSample, ...]:
    """Derived values: they account for no observation."""
    by = EdgeSample(STAMPED_BY, judged.stamped_by, stamp_ms, observations=0)
    if judged.bound is None:
        null = EdgeSample(OFFSET, None, stamp_ms, Quality.BAD, judged.reason, observations=0)
        return null, replace(null, signal=SPREAD), by
    offset_s, spread_s = round(judged.bound.offset_s, 4), round(judged.bound.spread_s + 0.0001, 4)  # up
    offset = EdgeSample(OFFSET, offset_s, stamp_ms, observations=0)
    return offset, EdgeSample(SPREAD, spread_s, stamp_ms, observations=0), by


def _health(state: State, judged: OffsetEstimate, at_s: float) -> dict[str, str | int | float | None]:
    return {
        "health/clock_step": state.steps,
        "health/clock_drift_ppm": None if state.drift is None else state.drift.ppm,
        "health/clock_alarm": _alarm(state, judged, at_s),
        "health/clock_method": judged.method,
    }


def _alarm(state: State, judged: OffsetEstimate, at_s: float) -> str:
    """Return what a person has to look at; "" where there is nothing."""
    bound = judged.bound
    if state.step and at_s - state.step_s <= ALARM_STANDS_S:
        return state.step
    if bound is None or state.began is None:
        return UNSTEADY if judged.reason == UNSTEADY else ""
    by_s = bound.offset_s - state.began.offset_s
    if abs(by_s) <= max(ALARM_S, bound.spread_s + state.began.spread_s):
        return ""
    return f"the control's clock has drifted by {by_s:+.2f} s in {(at_s - state.began.at_s) / 3600.0:.1f} h"
