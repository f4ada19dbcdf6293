"""A comparison of what was published then with what is recomputed now, metric by metric and in order, as both come in.

Two values stand for each other when they are of the same metric and moment. Then they are the same, bit for bit, with quality and
reason, or they differ. A value whose moment the other side has passed is missing (published then only) or extra.
"""

import hashlib
import struct
from collections import deque
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field
from typing import NamedTuple

from cnctwin.memory.replay.log import NOTHING_YET
from cnctwin.memory.replay.result import DIFFERENCES_MAX, Difference, MetricCompared
from processors.contract import OutputSpec
from sparkplug.datatype import DataType
from sparkplug.metric import Change, Reading
from sparkplug.quality import Quality
from sparkplug.values import Value

AHEAD_MAX = 20_000  # values that one side may be ahead of the other


class _PublishedValue(NamedTuple):
    t: int
    value: Value
    quality: Quality
    reason: str | None
    is_counted: bool  # it came within the stretch that was asked for


@dataclass(slots=True)
class _Metric:
    """One metric while it is compared."""

    name: str
    processor: str
    then: deque[_PublishedValue] = field(default_factory=deque)
    now: deque[_PublishedValue] = field(default_factory=deque)
    restated: dict[int, _PublishedValue] = field(default_factory=dict)  # what births have told
    known_ms: int = -1  # published before the state that was restored, up to here
    same: int = 0
    differing: int = 0
    missing: int = 0
    extra: int = 0
    unheard: int = 0
    largest: float | None = None
    first: Difference | None = None


