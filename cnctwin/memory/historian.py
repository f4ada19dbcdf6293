"""The historian's way into a store: a bounded queue, and a thread that writes batches.

What is in the queue is not safe yet; what the store has taken is. The thread writes twice a second what has gathered, since few
large transactions cost a fraction of many small ones: a kill takes that half second, but for the rows of edges that wait for
receipts. Where the store cannot write (a full disk), the batch is kept and tried again, and what does not fit into the queue
meanwhile is counted.
"""

import logging
import threading
import time
from collections import deque
from collections.abc import Callable, Mapping, Sequence
from itertools import islice
from typing import NamedTuple

from cnctwin.memory.plain_record import DESCRIPTION_KIND, FILTERS, PlainRecord
from cnctwin.memory.row_numbers import HOLE_S, SAVED_AS, RowNumbers, holes_text
from cnctwin.memory.store.contract import Message, Pinned, Snapshot, Store, StoreError
from cnctwin.memory.store.opening import default_place, open_store
from cnctwin.memory.store.retention import Retention
from edge.running.receipts import RECEIPT, REPEAT_S
from processors.actions import Pin
from processors.historian import HistorianConfig
from processors.running.ports import Receipt
from sparkplug.host_session import EventKind, HostEvent
from sparkplug.metric import Reading
from sparkplug.topics import NodeId
from twin.vocabulary.nodes import HISTORIAN_NODE, TWIN_NODE_PREFIX

QUEUE_MAX, QUEUE_BYTES_MAX = 400_000, 128_000_000  # samples, and about so much memory
SAMPLE_BYTES, ELEMENT_BYTES = 160, 32  # a reading in memory, an element of an array; texts and bytes by their length
WEIGHED_MAX, WEIGHED_FROM = 4, 20_000  # messages of so few readings are weighed, which arrays come in; all, while so many wait
BATCH_MAX = 50_000  # samples
GATHER_S = 0.5
LATE_S = 10.0  # waiting for longer is a trouble
TIDY_S, STATUS_S = 60.0, 5.0
AGAIN_S = 1.0  # after a `tidy` that sealed something
RETRY_S_MAX = 10.0
BEHIND_S, BEHIND_S_MAX = 1.0, REPEAT_S - 1.0  # from when on nobody is told that we are here; nor anything else
HOUR_MS = 3_600_000
REREAD_MAX = 100_000  # messages that a kill kept from the saved numbers of rows
_TEXTS = (str, bytes)
_DATA, _BIRTH, _PLAIN, _DEATH = EventKind.DATA, EventKind.BIRTH, EventKind.PLAIN, EventKind.DEATH
_new = tuple.__new__  # the constructor of a named tuple takes twice as long
_log = logging.getLogger(__name__)


def store_of(config: HistorianConfig) -> Store:
    """The store that a historian is told to write. Raises StoreError."""
    retention = Retention(raw_days=config.raw_days, block_days=config.block_days, disk_bytes=round(config.disk_gb * 1e9) or None)
    return open_store(config.store or default_place(), writable=True, retention=retention)


def _long_bytes(readings: Sequence[Reading]) -> int:
    """The memory of the values that are no numbers, beyond that of numbers."""
    size = 0
    for reading in readings:
        value = reading[1]
        if isinstance(value, _TEXTS):
            size += len(value)
        elif isinstance(value, tuple):
            size += ELEMENT_BYTES * len(value)
    return size


class _Queue:
    """Messages, pins and snapshots in the order in which they came, as many as fit. One thread puts, another takes."""

    def __init__(self) -> None:
        self._items: deque[tuple[HostEvent | Pinned | Snapshot, int, int, int]] = deque()  # when they came, samples, bytes
        self._put_samples = self._put_bytes = 0  # each of these is written by one of the threads
        self._taken_samples = self._taken_bytes = 0

    @property
    def samples(self) -> int:
        """The samples that wait; a pin or a snapshot counts as one."""
        return self._put_samples - self._taken_samples

    def put(self, item: HostEvent | Pinned | Snapshot, received_ms: int, samples: int, size: int) -> bool:
        """Put it in; return True if there was room."""
        samples = samples or 1
        size += samples * SAMPLE_BYTES
        is_full = self._put_samples - self._taken_samples + samples > QUEUE_MAX
        if is_full or self._put_bytes - self._taken_bytes + size > QUEUE_BYTES_MAX:
            return False
        self._items.append((item, received_ms, samples, size))
        self._put_samples += samples
        self._put_bytes += size
        return True

    def take(self) -> "_Batch":
        """Return what is written together: messages and snapshots up to the first pin, or that one alone."""
        messages: list[Message] = []
        snapshots: list[Snapshot] = []
        pinned = None
        samples = size = 0
        while self._items and samples < BATCH_MAX and pinned is None:
            item, received_ms, of_item, bytes_of_item = self._items[0]
            if isinstance(item, HostEvent):
                messages.append(_new(Message, (received_ms, item)))
            elif isinstance(item, Snapshot):
                snapshots.append(item)
            elif samples:
                break
            else:
                pinned = item
            self._items.popleft()
            samples += of_item
            size += bytes_of_item
        self._taken_samples += samples
        self._taken_bytes += size
        return _Batch(messages, snapshots, pinned, samples)


