"""How far the control's clock is from the edge's, how fast they part, and whether one of them was set: a pure fold.

    done = clock.step(state, clock.heard(frame, at_s, arrival_ms))     # after each frame
    state, samples, health = done

Evidence, best first (`edge/clock_bounds.py`): readings of the clock (SampleSet.clock), each of which proves an interval; stamps
of samples against their arrival, a lower bound; and the signals themselves (`edge/clock_signals.py`), where a sensor of the edge
sees the spindle too. It is gathered for `BUCKET_S`, and windows of such buckets are put together by where most of them agree.

A clock was set (a step) when the last buckets agree with each other and not with those before; the windows start anew with them.
What the edge's own clock was set by is seen against its monotonic clock, and taken off all bounds. Drift is a robust line
(`edge/clock_drift.py`). A step, or a drift that has taken the offset past a second from where it began, is an alarm.

Stamps are never changed: consumers that put machines side by side subtract the offset, and only where `stamp_clock` is "control".
A control that gives no stamps has its samples stamped by the edge; there the offset is a figure about the control, and no more.
"""

from dataclasses import dataclass, field, replace
from typing import NamedTuple

from edge.clock_bounds import Bound, above, agreed, of_reading
from edge.clock_drift import Drift, Series, drift
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
BUCKET_S = 10.0
BUCKET_READINGS_MAX = 128
WINDOW_BUCKETS_MAX = 60
WINDOW_S = 3600.0  # evidence that is older is forgotten
STEP_BUCKETS = 3  # of readings that agree on another offset
STEP_STAMP_BUCKETS = 6
STAMP_BUCKETS_MIN = 4
STAMP_LATENCY_S_MAX = 1.0  # of the fastest sample of a window, from its stamp to the edge
STAMP_BEHIND_S_MAX = 10.0  # stamps that are further behind the clock of their server are those of another clock
EDGE_STEP_S = 0.5
ALARM_S = 1.0  # of drift
ALARM_STANDS_S = 3600.0  # after a step
MOVED_S_MIN = 0.002  # less is not told
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
    """What a frame tells of the clock. Stamps of a state as found, or of a backlog, say nothing of how long they took."""
    is_news = not frame.backlog and not any(sample.is_baseline for sample in frame.samples)
    return Heard(at_s, arrival_ms, frame.clock, frame.newest_ms if is_news else None, peak)


class Told(NamedTuple):
    """What was published last. `bound` None: a null, for this reason."""

    bound: Bound | None
    reason: str
    method: str
    stamped_by: str


@dataclass(frozen=True, slots=True)
class State:
    """What is known of one control's clock.

    bucket, stamp_s: readings and the largest stamp minus arrival of the bucket that is open until `until_s`
    readings, stamps, peaks: a bound for each bucket that is closed
    stamps_samples: as the last reading says; None while there was none
    wall_ahead_s: the edge's wall clock minus its monotonic one
    """

    until_s: float = -1e300
    bucket: tuple[Bound, ...] = ()
    stamp_s: float | None = None
    readings: tuple[Bound, ...] = ()
    stamps: tuple[Bound, ...] = ()
    peaks: tuple[Bound, ...] = ()
    stamps_samples: bool | None = None
    newest_ms: int | None = None
    wall_ahead_s: float | None = None
    series: Series = field(default_factory=Series)
    drift: Drift | None = None
    began: Bound | None = None
    steps: int = 0
    step_s: float = -1e300
    step: str = ""
    told: Told | None = None


class Done(NamedTuple):
    """The state after a look, samples to publish, and values of `HEALTH` (none where nothing was looked at)."""

    state: State
    samples: tuple[EdgeSample, ...] = ()
    health: dict[str, str | int | float | None] = {}  # noqa: RUF012  never written to


def step(state: State, heard: Heard) -> Done:
    """Take a look in; judge where a bucket is full, and at the first reading."""
    state = _gathered(_edge_clock(state, heard), heard)
    if heard.at_s < state.until_s and not (state.told is None and state.bucket):
        return Done(state)
    if heard.at_s >= state.until_s:
        state = _closed(state, heard.at_s)
    judged = _judged(state, heard.at_s)
    if judged is None:
        return Done(state)
    state = _followed(state, judged.bound)
    is_news = _is_news(state.told, judged)
    stamp_ms = state.newest_ms if state.stamps_samples and state.newest_ms is not None else round(heard.arrival_ms)
    after = replace(state, told=judged) if is_news else state
    return Done(after, _samples(judged, stamp_ms) if is_news else (), _health(after, judged, heard.at_s))