class Comparison:
    """One processor's metrics of one machine."""

    def __init__(self, processor: str, specs: Iterable[OutputSpec], differences: list[Difference]) -> None:
        self._processor = processor
        self._types = {spec.name: spec.datatype for spec in specs}
        self._metrics: dict[str, _Metric] = {}
        self._differences = differences
        self._hash = hashlib.sha256()
        self.values = 0  # recomputed
        self.is_heard = False  # whether the day had anything of it

    # What comes in.

    def published(self, readings: Iterable[Reading], *, is_counted: bool) -> None:
        """A data message of the day."""
        self.is_heard = True
        for reading in readings:
            metric = self._metric(reading.name)
            if reading.timestamp_ms > metric.known_ms or not metric.known_ms:
                metric.known_ms = 0
                told = _PublishedValue(reading.timestamp_ms, reading.value, reading.quality, reading.reason, is_counted)
                metric.then.append(told)
                self._settle(metric)

    def restated(self, readings: Iterable[Reading]) -> None:
        """A birth of the day: it tells the last value of each metric, also where it was not told by a message of its own. What is
        recomputed of the time before it and was not heard, nobody was listening to, or the processor could not send."""
        self.is_heard = True
        for reading in readings:
            if reading.reason == NOTHING_YET:
                continue
            metric = self._metric(reading.name)
            told = _PublishedValue(reading.timestamp_ms, reading.value, reading.quality, reading.reason, False)
            metric.restated = {told.t: told}
            while metric.now and metric.now[0].t <= told.t:
                now = metric.now.popleft()
                if now.t == told.t:
                    self._count(metric, told, now)
                else:
                    metric.unheard += 1

    def recomputed(self, machine: str, changes: Iterable[Change], *, is_counted: bool) -> None:
        """Take what the fold gives now."""
        for change in changes:
            self.values += 1
            value = as_sent(change.value, self._types[change.name])
            line = (machine, change.name, change.timestamp_ms, value, int(change.quality), change.reason, change.is_historical)
            self._hash.update(repr(line).encode())
            metric = self._metric(change.name)
            metric.now.append(_PublishedValue(change.timestamp_ms, value, change.quality, change.reason, is_counted))
            if self.is_heard:
                self._settle(metric)
            elif len(metric.now) > AHEAD_MAX:
                metric.now.popleft()

    def known(self, latest: Mapping[str, Change]) -> None:
        """A state was restored: what was published up to its last values belongs to the life before it."""
        for name, change in latest.items():
            self._metric(name).known_ms = change.timestamp_ms

    def cut_off(self) -> None:
        """The processor died here: what is recomputed beyond its last word it would have said."""
        for metric in self._metrics.values():
            for told in metric.then:
                self._count(metric, told, None)
            metric.then.clear()
            metric.now.clear()

    def end(self) -> tuple[MetricCompared, ...]:
        """All that is left has no counterpart; where nothing at all was published then, nothing is compared."""
        if not self.is_heard:
            return ()
        for metric in self._metrics.values():
            while metric.then:
                self._count(metric, metric.then.popleft(), None)
            while metric.now:
                self._alone_now(metric)
        return tuple(
            MetricCompared(one.name, one.same, one.differing, one.missing, one.extra, one.unheard, one.largest, one.first)
            for _, one in sorted(self._metrics.items())
        )

    @property
    def sha256(self) -> str:
        """Over all that was recomputed, in order."""
        return self._hash.hexdigest()

    # How it is done.

    def _metric(self, name: str) -> _Metric:
        if name not in self._metrics:
            self._metrics[name] = _Metric(name, self._processor)
        return self._metrics[name]

    def _settle(self, metric: _Metric) -> None:
        """Compare what both sides have; where their moments differ, the earlier one has no counterpart."""
        then, now = metric.then, metric.now
        while then and now:
            if then[0].t == now[0].t:
                self._count(metric, then.popleft(), now.popleft())
            elif then[0].t < now[0].t:
                self._count(metric, then.popleft(), None)
            else:
                self._alone_now(metric)
        while len(then) > AHEAD_MAX:
            self._count(metric, then.popleft(), None)
        while len(now) > AHEAD_MAX:
            self._alone_now(metric)

    def _alone_now(self, metric: _Metric) -> None:
        told = metric.now.popleft()
        in_birth = metric.restated.get(told.t)
        self._count(metric, in_birth if in_birth is not None and _is_same(in_birth, told) else None, told)

    def _count(self, metric: _Metric, then: _PublishedValue | None, now: _PublishedValue | None) -> None:
        if not ((then is not None and then.is_counted) or (now is not None and now.is_counted)):
            return
        if then is not None and now is not None and _is_same(then, now):
            metric.same += 1
            return
        what = "missing" if now is None else "extra" if then is None else "differing"
        if what == "missing":
            metric.missing += 1
        elif what == "extra":
            metric.extra += 1
        else:
            metric.differing += 1
        t = then.t if then is not None else now.t if now is not None else 0
        published, recomputed = then.value if then is not None else None, now.value if now is not None else None
        difference = Difference(metric.processor, metric.name, t, what, published, recomputed)
        metric.first = metric.first or difference
        if what == "differing" and _is_number(published) and _is_number(recomputed):
            metric.largest = max(metric.largest or 0.0, abs(float(recomputed) - float(published)))  # type: ignore[arg-type]
        if len(self._differences) < DIFFERENCES_MAX:
            self._differences.append(difference)


def as_sent(value: Value, datatype: DataType) -> Value:
    """A value as it comes out at the other end of the wire.

    >>> as_sent(1, DataType.DOUBLE), as_sent(0.1, DataType.FLOAT)
    (1.0, 0.10000000149011612)
    """
    if isinstance(value, bool) or not isinstance(value, (int, float)):
        return value
    if datatype is DataType.DOUBLE:
        return float(value)
    if datatype is DataType.FLOAT:
        return float(struct.unpack("<f", struct.pack("<f", value))[0])
    return value


def _is_same(then: _PublishedValue, now: _PublishedValue) -> bool:
    return then.quality is now.quality and then.reason == now.reason and _bits(then.value) == _bits(now.value)


def _bits(value: Value) -> object:
    return struct.pack("<d", value) if isinstance(value, float) else (type(value), value)


def _is_number(value: Value) -> bool:
    return isinstance(value, (int, float)) and not isinstance(value, bool)
