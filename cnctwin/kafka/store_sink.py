"""The historian's store as a sink: messages, and the offsets that they come from, in one transaction of SQLite."""

import logging
import time

from cnctwin.errors import UsageError
from cnctwin.memory.historian import store_of
from cnctwin.memory.store.contract import Message, Pinned, StoreError
from cnctwin.memory.store.embedded import EmbeddedStore
from processors.actions import Pin
from processors.historian import HistorianConfig
from sparkplug.host_event import EventKind
from sparkplug.records.record import Record

TIDY_S = 60.0
RETRY_S = 1.0
RETRIES_MAX = 60
_PLAIN = EventKind.PLAIN
_log = logging.getLogger(__name__)


class StoreSink:
    """The store of the historian as a sink. A store that is new begins with what the log still holds.

    It is written before the runner commits: after a kill the store may be ahead of the folds, and never behind.
    """

    def __init__(self, store: EmbeddedStore) -> None:
        self._store = store
        self._kept = store.places()
        self._places: dict[str, int] = {}
        self._messages: list[Message] = []
        self._pins: list[Pinned] = []
        self._tidied_s = time.monotonic()

    def begin(self, place: tuple[str, int], offset: int) -> int:
        """Return from where a partition is to be read."""
        return min(offset, self._kept.get(_name(place), 0))

    def keep(self, place: tuple[str, int], offset: int, record: Record) -> None:
        """Have a record kept with the next `write`."""
        name = _name(place)
        if offset < self._kept.get(name, 0):
            return
        self._places[name] = self._kept[name] = offset + 1
        event = record.event
        if event is not None and event.kind is not _PLAIN:
            self._messages.append(Message(record.received_ms, event))

    def pin(self, pin: Pin) -> None:
        """Keep a stretch from being swept; twice the same is once."""
        self._pins.append(Pinned(pin.machine, pin.from_ms, pin.to_ms, pin.reason))

    def write(self) -> None:
        """Write what waits. Raises StoreError where the store goes on refusing it: then the runner ends, and nothing is lost."""
        for attempt in range(RETRIES_MAX):
            try:
                self._write()
            except StoreError as error:
                if attempt == RETRIES_MAX - 1:
                    raise
                _log.warning("the store cannot write, %d messages wait: %s", len(self._messages), error)
                time.sleep(RETRY_S)
            else:
                break
        if time.monotonic() - self._tidied_s >= TIDY_S:
            self._tidied_s = time.monotonic()
            self._store.tidy(time.time_ns() // 1_000_000)

    def _write(self) -> None:
        if self._places:
            self._store.append_from(self._messages, self._places)
            self._messages, self._places = [], {}
        while self._pins:
            self._store.pin(self._pins[-1])
            self._pins.pop()

    def close(self) -> None:
        """Close the store; what was not written is read again."""
        self._store.close()


def sink_of(config: HistorianConfig) -> StoreSink:
    """Return the sink of a historian. Raises UsageError where its store cannot keep offsets, StoreError."""
    store = store_of(config)
    if not isinstance(store, EmbeddedStore):
        store.close()
        raise UsageError(f"[historian] store = {config.store!r} cannot keep the offsets of a log; on Kafka give it a folder")
    return StoreSink(store)


def _name(place: tuple[str, int]) -> str:
    """Return the name of a partition in the store."""
    return f"{place[0]}-{place[1]}"
