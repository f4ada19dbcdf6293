"""The interface's view of the plant: last readings, the last minutes of each signal, and changes not yet sent to its readers.

One thread feeds it (`take`, `flush`); any thread may ask. A lock is held for as long as it takes to read or write tables, never
over an encoding or a wait. Readings that an edge sends late, as history, are not in it: they are in the store.
"""

import logging
import threading
from collections import Counter
from collections.abc import Callable, Iterator, Mapping, Sequence
from math import isfinite
from typing import Any, NamedTuple

from cnctwin.api.fleet import fleet_item
from cnctwin.api.live.batches import Batch, Row, Waiting, alerts_batch, fleet_rows, machine_rows, notices_batch, state_batch
from cnctwin.api.live.notices import Notices, notices_of
from cnctwin.api.live.owner import Owner, Signal, offline_reason, share
from cnctwin.api.live.stamp import STAMP_MS_MAX, is_time, without_time
from cnctwin.api.live.trace import Sample
from cnctwin.api.value_object import plain, value_object
from sparkplug.host_session import EventKind, HostEvent
from sparkplug.metric import NodeId, Reading, is_command_metric
from sparkplug.quality import Quality
from sparkplug.values import DataSet, PropertySet, Template
from twin.vocabulary.nodes import JOBS_NODE, is_twin_node
from twin.vocabulary.twin_signals import TWIN_PREFIX

MACHINES_MAX = 1000
SIGNALS_MAX = 2000  # of one device; what is beyond is counted
ROWS_MAX = 5000  # that wait for one flush, of one machine
EVENTS_A_LOCK = 50  # so that who asks waits a millisecond or two
SILENCE_MS_MAX = 2000  # readers hear something at least so often
LAG_MS = 1000  # between two looks at what the processors report of their lag
LINE_MAX = 300
MEASURED = "measured"
_log = logging.getLogger(__name__)
_UNSHOWN = (tuple, bytes, DataSet, Template)  # NaN is kept as a null
Describe = Callable[[NodeId, str | None], Mapping[str, PropertySet]]


class NodeView(NamedTuple):
    """A node's own metrics (its ledger and its health)."""

    node: str
    online: bool
    values: dict[str, Any]


