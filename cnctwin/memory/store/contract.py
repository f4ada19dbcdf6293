"""The contract of a store, wherever the bytes lie: a log of messages, and questions to it.

A message is kept whole and in the order in which it came, so that the processors can be run over it again and give what they gave
then. A sample of it is kept once: what comes again (a birth repeats what is known, an edge sends again what nobody confirmed) is
told by machine, node, signal, millisecond, value, quality and reason. Two values of one signal within the same millisecond are
two samples: the microseconds of a stamp number them. Samples are the readings of births, data and deaths of devices; what a birth
says again after a death is a sample as of the birth, since it holds again.

Raw and derived are apart: what a processor says (`twin/…`, of a node `twin-…`) is `cnc_twin_state`, all else `cnc_raw`.
"""

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass
from typing import NamedTuple, Protocol

from cnctwin.errors import ApplicationError
from sparkplug.host_session import HostEvent
from sparkplug.quality import Quality
from sparkplug.values import Value
from twin.vocabulary.twin_signals import TWIN_PREFIX

RAW, DERIVED = "cnc_raw", "cnc_twin_state"


class StoreError(ApplicationError):
    """The store cannot do what it is asked; the text names the place, the trouble and the way out."""


class Message(NamedTuple):
    """A message of one device (or, with `event.device` None, of a node: a hole), and when it came, ms since 1970 by our clock."""

    received_ms: int
    event: HostEvent


class Appended(NamedTuple):
    """The account of the samples of a batch. stored + repeated + refused = all of them.

    repeated: were there already
    refused: cannot be kept (of another type than a store has); counted, never silent
    """

    stored: int
    repeated: int
    refused: int


class Pinned(NamedTuple):
    """A stretch of a machine that no sweep may take, and why."""

    machine: str
    from_ms: int
    to_ms: int
    reason: str


def merged(pins: Iterable[Pinned]) -> list[Pinned]:
    """Merge the stretches of a machine that overlap or touch into one with all their reasons; oldest first.

    >>> merged([Pinned("vmc", 0, 20, "anomaly_alarm"), Pinned("vmc", 10, 30, "load"), Pinned("vmc", 15, 40, "anomaly_alarm")])
    [Pinned(machine='vmc', from_ms=0, to_ms=40, reason='anomaly_alarm, load')]
    """
    last: dict[str, int] = {}
    stretches: list[tuple[Pinned, dict[str, None]]] = []
    for pin in sorted(pins, key=lambda pin: (pin.from_ms, pin.to_ms, pin.machine, pin.reason)):
        at = last.get(pin.machine)
        if at is not None and pin.from_ms <= stretches[at][0].to_ms:
            stretch, reasons = stretches[at]
            stretches[at] = (stretch._replace(to_ms=max(stretch.to_ms, pin.to_ms)), reasons | {pin.reason: None})
        else:
            last[pin.machine] = len(stretches)
            stretches.append((pin, {pin.reason: None}))
    return [stretch._replace(reason=", ".join(reasons)) for stretch, reasons in stretches]


@dataclass(frozen=True, slots=True)
class Query:
    """Signals of one machine in [from_ms, to_ms). every_ms None: as they came; else a value for each window, which begins at a
    multiple of every_ms since 1970. A signal that nobody ever told has an empty column."""

    machine: str
    signals: tuple[str, ...]
    from_ms: int
    to_ms: int
    every_ms: int | None = None

    def __post_init__(self) -> None:
        if self.to_ms <= self.from_ms:
            raise StoreError(f"to {self.to_ms} is not after from {self.from_ms}; give a stretch of time")
        if self.every_ms is not None and not 1 <= self.every_ms <= 86_400_000 * 7:
            raise StoreError(f"windows of {self.every_ms} ms: give 1 ms to a week")