class _Batch(NamedTuple):
    messages: list[Message]
    snapshots: list[Snapshot]
    pinned: Pinned | None
    samples: int


class StoreRecorder:
    """A `processors.running.ports.Recorder` on a store. The store is written by its thread only; `stop` writes what waits, and
    closes it.

    A failure of the thread that is no StoreError is our own bug: the next `keep` raises it, and has the historian restarted.
    """

    keeps_plain = FILTERS

    def __init__(self, store: Store, group: str = "cnc", hole_s: float = HOLE_S) -> None:
        self._store, self._group = store, group
        self._queue = _Queue()
        self._thread = threading.Thread(target=self._run, name="store", daemon=True)
        self._stopping = threading.Event()
        self._plain = PlainRecord()
        self._stored = self._repeated = self._refused = self._dropped = self._pins = 0
        self._writing = 0  # samples in the hands of the thread
        self._caught_up_s = time.monotonic()  # all that was heard before it is in the store
        self._bytes, self._store_waiting, self._trouble = 0, 0, ""
        self._days_left: float | None = None
        self._failure: BaseException | None = None
        self._numbers = RowNumbers(hole_s)

    # What the worker calls.

    def keep(self, event: HostEvent, received_ms: int) -> None:
        """Queue a message, or what is kept of a plain one."""
        if self._failure is not None:
            raise self._failure
        kind = event.kind
        if kind is _PLAIN:
            if (snapshot := self._plain.hear(event, received_ms)) is not None:
                self._put(snapshot)
            return
        received_ms = self._plain.moment(received_ms)
        readings, size = event.readings, 0
        samples = len(readings)
        if samples < WEIGHED_MAX or self._queue.samples > WEIGHED_FROM:
            size = _long_bytes(readings)
        if not self._queue.put(event, received_ms, samples, size):
            self._dropped += 1
        if kind is _DEATH:
            for snapshot in self._plain.died(event.node.node.removeprefix(TWIN_NODE_PREFIX)):
                self._put(snapshot)

    def pin(self, pin: Pin) -> None:
        """Queue a pin behind the messages that it concerns."""
        self._put(Pinned(pin.machine, pin.from_ms, pin.to_ms, pin.reason))

    def health(self) -> Mapping[str, int | float | str]:
        """Return its state, by the names that `processors.running.health` declares."""
        behind_s = self._behind_s()
        holes = self._numbers.holes(time.time_ns() // 1_000_000)
        health: dict[str, int | float | str] = {
            "store_samples": self._stored,
            "store_repeated": self._repeated,
            "store_refused": self._refused,
            "store_dropped": self._dropped,
            "store_waiting": self._queue.samples + self._writing + self._store_waiting,
            "store_behind_s": round(behind_s, 1),
            "store_bytes": self._bytes,
            "store_pins": self._pins,
            "sequence_holes": len(holes),
            "sequence_hole": holes_text(holes),
            "store_trouble": self._trouble or (f"what was heard waits for {behind_s:.0f} s" if behind_s > LATE_S else ""),
        }
        if self._days_left is not None:
            health["store_days_left"] = round(self._days_left, 1)
        return health

    def receipts(self) -> list[Receipt]:
        """The rows of each edge that the store has taken since this was last asked; of those that are silent none, which says
        that somebody is here. While the store holds things up nothing is said: what was heard and waits here is not missed."""
        behind_s = self._behind_s()
        if behind_s > BEHIND_S_MAX:
            return []
        told = self._numbers.receipts(with_silent=behind_s <= BEHIND_S)
        return [Receipt(node, device, RECEIPT, text) for node, device, text in told]

    def _behind_s(self) -> float:
        """For how long something may have waited for the store; 0 where nothing does."""
        return time.monotonic() - self._caught_up_s if self._queue.samples or self._writing else 0.0

    # Its life.

    def start(self) -> None:
        """Say where the memory has a hole since it was last written, and begin to write."""
        status = self._store.status()
        now_ms = time.time_ns() // 1_000_000
        if status.newest_ms is not None:
            away_s = max(now_ms - status.newest_ms, 0) / 1000
            detail = f"the historian began; the newest sample before it is {away_s:.0f} s old"
            node = NodeId(self._group, HISTORIAN_NODE)
            for machine in self._store.machines():
                self._queue.put(HostEvent(EventKind.HOLE, node, machine, now_ms, detail=detail), now_ms, 1, 0)
        self._restore_numbers()
        self._thread.start()

    def begin_again(self) -> None:
        """Have another thread write, where the last one has failed: what it had in hand is lost, and counted as dropped."""
        if self._failure is not None:
            self._thread.join()
            self._dropped += self._writing
            self._writing = 0
            self._failure = None
            self._thread = threading.Thread(target=self._run, name="store", daemon=True)
            self._thread.start()

    def stop(self) -> None:
        """Write what waits, and close the store."""
        self._stopping.set()
        self._thread.join()
        self._save_numbers()
        self._store.close()

    def _put(self, item: Pinned | Snapshot) -> None:
        if not self._queue.put(item, 0, 1, len(item.payload) if isinstance(item, Snapshot) else 0):
            self._dropped += 1

    def _restore_numbers(self) -> None:
        """Take up the numbers of rows as they were saved, and what was stored after that."""
        saved = self._store.snapshot_before(*SAVED_AS, 1 << 62)
        if saved is None:
            return
        self._numbers.restore(saved.payload)
        from_ms = self._numbers.noted_ms
        for machine in self._store.machines():
            try:
                later = list(islice(self._store.messages(machine, from_ms, 1 << 62), REREAD_MAX))
            except StoreError as error:
                _log.warning("%s: the numbers of its rows are begun again: %s", machine, error)
                self._numbers.forget(machine)
            else:
                self._numbers.note(later)

    def _save_numbers(self) -> None:
        if not self._numbers.is_changed:
            return
        hour_ms = time.time_ns() // 1_000_000 // HOUR_MS * HOUR_MS
        try:
            self._store.keep_snapshot(Snapshot(*SAVED_AS, hour_ms, self._numbers.saved()))
        except StoreError as error:
            _log.warning("the numbers of rows are not saved: %s", error)

    # The thread.

    def _run(self) -> None:
        try:
            self._work()
        except BaseException as failure:
            self._failure = failure
            raise

    def _work(self) -> None:
        tidied_s = status_s = time.monotonic()
        is_all = True
        while not (self._stopping.is_set() and not self._queue.samples):
            if is_all:
                self._stopping.wait(GATHER_S)  # what comes within it goes into the same transaction
            took_s = time.monotonic()
            batch = self._queue.take()
            is_all = not self._queue.samples
            self._writing = batch.samples
            if not self._write(batch):
                _log.warning("%d samples are not written", batch.samples + self._queue.samples)
                return
            self._writing = 0
            if is_all:
                self._caught_up_s = took_s
            now_s = time.monotonic()
            if now_s - tidied_s >= TIDY_S:
                tidied_s = now_s
                if self._tidy():  # there may be more: sooner again, but not all the time
                    done_s = time.monotonic()
                    tidied_s = done_s - TIDY_S + max(AGAIN_S, 4 * (done_s - now_s))
            if now_s - status_s >= STATUS_S:
                status_s = now_s
                self._look()
                self._save_numbers()

    def _write(self, batch: _Batch) -> bool:
        """Write a batch; False where we are to stop and the store cannot take it."""
        return all(self._until_taken(step, batch) for step in (self._append, self._pin, self._keep_snapshots))

    def _until_taken(self, step: Callable[[_Batch], None], batch: _Batch) -> bool:
        pause_s = 0.1
        while True:
            try:
                step(batch)
            except StoreError as error:
                if str(error) != self._trouble:
                    _log.warning("the store cannot write: %s; %d samples wait", error, batch.samples + self._queue.samples)
                self._trouble = str(error)
                if self._stopping.is_set():
                    return False
            else:
                self._trouble = ""
                return True
            self._stopping.wait(pause_s)
            pause_s = min(2 * pause_s, RETRY_S_MAX)

    def _append(self, batch: _Batch) -> None:
        if batch.messages:
            appended = self._store.append(batch.messages)
            self._stored += appended.stored
            self._repeated += appended.repeated
            self._refused += appended.refused
            self._numbers.note(batch.messages)

    def _pin(self, batch: _Batch) -> None:
        if batch.pinned is not None:
            self._store.pin(batch.pinned)
            self._pins += 1

    def _keep_snapshots(self, batch: _Batch) -> None:
        snapshots = [one for one in batch.snapshots if not self._is_kept(one)]
        if snapshots:
            self._store.keep_snapshot(*snapshots)

    def _is_kept(self, snapshot: Snapshot) -> bool:
        """Return True for a description that the broker retained, and that was kept before the historian was started."""
        if snapshot.processor != DESCRIPTION_KIND:
            return False
        last = self._store.snapshot_before(DESCRIPTION_KIND, snapshot.unit, 1 << 62)
        return last is not None and last.payload == snapshot.payload

    def _tidy(self) -> bool:
        """Tidy; return True if hours were sealed."""
        try:
            return self._store.tidy(time.time_ns() // 1_000_000).sealed > 0
        except StoreError as error:
            _log.warning("the store cannot be tidied: %s", error)
            return False

    def _look(self) -> None:
        try:
            status = self._store.status()
        except StoreError as error:
            self._trouble = str(error)
            return
        self._bytes, self._days_left, self._store_waiting = status.bytes, status.days_left, status.waiting
        self._trouble = status.trouble