def _edge_clock(state: State, heard: Heard) -> State:
    """The edge's clock, if it was set, moves all offsets the other way."""
    ahead_s = heard.arrival_ms / 1000.0 - heard.at_s
    before_s = state.wall_ahead_s
    if before_s is None or abs(ahead_s - before_s) <= EDGE_STEP_S:
        return replace(state, wall_ahead_s=ahead_s)
    by_s = before_s - ahead_s
    return replace(
        state,
        wall_ahead_s=ahead_s,
        bucket=tuple(bound.moved(by_s) for bound in state.bucket),
        stamp_s=None if state.stamp_s is None else state.stamp_s + by_s,
        readings=tuple(bound.moved(by_s) for bound in state.readings),
        stamps=tuple(bound.moved(by_s) for bound in state.stamps),
        peaks=tuple(bound.moved(by_s) for bound in state.peaks),
        series=state.series.moved(by_s),
        began=None if state.began is None else state.began.moved(by_s),
        steps=state.steps + 1,
        step_s=heard.at_s,
        step=f"the edge's own clock was set by {-by_s:+.3f} s",
    )


def _gathered(state: State, heard: Heard) -> State:
    """The open bucket with one look more."""
    bucket, stamp_s, stamps_samples = state.bucket, state.stamp_s, state.stamps_samples
    if heard.reading is not None:
        stamps_samples = heard.reading.stamps_samples
        if len(bucket) < BUCKET_READINGS_MAX:
            bucket = (*bucket, of_reading(heard.reading, heard.arrival_ms, heard.at_s))
    if heard.newest_ms is not None:
        ahead_s = (heard.newest_ms - heard.arrival_ms) / 1000.0
        stamp_s = ahead_s if stamp_s is None else max(stamp_s, ahead_s)
    peaks = state.peaks if heard.peak is None else (*state.peaks, heard.peak)
    newest_ms = state.newest_ms if heard.newest_ms is None else heard.newest_ms
    until_s = heard.at_s + BUCKET_S if state.until_s == -1e300 else state.until_s
    return replace(
        state,
        until_s=until_s,
        bucket=bucket,
        stamp_s=stamp_s,
        peaks=peaks,
        stamps_samples=stamps_samples,
        newest_ms=newest_ms,
    )


def _closed(state: State, at_s: float) -> State:
    """The bucket goes into the windows, and may be the one that shows a step."""
    readings, stamps = _kept(state.readings, at_s), _kept(state.stamps, at_s)
    by_s: float | None = None
    if state.bucket:
        readings = (*readings, agreed(state.bucket, at_s).bound)
        readings, by_s = _stepped(readings, at_s)
    if state.stamp_s is not None and state.stamps_samples:
        stamps = (*stamps, Bound(at_s, state.stamp_s, state.stamp_s))
        stamps, stamps_by_s = _stamps_stepped(stamps, at_s)
        by_s = stamps_by_s if by_s is None and not readings else by_s
    after = replace(
        state,
        until_s=at_s + BUCKET_S,
        bucket=(),
        stamp_s=None,
        readings=readings,
        stamps=stamps,
        peaks=_kept(state.peaks, at_s),
    )
    if by_s is None:
        return after
    words = f"the control's clock was set by {by_s:+.3f} s"
    return replace(
        after, steps=state.steps + 1, step_s=at_s, step=words, series=Series(), drift=None, began=None, peaks=after.peaks[-1:]
    )


def _kept(window: tuple[Bound, ...], at_s: float) -> tuple[Bound, ...]:
    return tuple(bound for bound in window[1 - WINDOW_BUCKETS_MAX :] if at_s - bound.at_s <= WINDOW_S)


def _stepped(window: tuple[Bound, ...], at_s: float) -> tuple[tuple[Bound, ...], float | None]:
    """The window, and by how much the clock was set if the last buckets say so."""
    before, last = window[:-STEP_BUCKETS], window[-STEP_BUCKETS:]
    if not before:
        return window, None
    was, now = agreed(before, at_s), agreed(last, at_s)
    if now.number < STEP_BUCKETS or now.bound.meets(was.bound):
        return window, None
    return last, now.bound.offset_s - was.bound.offset_s


def _stamps_stepped(window: tuple[Bound, ...], at_s: float) -> tuple[tuple[Bound, ...], float | None]:
    before, last = window[:-STEP_STAMP_BUCKETS], window[-STEP_STAMP_BUCKETS:]
    if not before or not _is_steady(last, STEP_STAMP_BUCKETS):
        return window, None
    was, now = above(before, at_s, STAMP_LATENCY_S_MAX), above(last, at_s, STAMP_LATENCY_S_MAX)
    return (window, None) if now.meets(was) else (last, now.low_s - was.low_s)