@dataclass(frozen=True, slots=True)
class Column:
    """The samples of one signal, oldest first; all lists have one length, `low`, `high` and `count` are empty without windows.

    t_us: µs since 1970, of a window its beginning; windows without a sample are left out
    value: number, bool, text or None; of a window the time-unweighted mean of its good numbers, of a text or bool the last one
    quality: GOOD, STALE or BAD; of a window that of its worst sample
    reason: why it is null or not good, else None; of a window that of the last of its worst samples
    low, high: of the good, finite numbers of a window; count: of all its samples
    """

    signal: str
    unit: str | None
    t_us: list[int]
    value: list[Value]
    quality: list[Quality]
    reason: list[str | None]
    low: list[float | None]
    high: list[float | None]
    count: list[int]


class Series(NamedTuple):
    """One signal of one machine as one node tells it."""

    machine: str
    node: str
    signal: str
    unit: str | None
    first_us: int
    last_us: int

    @property
    def measurement(self) -> str:
        """Raw or derived."""
        return DERIVED if self.signal.startswith(TWIN_PREFIX) else RAW


class Sample(NamedTuple):
    """The last that is known of a signal."""

    signal: str
    t_us: int
    value: Value
    quality: Quality
    reason: str | None
    unit: str | None


class Snapshot(NamedTuple):
    """The state of a processor for a unit (a machine or a cell), as it was published at `received_ms`."""

    processor: str
    unit: str
    received_ms: int
    payload: bytes


class Tidied(NamedTuple):
    """The account of `tidy`: hours sealed, hours swept, bytes given back, pins honoured."""

    sealed: int
    swept: int
    bytes_freed: int
    pinned: int


@dataclass(frozen=True, slots=True)
class Status:
    """The store: samples and bytes on the disk, oldest and newest sample, for how long nothing has to be swept before its
    time at the present rate (None: not known yet), samples that wait to be written, and in one line what is wrong ('' = nothing).
    """

    samples: int
    bytes: int
    oldest_ms: int | None
    newest_ms: int | None
    days_left: float | None
    waiting: int
    trouble: str


class Store(Protocol):
    """One thread at a time for `append`, `pin`, `keep_snapshot` and `tidy`; questions from any thread or process beside it."""

    def append(self, messages: Sequence[Message]) -> Appended:
        """Keep messages; when this returns, neither a kill -9 nor the loss of power loses any of them. Raises StoreError."""

    def pin(self, pinned: Pinned) -> None:
        """Keep a stretch from being swept, in whole, also what of it is still to come. Twice the same is once."""

    def pins(self, machine: str | None = None) -> list[Pinned]:
        """Return all pins, oldest first; those of a machine that overlap are one, with all their reasons."""

    def keep_snapshot(self, *snapshots: Snapshot) -> None:
        """Keep one snapshot an hour of each processor and unit: the first of the hour. All that are given are kept, or none."""

    def snapshot_before(self, processor: str, unit: str, at_ms: int) -> Snapshot | None:
        """The last snapshot that was received before a moment."""

    def machines(self) -> list[str]:
        """All machines, by name."""

    def series(self, machine: str) -> list[Series]:
        """The signals of a machine, by name."""

    def latest(self, machine: str) -> dict[str, Sample]:
        """The last sample of each signal."""

    def query(self, query: Query) -> list[Column]:
        """A column for each signal asked for, in that order."""

    def messages(self, machine: str, from_ms: int, to_ms: int) -> Iterator[Message]:
        """Yield messages of a machine (and of nodes that it hangs on: their holes) with received_ms in [from_ms, to_ms), in the
        order in which they came: a BIRTH whole, of DATA what was not there already. Raises StoreError where the store keeps no
        messages, only samples."""

    def tidy(self, now_ms: int) -> Tidied:
        """Do what is due, once a minute: seal whole hours, roll up, sweep what is past its time or beyond the disk's budget."""

    def status(self) -> Status:
        """Return the state of the store; cheap."""

    def close(self) -> None:
        """Write what waits, and close."""
