"""The plain messages that a memory keeps, each as a snapshot of what it is of.

    state of a processor        the first of each hour, and the last before the processor died
    description of a machine    each that is another one than before, and faults: a replay has to know which one was live when
    step of a machine's loop    the first of each hour, and each at which the step is another one

A description has a millisecond of its own: whatever was heard before it has an earlier one, so that a replay takes it up at its
place among the messages.
"""

import json

from cnctwin.memory.store.contract import Snapshot
from sparkplug.host_session import HostEvent
from twin.vocabulary.topics import DESCRIPTION, LOOP, SNAPSHOT

FILTERS = (SNAPSHOT + "#", DESCRIPTION + "#", LOOP + "+")
DESCRIPTION_KIND, LOOP_KIND = "description", "loop"
"""The word in the place of a processor's name."""
HOUR_MS = 3_600_000
UNITS_MAX = 20_000  # of processors, whose snapshots are kept
SNAPSHOT_BYTES_MAX = 64_000_000  # of last snapshots; of a unit without one a replay begins with the first of its hour


class PlainRecord:
    """See the module."""

    def __init__(self) -> None:
        self._kept_hours: dict[tuple[str, str], int] = {}
        self._last = _LastSnapshots()
        self._described: dict[str, bytes] = {}  # what was heard last, by unit
        self._steps: dict[str, object] = {}
        self._heard_ms = -1  # of the latest message of any kind
        self._pushed_ms = range(0)  # milliseconds in which a description came too: what is heard in them comes after it

    def moment(self, received_ms: int) -> int:
        """Return when a message was heard, in the order of all."""
        if received_ms in self._pushed_ms:
            received_ms = self._pushed_ms.stop
        self._heard_ms = received_ms
        return received_ms

    def hear(self, event: HostEvent, received_ms: int) -> Snapshot | None:
        """Return what is to be kept of a plain message; None where nothing is."""
        topic = event.topic
        if topic.startswith(DESCRIPTION):
            return self._hear_description(topic.removeprefix(DESCRIPTION), event.payload, received_ms)
        if topic.startswith(LOOP):
            return self._hear_step(topic.removeprefix(LOOP), event.payload, received_ms)
        processor, _, unit = topic.removeprefix(SNAPSHOT).partition("/")
        if not event.payload or not unit:
            return None
        snapshot = Snapshot(processor, unit, event.timestamp_ms, event.payload)
        kept = self._first_of_hour(snapshot)
        if kept is None or (processor, unit) in self._kept_hours:
            self._last.put(snapshot)
        return kept

    def died(self, processor: str) -> list[Snapshot]:
        """Return the last snapshots of a processor that has died, and forget them."""
        return self._last.take(processor)

    def _hear_description(self, unit: str, payload: bytes, received_ms: int) -> Snapshot | None:
        if self._described.get(unit) == payload or (unit not in self._described and len(self._described) >= UNITS_MAX):
            return None
        self._described[unit] = payload
        first_ms = self._pushed_ms.start if received_ms in self._pushed_ms else received_ms
        before_ms, received_ms = self._heard_ms, self.moment(received_ms)
        if received_ms == before_ms:
            received_ms += 1
            self._pushed_ms = range(first_ms, received_ms)
            self._heard_ms = received_ms
        return Snapshot(DESCRIPTION_KIND, unit, received_ms, payload)

    def _hear_step(self, machine: str, payload: bytes, received_ms: int) -> Snapshot | None:
        snapshot = Snapshot(LOOP_KIND, machine, received_ms, payload)
        if not payload or (machine not in self._steps and len(self._steps) >= UNITS_MAX):
            return None
        step = _step(payload)
        is_new = step != self._steps.get(machine)
        self._steps[machine] = step
        kept = self._first_of_hour(snapshot)
        return snapshot if is_new else kept

    def _first_of_hour(self, snapshot: Snapshot) -> Snapshot | None:
        key, hour = (snapshot.processor, snapshot.unit), snapshot.received_ms // HOUR_MS
        kept_hour = self._kept_hours.get(key)
        if kept_hour == hour or (kept_hour is None and len(self._kept_hours) >= UNITS_MAX):
            return None
        self._kept_hours[key] = hour
        return snapshot


def _step(payload: bytes) -> object:
    try:
        document = json.loads(payload)
    except (ValueError, RecursionError):
        return None
    return document.get("step") if isinstance(document, dict) else None


class _LastSnapshots:
    """The last snapshot of each unit; where all are too large, those go that were heard longest ago."""

    def __init__(self) -> None:
        self._heard: dict[tuple[str, str], Snapshot] = {}  # the latest at the end
        self._units: dict[str, set[str]] = {}
        self._bytes = 0

    def put(self, snapshot: Snapshot) -> None:
        """Remember one in place of the one before."""
        self._pop(snapshot.processor, snapshot.unit)
        self._heard[snapshot.processor, snapshot.unit] = snapshot
        self._units.setdefault(snapshot.processor, set()).add(snapshot.unit)
        self._bytes += len(snapshot.payload)
        while self._bytes > SNAPSHOT_BYTES_MAX:
            oldest = next(iter(self._heard))
            self._pop(*oldest)
            self._units[oldest[0]].discard(oldest[1])

    def _pop(self, processor: str, unit: str) -> Snapshot | None:
        found = self._heard.pop((processor, unit), None)
        self._bytes -= 0 if found is None else len(found.payload)
        return found

    def take(self, processor: str) -> list[Snapshot]:
        """Return those of a processor, and forget them."""
        units = self._units.pop(processor, ())
        return [found for unit in sorted(units) if (found := self._pop(processor, unit)) is not None]
