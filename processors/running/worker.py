"""One processor at work: folds what it is given, writes to an edge node of its own, keeps its state on the broker.

A machine whose edges are all offline has its twin device die (DDEATH), so that every reader marks its values stale by Sparkplug's
own rule, and is born again with it.
"""

import logging
import time
from collections.abc import Iterable, Iterator, Mapping, Sequence
from contextlib import suppress
from dataclasses import replace
from functools import lru_cache

from paho.mqtt.client import topic_matches_sub

from processors.actions import Action, Declare, Pin, PlainOutput, Publish, Remove
from processors.config import Configuration, ProcessorConfig
from processors.discovery import AnyProcessor
from processors.errors import SnapshotError
from processors.plain_topic import topic_level
from processors.running.engine import Engine
from processors.running.ports import EdgePort, HostPort, Recorder
from processors.running.saves import Saves
from sparkplug.actions import Publish as PlainMessage
from sparkplug.errors import SparkplugError
from sparkplug.host_session import EventKind, HostEvent
from sparkplug.metric import Change, MetricSpec
from twin.vocabulary import topics

UNBORN_S_MAX = 15.0  # for a restored machine to be born again, before it is taken for offline
DEAD_LETTERS_A_REPORT_MAX = 10  # that are published; all are counted
Shared = Mapping[str, int | float | str]
"""The health of the process, by the names that processors/running/health.py declares."""
_log = logging.getLogger(__name__)


