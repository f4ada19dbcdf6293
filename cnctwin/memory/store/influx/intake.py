"""Messages become batches of lines in the ring, in one transaction: when `append` returns, a kill -9 loses none of them."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field

from cnctwin.memory.store.contract import Appended, Message
from cnctwin.memory.store.influx.address import PINNED
from cnctwin.memory.store.influx.line_protocol import fields, influx_line, tags, victoria_line
from cnctwin.memory.store.influx.pins import Pins
from cnctwin.memory.store.influx.sample_row import SampleRow, SeriesKey, plain, told
from cnctwin.memory.store.influx.spool import Batch, Spool
from cnctwin.memory.store.influx.stamps import NUMBERED_MAX, Stamps, digest
from cnctwin.memory.store.influx.vocabulary import Vocabulary
from sparkplug.host_session import EventKind
from sparkplug.metric import Reading
from sparkplug.quality import Quality

SAMPLES_A_BATCH = 5_000
_TAGS_KEPT_MAX = 100_000


@dataclass(slots=True)
class _Lines:
    """A batch in the making."""

    samples: int = 0
    oldest_ms: int = 2**62
    lines: list[str] = field(default_factory=list)


@dataclass(slots=True)
class _Taken:
    """The account of the samples of one call."""

    stored: int = 0
    repeated: int = 0
    refused: int = 0
    open: dict[str, _Lines] = field(default_factory=dict)
    full: list[Batch] = field(default_factory=list)

    def add(self, bucket: str, line: str, t_ms: int) -> None:
        lines = self.open.setdefault(bucket, _Lines())
        lines.lines.append(line)
        lines.samples += 1
        lines.oldest_ms = min(lines.oldest_ms, t_ms)
        if lines.samples >= SAMPLES_A_BATCH:
            self.close(bucket)

    def close(self, bucket: str) -> None:
        lines = self.open.pop(bucket)
        self.full.append(Batch(bucket, lines.samples, lines.oldest_ms, "".join(lines.lines).encode()))


class Intake:
    """The intake before the ring; one thread. `complain` is told why a sample is refused.

    vocabulary: where the server knows no texts, what texts are kept as labels; None = it knows them
    """

    def __init__(self, spool: Spool, pins: Pins, vocabulary: Vocabulary | None, complain: Callable[[str], None]) -> None:
        self._spool, self._pins, self._vocabulary, self._complain = spool, pins, vocabulary, complain
        self._stamps = Stamps(spool)
        self._tags: dict[tuple[SeriesKey, str | None], str] = {}

    def append(self, messages: Sequence[Message]) -> Appended:
        """Keep messages. Raises StoreError, and then nothing of them is kept."""
        taken = _Taken()
        try:
            for message in messages:
                kind = message.event.kind
                for key, reading in told(message):
                    self._take(taken, key, reading, kind, message.event.timestamp_ms)
            for bucket in list(taken.open):
                taken.close(bucket)
            self._spool.put(taken.full, self._stamps.take_changed(), [("repeated", taken.repeated), ("refused", taken.refused)])
        except BaseException:
            self._stamps.forget()
            raise
        return Appended(taken.stored, taken.repeated, taken.refused)

    def prune(self) -> None:
        """Forget stamps that are old."""
        self._stamps.prune()

    def _take(self, taken: _Taken, key: SeriesKey, reading: Reading, kind: EventKind, event_ms: int) -> None:
        try:
            value = plain(reading.value)
            series = self._series(key, reading.unit)
            row = SampleRow(key, reading.unit, reading.timestamp_ms * 1000, value, reading.quality, reading.reason)
            stored = self._store(taken, series, row, is_live=kind is EventKind.DATA and not reading.is_historical)
            if kind is EventKind.BIRTH:
                stale_ms = self._stamps.stale_since(key)
                if stale_ms is not None and stale_ms > reading.timestamp_ms:
                    # The birth says "still so": as of the birth, since the stale sample stands between it and the old stamp.
                    again = row._replace(t_us=max(event_ms, stale_ms + 1) * 1000)
                    stored = self._store(taken, series, again, is_live=False) or stored
        except (ValueError, OverflowError) as error:
            taken.refused += 1
            self._complain(f"{key.machine} {key.signal}: {error}")
            return
        if stored:
            taken.stored += 1
        else:
            taken.repeated += 1

    def _store(self, taken: _Taken, series: str, row: SampleRow, *, is_live: bool) -> bool:
        said = fields(row)
        if self._vocabulary is not None and isinstance(row.value, str):
            self._vocabulary.admit(row.key.signal, row.value)
        t_ms = row.t_us // 1000
        is_stale = row.quality is Quality.STALE
        nth = self._stamps.number(row.key, t_ms, digest(said), is_stale=is_stale, is_live=is_live)
        if nth is None:
            return False
        assert nth < NUMBERED_MAX
        row = row._replace(t_us=row.t_us + nth) if nth else row
        line = influx_line(series, row, said) if self._vocabulary is None else victoria_line(series, row)
        taken.add(row.key.measurement, line, t_ms)
        if self._vocabulary is None and self._pins.holds(row.key.machine, t_ms):
            taken.add(PINNED, line, t_ms)
        return True

    def _series(self, key: SeriesKey, unit: str | None) -> str:
        known = self._tags.get((key, unit))
        if known is None:
            if len(self._tags) >= _TAGS_KEPT_MAX:
                self._tags.clear()
            known = self._tags[key, unit] = tags(key, unit)
        return known