def _is_steady(stamps: tuple[Bound, ...], number: int) -> bool:
    """Whether the last of them are no further apart than latencies are."""
    lows = [bound.low_s for bound in stamps[-number:]]
    return len(lows) == number and max(lows) - min(lows) <= STAMP_LATENCY_S_MAX


def _judged(state: State, at_s: float) -> Told | None:
    """The offset as all the evidence has it; None while there never was any."""
    stamped_by = "control" if state.stamps_samples else "edge"
    window = (*state.readings, agreed(state.bucket, at_s).bound) if state.bucket else state.readings
    stamps = None
    if state.stamps_samples and _is_steady(state.stamps, STAMP_BUCKETS_MIN):
        stamps = above(state.stamps, at_s, STAMP_LATENCY_S_MAX)
    if not window:
        if stamps is not None:
            return _by_stamps(state, stamps, at_s)
        return None if state.told is None else Told(None, OUTDATED, state.told.method, stamped_by)
    found = agreed(window, at_s)
    if 2 * found.number < len(window):
        return Told(None, UNSTEADY, "readings of the control's clock", stamped_by)
    read = found.bound
    if stamps is None or stamps.low_s <= read.low_s <= stamps.low_s + STAMP_BEHIND_S_MAX:
        return Told(read, "", "readings of the control's clock", stamped_by)
    if read.low_s < stamps.low_s <= read.high_s:
        narrower = read._replace(low_s=stamps.low_s)
        return Told(narrower, "", "readings of the control's clock, and stamps of samples", stamped_by)
    return _by_stamps(state, stamps, at_s, "; the clock that is read is another")


def _by_stamps(state: State, stamps: Bound, at_s: float, but: str = "") -> Told:
    """Where there are no readings of the clock that stamps: the signals may know better what a sample takes."""
    if state.peaks:
        peak = agreed(state.peaks, at_s).bound
        if peak.high_s >= stamps.low_s:
            both = stamps.both(peak) if peak.meets(stamps) else peak
            return Told(both, "", f"stamps of samples, and signals{but}", "control")
    return Told(stamps, "", f"stamps of samples{but}", "control")


def _followed(state: State, bound: Bound | None) -> State:
    """The series for the drift, and where it began."""
    if bound is None:
        return state
    series = state.series.taken(bound)
    found = state.drift if series is state.series else drift(series)
    return replace(state, series=series, drift=found, began=state.began or bound)


def _is_news(told: Told | None, judged: Told) -> bool:
    if told is None or told[1:] != judged[1:] or told.bound is None or judged.bound is None:
        return told is None or told[1:] != judged[1:] or (told.bound is None) != (judged.bound is None)
    before, now = told.bound, judged.bound
    if abs(now.offset_s - before.offset_s) > max(MOVED_S_MIN, 0.25 * min(before.spread_s, now.spread_s)):
        return True
    return not 0.8 * before.spread_s <= now.spread_s <= 1.25 * before.spread_s + MOVED_S_MIN


def _samples(judged: Told, stamp_ms: int) -> tuple[EdgeSample, ...]:
    """Derived values: they account for no observation."""
    by = EdgeSample(STAMPED_BY, judged.stamped_by, stamp_ms, observations=0)
    if judged.bound is None:
        null = EdgeSample(OFFSET, None, stamp_ms, Quality.BAD, judged.reason, observations=0)
        return null, replace(null, signal=SPREAD), by
    offset_s, spread_s = round(judged.bound.offset_s, 4), round(judged.bound.spread_s + 0.0001, 4)
    offset = EdgeSample(OFFSET, offset_s, stamp_ms, observations=0)
    return offset, EdgeSample(SPREAD, spread_s, stamp_ms, observations=0), by


def _health(state: State, judged: Told, at_s: float) -> dict[str, str | int | float | None]:
    return {
        "health/clock_step": state.steps,
        "health/clock_drift_ppm": None if state.drift is None else state.drift.ppm,
        "health/clock_alarm": _alarm(state, judged, at_s),
        "health/clock_method": judged.method,
    }


def _alarm(state: State, judged: Told, at_s: float) -> str:
    """What a person has to look at; "" where there is nothing."""
    bound = judged.bound
    if state.step and at_s - state.step_s <= ALARM_STANDS_S:
        return state.step
    if bound is None or state.began is None:
        return UNSTEADY if judged.reason == UNSTEADY else ""
    by_s = bound.offset_s - state.began.offset_s
    if abs(by_s) <= max(ALARM_S, bound.spread_s + state.began.spread_s):
        return ""
    return f"the control's clock has drifted by {by_s:+.2f} s in {(at_s - state.began.at_s) / 3600.0:.1f} h"