class Worker:
    """See the module. `run` of a Runner calls it, always in one thread."""

    def __init__(
        self,
        processor: AnyProcessor,
        configuration: Configuration[ProcessorConfig],
        host: HostPort,
        edge: EdgePort,
        recorder: Recorder | None = None,
    ) -> None:
        self.name = processor.name
        self.records = recorder is not None
        self.engine = Engine(processor, configuration)
        self._processor, self._host, self._edge, self._recorder = processor, host, edge, recorder
        self._specs: tuple[MetricSpec, ...] = tuple(spec.metric() for spec in processor.outputs)
        self._alarms = frozenset(spec.name for spec in processor.outputs if spec.is_alarm)
        self._snapshot_prefix = topics.snapshots_of(processor.name)
        self._letter_prefix = topics.dead_letters_of(processor.name)
        self._listens = processor.listens
        self._declared: set[str] = set()
        self._saves = Saves()
        self._letters_left = DEAD_LETTERS_A_REPORT_MAX
        self._unborn_until_s: float | None = None
        self._reconnects = 0

    # Its life, in this order.

    def plain_filters(self) -> Iterator[str]:
        """The plain topics that it reads: its snapshots, what the processor listens to, what the recorder keeps."""
        yield self._snapshot_prefix + "+"
        yield from self._listens
        if self._recorder is not None:
            yield self._recorder.keeps_plain

    def start(self) -> None:
        """Have the edge node begin to connect."""
        self._edge.start()

    def restore(self, event: HostEvent) -> None:
        """Take a plain message that was there before us: a retained snapshot of this processor is restored."""
        if not event.payload or not event.topic.startswith(self._snapshot_prefix):
            return
        try:
            machine = self.engine.restore(event.payload)
        except SnapshotError as error:
            _log.warning("%s: snapshot on %s is not restored, the state starts fresh: %s", self.name, event.topic, error)
        else:
            _log.info("%s: restored %s", self.name, machine)

    def begin(self, now_s: float) -> None:
        """All snapshots have come."""
        self._unborn_until_s = now_s + UNBORN_S_MAX
        self._reconnects = self._host.reconnects

    def turn(self, now_s: float) -> None:
        """Do what is due."""
        if self._unborn_until_s is not None and now_s >= self._unborn_until_s:
            self._unborn_until_s = None
            self._apply(self.engine.bury_unborn(time.time_ns() // 1_000_000))
        self._save(self._saves.due(now_s))

    def beat(self, now_s: float, shared: Shared) -> None:
        """A second has passed: report, with the state that all processors of the process share."""
        self._letters_left = DEAD_LETTERS_A_REPORT_MAX
        self._apply(self.engine.beat(time.time_ns() // 1_000_000))
        self._note_changed(now_s)
        self._report(now_s, shared)

    def finish(self, now_s: float, shared: Shared) -> None:
        """Save everything, and say goodbye."""
        self._note_changed(now_s)
        self._save(self._saves.all())
        for plain in self.engine.farewell(time.time_ns() // 1_000_000):
            self._host.publish_plain(plain.topic, plain.payload, qos=1, retain=plain.retain)
        self._report(now_s, shared)

    def stop(self) -> None:
        """Have the edge node die and disconnect."""
        self._edge.stop()

    @property
    def online(self) -> bool:
        """True while its node is born."""
        return self._edge.online

    @property
    def backlog(self) -> int:
        """The number of messages that wait in its edge node for the broker to take them."""
        return self._edge.backlog

    # What it is given.

    def listens_to(self, node: str) -> bool:
        """Return True if the processor reads the node."""
        return self._processor.listens_to(node)

    def take(self, event: HostEvent, now_s: float, *, has_waited: bool = False) -> None:
        """Fold an event of a node that it reads, and send what comes of it."""
        if event.kind is not EventKind.REFUSED:
            self.record(event)
        self.send(self.engine.feed(event, now_s, has_waited=has_waited))
        if event.kind is EventKind.BIRTH and event.device is not None:
            self._press(event.device, is_new=True)

    def record(self, event: HostEvent) -> None:
        """Have an event recorded, where the processor records."""
        if self._recorder is not None:
            self._recorder.keep(event, time.time_ns() // 1_000_000)

    def send(self, actions: Sequence[Action]) -> None:
        """Send what came of the last event."""
        if actions and not self._apply(actions):
            self.engine.unsent()

    def take_plain(self, event: HostEvent) -> None:
        """Fold a plain message, where the processor listens to its topic; keep it, where the recorder wants it."""
        if self._recorder is not None and _matches(self._recorder.keeps_plain, event.topic):
            self._recorder.keep(event, event.timestamp_ms)
        elif event.payload and any(_matches(wanted, event.topic) for wanted in self._listens):
            self._apply(self.engine.plain(event.topic, event.payload, event.timestamp_ms))

    def silence(self, now_s: float) -> None:
        """Nothing waits: give the ticks of machines that are silent."""
        if actions := self.engine.silence(now_s):
            self._apply(actions)

    def _apply(self, actions: Sequence[Action]) -> bool:
        """Carry out what the engine asks; whether everything could be sent."""
        sent = True
        plain: list[PlainMessage] = []
        for action in actions:
            if isinstance(action, PlainOutput):
                plain.append(action)
            elif isinstance(action, Publish):
                sent = self._publish(action) and sent
            elif isinstance(action, Declare):
                self._edge.declare_device(action.machine, [_with_latest(spec, action.latest) for spec in self._specs])
                self._declared.add(action.machine)
            elif isinstance(action, Remove):
                if action.machine in self._declared:
                    self._declared.discard(action.machine)
                    self._edge.remove_device(action.machine)
            elif isinstance(action, Pin):
                if self._recorder is not None:
                    self._recorder.pin(action)
            elif self._letters_left > 0:
                self._letters_left -= 1
                _log.warning("%s: dead letter of %s: %s", self.name, action.machine, action.payload.decode())
                plain.append(PlainMessage(self._letter_prefix + topic_level(action.machine), action.payload))
        return (not plain or self._host.publish_all(plain)) and sent

    def _publish(self, action: Publish) -> bool:
        if action.machine not in self._declared:
            return True  # of a machine that is offline; its next birth carries what is known then
        if self._alarms and not self._alarms.isdisjoint(change[0] for change in action.changes):
            self._press(action.machine)
        try:
            return self._edge.publish(action.machine, action.changes)
        except SparkplugError as error:
            self.engine.counts.dead_letters += 1
            _log.warning("%s: %s: %s", self.name, action.machine, error)
            return True

    # What is due.

    def _note_changed(self, now_s: float) -> None:
        if self._host.reconnects != self._reconnects:
            self._reconnects = self._host.reconnects
            self.engine.mark_all_changed()  # a broker that was killed may have forgotten what it retained
        self._saves.changed(self.engine.take_changed(), now_s)

    def _press(self, machine: str, *, is_new: bool = False) -> None:
        """Have the unit of a machine that is online saved before others; with `is_new` only where it never was."""
        unit = self.engine.unit_of(machine)
        if unit is not None and not (is_new and self._saves.is_saved(unit)):
            self._saves.press(unit, time.monotonic())

    def _save(self, units: Iterable[str]) -> None:
        for unit in units:
            try:
                payload = self.engine.snapshot(unit)
            except KeyError:  # forgotten since
                self._saves.forget(unit)
                continue
            if self._host.publish_plain(self._snapshot_prefix + topic_level(unit), payload, qos=1, retain=True):
                self._saves.saved(unit, len(payload))

    def _report(self, now_s: float, shared: Shared) -> None:
        ledger, counts, host = self.engine.ledger, self.engine.counts, self._host
        at_ms = time.time_ns() // 1_000_000
        self._edge.publish(None, [Change(name, count, at_ms) for name, count in ledger.metrics().items()])
        health: dict[str, int | float | str] = {
            "machines": len(self.engine.machines),
            **shared,
            "queue_depth": host.queue_depth,
            "holes": counts.holes,
            "late": counts.late,
            "ticks": counts.ticks,
            "dead_letters": counts.dead_letters,
            "ignored": counts.ignored,
            "snapshot_age_s": round(self._saves.age_s(now_s), 3),
            "snapshots_rejected": counts.snapshots_rejected,
            "reconnects": host.reconnects,
        }
        if self._recorder is not None:
            self._give_receipts(self._recorder, at_ms)
            health |= self._recorder.health()
        self._edge.publish(None, [Change(f"health/{name}", value, at_ms) for name, value in health.items()])

    def _give_receipts(self, recorder: Recorder, at_ms: int) -> None:
        """Tell the edges that wait for it what is kept."""
        for node, device, name, value in recorder.receipts():
            with suppress(SparkplugError):  # an edge that is gone, or does not ask for receipts
                self._host.send_command(node, device, [Change(name, value, at_ms)])


@lru_cache(maxsize=50_000)
def _matches(topic_filter: str, topic: str) -> bool:
    return topic_matches_sub(topic_filter, topic)


def _with_latest(spec: MetricSpec, latest: Sequence[Change]) -> MetricSpec:
    """The declaration with the value that was published last, so that the birth carries it, as of its own time."""
    for name, value, timestamp_ms, quality, reason, _ in latest:
        if name == spec.name:
            return replace(spec, value=value, timestamp_ms=timestamp_ms, quality=quality, reason=reason)
    return spec