class LivePlant:
    """The plant as it is now. `take` and `flush` belong to one thread."""

    def __init__(self) -> None:
        self.counts: Counter[str] = Counter()
        self.refused = ""  # what was kept out last, in words
        self.description_faults: tuple[tuple[str, str], ...] = ()  # machine and fault
        self._lock = threading.Lock()
        self._machines: dict[str, dict[NodeId, Owner]] = {}
        self._nodes: dict[NodeId, Owner] = {}
        self._waiting: dict[str, Waiting] = {}
        self._fleet: dict[tuple[str, str], Row] = {}
        self._fleet_readers = 0
        self._fleet_told_ms = 0
        self._alerts: dict[str, Any] | None = None
        self._alerts_are_new = False
        self._notices = Notices()
        self._noticed_ms = 0

    # What the feeding thread tells.

    def take(self, events: Sequence[HostEvent], now_ms: int, describe: Describe = lambda _node, _device: {}) -> None:
        """Take over what a host application has heard. What goes wrong at one event is counted, and keeps no other out."""
        for start in range(0, len(events), EVENTS_A_LOCK):
            with self._lock:
                for event in events[start : start + EVENTS_A_LOCK]:
                    if event.device is not None and event.node.node == JOBS_NODE:
                        continue  # a job is no machine, nor is each machine that a job is about one of the plant
                    try:
                        self._take(event, now_ms, describe)
                    except Exception:
                        _log.exception("the view failed at a message of %s; it goes on with the next", event.node)
                        self.counts["failures"] += 1

    def take_alerts(self, state: dict[str, Any]) -> None:
        """The alerts processor's state, as it publishes it."""
        with self._lock:
            self._alerts, self._alerts_are_new = state, True

    def refuse(self, count: str, line: str) -> None:
        """Count something that was kept out."""
        self.counts[count] += 1
        self.refused = "".join(sign if sign.isprintable() else "?" for sign in line[:LINE_MAX])

    def flush(self, now_ms: int) -> list[Batch]:
        """Return what is to be sent to readers now: each message is encoded once, however many read it."""
        with self._lock:
            jobs = [job for machine, waiting in self._waiting.items() if (job := self._job(machine, waiting, now_ms)) is not None]
            fleet, silent = list(self._fleet.items()), now_ms - self._fleet_told_ms >= SILENCE_MS_MAX
            self._fleet = {}
            tell_fleet = bool(self._fleet_readers and (fleet or silent))
            if tell_fleet:
                self._fleet_told_ms = now_ms
            alerts = self._alerts if self._alerts_are_new and (self._fleet_readers or self._waiting) else None
            self._alerts_are_new = False
            before = self._notices
            if not 0 <= now_ms - self._noticed_ms < LAG_MS:
                self._noticed_ms, self._notices = now_ms, self._noticed()
        batches = [job() for job in jobs]
        if self._notices != before:
            batches.append(notices_batch(now_ms, self._notices))
        if tell_fleet:
            batches.append(fleet_rows(now_ms, [(machine, row) for (machine, _), row in fleet]))
        if alerts is not None:
            batches.append(alerts_batch(now_ms, alerts))
        return batches

    # What anybody may ask.

    def machines(self) -> list[str]:
        """All machines, by name."""
        with self._lock:
            return sorted(self._machines)

    def fleet(self) -> list[dict[str, Any]]:
        """Each machine in short."""
        with self._lock:
            return [fleet_item(name, *self._merged(name)) for name in sorted(self._machines)]

    def state(self, machine: str, now_ms: int) -> dict[str, Any] | None:
        """All that is known of a machine now; None where nobody has heard of it."""
        with self._lock:
            return self._state(machine, now_ms) if machine in self._machines else None

    def readings(self, machine: str) -> dict[str, Reading]:
        """The last reading of each signal of a machine, the twin's included."""
        with self._lock:
            return {name: signal.reading for name, signal in self._merged(machine)[1].items()}

    def recent(
        self, machine: str, signals: Sequence[str], from_ms: int, to_ms: int
    ) -> dict[str, tuple[str | None, list[Sample]]]:
        """The samples of the last minutes in [from_ms, to_ms), with the unit, for each signal that is known."""
        with self._lock:
            known = self._merged(machine)[1]
        found = {}
        for name in signals:
            if (signal := known.get(name)) is not None:
                with self._lock:  # for each again: sixty full traces would hold up the feeding thread
                    found[name] = (signal.reading.unit, signal.trace.since(from_ms, to_ms))
        return found

    def remembers(self, machine: str, signals: Sequence[str], from_ms: int) -> bool:
        """Return True if the last minutes of these signals reach back to `from_ms`."""
        with self._lock:
            known = self._merged(machine)[1]
            asked = [known.get(name) for name in signals]
            return all(one is not None and max(one.whole_ms, one.trace.oldest_ms) <= from_ms for one in asked)

    def alerts(self) -> dict[str, Any] | None:
        """The alerts processor's state; None where it was not heard."""
        with self._lock:
            return self._alerts

    def notices(self) -> Notices:
        """The notices that stand above every view."""
        with self._lock:
            return self._notices

    def nodes(self) -> list[NodeView]:
        """Each node with its own metrics."""
        with self._lock:
            return [
                NodeView(node.node, owner.online, {name: one.reading.value for name, one in owner.signals.items()})
                for node, owner in sorted(self._nodes.items())
            ]

    def watch(self, machine: str | None) -> None:
        """Somebody reads a machine (None: the fleet) from now on."""
        with self._lock:
            if machine is None:
                self._fleet_readers += 1
            else:
                self._waiting.setdefault(machine, Waiting()).readers += 1

    def unwatch(self, machine: str | None) -> None:
        """Somebody does no longer."""
        with self._lock:
            if machine is None:
                self._fleet_readers -= 1
            else:
                self._waiting[machine].readers -= 1
                if not self._waiting[machine].readers:
                    del self._waiting[machine]

    # How it is done; the lock is held.

    def _take(self, event: HostEvent, now_ms: int, describe: Describe) -> None:
        if not is_time(event.timestamp_ms):
            event = event._replace(timestamp_ms=now_ms)
        if event.kind is EventKind.DATA:
            self._data(event, now_ms)
        elif event.kind is EventKind.BIRTH:
            self._birth(event, now_ms, describe(event.node, event.device))
        elif event.kind is EventKind.DEATH:
            self._death(event, now_ms)
        elif event.kind is EventKind.HOLE:
            self._hole(event)

    def _timed(self, reading: Reading, event: HostEvent, now_ms: int) -> Reading:
        if is_time(reading.timestamp_ms):
            return reading
        kept_out = without_time(reading, now_ms)
        self.refuse("readings_refused", f"{reading.name} of {event.device or event.node.node}: {kept_out.reason}")
        return kept_out

    def _noticed(self) -> Notices:
        own = ((node.node, owner) for node, owner in self._nodes.items() if owner.online and is_twin_node(node.node))
        metrics = ((node, {name: one.reading.value for name, one in owner.signals.items()}) for node, owner in own)
        return notices_of(metrics, self.description_faults)

    def _owner(self, event: HostEvent) -> Owner | None:
        if event.device is None:
            return self._nodes.setdefault(event.node, Owner())
        owners = self._machines.get(event.device)
        if owners is None:
            if len(self._machines) >= MACHINES_MAX:
                self.counts["machines_over_limit"] += 1
                return None
            owners = self._machines[event.device] = {}
        return owners.setdefault(event.node, Owner())

    def _birth(self, event: HostEvent, now_ms: int, properties: Mapping[str, PropertySet]) -> None:
        owner = self._owner(event)
        if owner is None:
            return
        before, owner.online = owner.clashing | owner.signals, True
        owner.signals, owner.clashing = {}, {}
        for told in event.readings:
            if event.device is not None and is_command_metric(told.name):
                continue
            reading = self._timed(told, event, now_ms)
            if len(owner.signals) >= SIGNALS_MAX:
                self.counts["signals_over_limit"] += 1
                continue
            said = properties.get(reading.name, {})
            signal = Signal(reading, _text(said, "provenance") or MEASURED, _text(said, "meaning"))
            owner.signals[reading.name] = signal
            if event.device is None:
                continue
            if (known := before.get(reading.name)) is not None:
                signal.trace = known.trace
                if reading.timestamp_ms <= known.live_ms:
                    signal.live_ms, signal.whole_ms = known.live_ms, known.whole_ms
            self._keep(signal, born_ms=event.timestamp_ms)
        owner.is_control = any(not name.startswith(TWIN_PREFIX) for name in owner.signals)
        self._anew(event, owner)

    def _data(self, event: HostEvent, now_ms: int) -> None:
        device = event.device
        owner = self._nodes.get(event.node) if device is None else self._machines.get(device, {}).get(event.node)
        if owner is None:
            return
        signals = owner.signals
        waiting = None if device is None else self._waiting.get(device)
        newest_ms = 0
        for reading in event.readings:
            name, value, t_ms, quality, _, reason, is_historical = reading
            signal = signals.get(name)
            if signal is None or is_historical:
                continue
            if not 0 <= t_ms <= STAMP_MS_MAX:
                reading = self._timed(reading, event, now_ms)  # noqa: PLW2901
                name, value, t_ms, quality, _, reason, _ = reading
            signal.reading = reading
            newest_ms = max(newest_ms, t_ms)
            if device is None:
                continue
            # The short way, for nearly all: no row is made for a good number that nobody watches.
            is_good = value.__class__ is float and reason is None and quality == Quality.GOOD
            is_watched = waiting is not None or (signal.is_key and self._fleet_readers)
            if is_good and not is_watched and isfinite(value) and signal.trace.add_good(t_ms, value):  # type: ignore[arg-type]
                continue
            row = self._keep(signal)
            if waiting is not None:
                if len(waiting.rows) < ROWS_MAX:
                    waiting.rows.append(row)
                else:
                    waiting.left_out += 1
            if signal.is_key and self._fleet_readers:
                self._fleet[device, name] = row
        if newest_ms and device is not None:
            self.counts["messages"] += 1
            self.counts["latency_ms"] += max(now_ms - newest_ms, 0)

    def _death(self, event: HostEvent, now_ms: int) -> None:
        owner = self._owner(event)
        if owner is None:
            return
        for told in event.readings:
            reading = self._timed(told, event, now_ms)
            signal = owner.signals.get(reading.name)
            if signal is not None:
                if owner.online:
                    signal.live_ms = signal.reading.timestamp_ms
                signal.reading = reading._replace(reason=offline_reason(event.node.node, reading.reason))
                if event.device is not None:
                    self._keep(signal)
        owner.online = False
        self._anew(event, owner)

    def _hole(self, event: HostEvent) -> None:
        self.counts["holes"] += 1
        for owners in self._machines.values():
            if (owner := owners.get(event.node)) is not None:
                for signal in owner.signals.values():
                    signal.whole_ms = max(signal.whole_ms, event.timestamp_ms)

    def _keep(self, signal: Signal, born_ms: int = 0) -> Row:
        """Put the signal's reading into its trace; the row that readers are told.

        A birth (at `born_ms`) repeats what is known with its old time; where a death had made it stale, it is good again from
        the birth on.
        """
        reading, trace = signal.reading, signal.trace
        name, value, t_ms, quality, _, reason, _ = reading
        if not born_ms and reason is None and quality == Quality.GOOD and isinstance(value, float) and isfinite(value):
            if not trace.add_good(t_ms, value):
                trace.add(t_ms, value, Quality.GOOD, None)
            return (t_ms, name, value, Quality.GOOD, None)
        row = _row(reading)
        if not isinstance(value, _UNSHOWN):
            if born_ms and t_ms <= trace.newest_ms:
                if trace.is_stale:
                    trace.add(born_ms, *row[2:])
            else:
                trace.add(t_ms, *row[2:])
        return row

    def _anew(self, event: HostEvent, owner: Owner) -> None:
        """Units, signals or the connection may have changed: readers are told the whole state."""
        device = event.device
        if device is None:
            return
        share(self._machines[device].values())
        if (waiting := self._waiting.get(device)) is not None:
            waiting.is_anew, waiting.rows = True, []
        if self._fleet_readers:
            for name, signal in owner.signals.items():
                if signal.is_key:
                    self._fleet[device, name] = _row(signal.reading)
            self._fleet[device, "online"] = (event.timestamp_ms, "online", self._online(device), Quality.GOOD, None)

    def _job(self, machine: str, waiting: Waiting, now_ms: int) -> Callable[[], Batch] | None:
        if not (waiting.rows or waiting.is_anew or now_ms - waiting.told_ms >= SILENCE_MS_MAX):
            return None
        waiting.told_ms = now_ms
        online = self._online(machine)
        if waiting.is_anew:
            waiting.is_anew, waiting.rows = False, []
            state = self._state(machine, now_ms)
            return lambda: state_batch(machine, state)
        rows, waiting.rows = waiting.rows, []
        left_out, waiting.left_out = waiting.left_out, 0
        return lambda: machine_rows(machine, now_ms, rows, online=online, left_out=left_out)

    def _merged(self, machine: str) -> tuple[bool, dict[str, Signal]]:
        """Return the state of the connection to the control, and the signals of all nodes that speak of the machine."""
        signals: dict[str, Signal] = {}
        for owner in self._machines.get(machine, {}).values():
            signals.update(owner.signals)
        return self._online(machine), signals

    def _online(self, machine: str) -> bool:
        return any(owner.online and owner.is_control for owner in self._machines.get(machine, {}).values())

    def _state(self, machine: str, now_ms: int) -> dict[str, Any]:
        online, signals = self._merged(machine)
        measured: dict[str, Any] = {}
        twin: dict[str, Any] = {}
        for name, signal in _sorted(signals):
            side = twin if name.startswith(TWIN_PREFIX) else measured
            side[name] = value_object(signal.reading, signal.provenance, signal.meaning)
        head = {"machine": machine, "now": now_ms, "online": online, **self._notices._asdict()}
        return {**head, "measured": measured, "twin": twin}


def _row(reading: Reading) -> Row:
    """A reading as readers are told it."""
    value, trouble = plain(reading.value)
    quality = Quality.BAD if trouble else reading.quality
    return (reading.timestamp_ms, reading.name, value, quality, trouble or reading.reason)


def _sorted(signals: Mapping[str, Signal]) -> Iterator[tuple[str, Signal]]:
    yield from sorted(signals.items())


def _text(properties: PropertySet, name: str) -> str | None:
    found = properties.get(name)
    return found.value if found is not None and isinstance(found.value, str) else None
