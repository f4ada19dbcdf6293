"""One processor at work: reads from a host application, folds, writes to an edge node. All of it in the thread that calls `run`.

Start: subscribe to the snapshots, then publish a marker behind them: when it comes back, all retained snapshots have come. Only
then is anything folded; what comes before waits. A machine whose edges are all offline has its twin device die (DDEATH), so that
every reader marks its values stale by Sparkplug's own rule, and is born again with it.
"""

import logging
import os
import socket
import time
from collections import deque
from collections.abc import Sequence
from contextlib import suppress
from dataclasses import replace
from threading import Event

from paho.mqtt.client import topic_matches_sub

from processors.actions import Action, Declare, Pin, Publish, PublishPlain, Remove
from processors.config import Configuration, ProcessorConfig
from processors.discovery import AnyProcessor
from processors.errors import SnapshotError
from processors.lag_report import SPOKEN_OF_S, LagReport, topic_of
from processors.plain_topic import topic_level
from processors.running.engine import Engine
from processors.running.lag import Lag
from processors.running.ports import EdgePort, HostPort, Recorder
from sparkplug.errors import SparkplugError
from sparkplug.host_session import EventKind, HostEvent
from sparkplug.metric import Change, MetricSpec
from twin.vocabulary import topics
from twin.vocabulary.nodes import is_twin_node

PROCESS = f"{socket.gethostname()}:{os.getpid()}"
POLL_S = 0.05
RESTORE_S_MAX = 1.0  # to wait for the snapshots, once the broker answers
UNBORN_S_MAX = 15.0  # for a restored machine to be born again, before it is taken for offline
SNAPSHOT_S = 2.0
REPORT_S = 1.0
STALL_S = 1.0  # a longer pause of this process is no silence of the machine
WAITING_MAX = 100_000  # events, while the snapshots are awaited
DEAD_LETTERS_A_REPORT_MAX = 10  # that are published; all are counted
_log = logging.getLogger(__name__)


class Worker:
    """See the module."""

    def __init__(
        self,
        processor: AnyProcessor,
        configuration: Configuration[ProcessorConfig],
        host: HostPort,
        edge: EdgePort,
        recorder: Recorder | None = None,
    ) -> None:
        self.engine = Engine(processor, configuration)
        self._processor, self._host, self._edge, self._recorder = processor, host, edge, recorder
        self._specs: tuple[MetricSpec, ...] = tuple(spec.metric() for spec in processor.outputs)
        self._snapshot_prefix = topics.snapshots_of(processor.name)
        self._letter_prefix = topics.dead_letters_of(processor.name)
        self._marker_topic = topics.marker_of(processor.name)
        self._listens = processor.listens
        self._declared: set[str] = set()
        self._waiting: deque[HostEvent] = deque()
        self._unsaved: dict[str, float] = {}  # unit: since when
        self._saved: set[str] = set()
        self._letters_left = DEAD_LETTERS_A_REPORT_MAX
        self._reported_s = self._saved_s = 0.0
        self._is_restored = False
        self._turned_s = time.monotonic()
        self._patient_until_s = 0.0
        self._unborn_until_s: float | None = None
        self._queue_dropped = self._reconnects = 0
        self._lag = Lag(self._turned_s, time.time(), time.process_time())
        self._speaks_of_lag = False

    def run(self, stop: Event) -> None:
        """Work until `stop` is set, then save, say goodbye and disconnect."""
        self._host.subscribe_plain(self._snapshot_prefix + "+")
        self._host.subscribe_plain(self._marker_topic)
        for wanted in self._listens:
            self._host.subscribe_plain(wanted)
        if self._recorder is not None:
            self._host.subscribe_plain(self._recorder.keeps_plain)
        self._host.start()
        self._edge.start()
        try:
            if self._restore(stop):
                self._begin(stop)
                while not stop.is_set():
                    self.turn()
        finally:
            self._close()

    def turn(self) -> None:
        """One round: what has come, else silence; then what is due."""
        called_s = time.monotonic()
        events = self._host.poll(POLL_S)
        now_s = time.monotonic()
        if not (self._host.backlog or self._edge.backlog):
            self._lag.published(now_s)  # all of the turns before
        for event in events:
            self._take(event, now_s)
            if (folded_s := time.monotonic()) - self._reported_s >= REPORT_S:  # however much has come
                self._report_due(folded_s)
        if max(now_s - called_s, called_s - self._turned_s) > STALL_S:
            self._patient_until_s = now_s + STALL_S  # we slept: what came meanwhile is still on its way to the queue
        self._turned_s = now_s
        if self._host.online and not self._host.queue_depth and now_s >= self._patient_until_s:
            self._apply(self.engine.silence(now_s))
        if self._unborn_until_s is not None and now_s >= self._unborn_until_s:
            self._unborn_until_s = None
            self._apply(self.engine.bury_unborn(time.time_ns() // 1_000_000))
        if now_s - self._reported_s >= REPORT_S:
            self._report_due(now_s)
        if now_s - self._saved_s >= SNAPSHOT_S or not self._saved.issuperset(self.engine.units):
            # What was never saved is saved at once: what its estimate was started from would be lost for good.
            self._saved_s = now_s
            self._save(now_s)

    # Start and end.

    def _restore(self, stop: Event) -> bool:
        """Take the retained snapshots; False where `stop` came first, and nothing is known that may be saved."""
        marked_s: float | None = None
        while not stop.is_set():
            if marked_s is None and self._host.publish_plain(self._marker_topic, b"all retained snapshots have come", qos=1):
                marked_s = time.monotonic()
            complete = False
            for event in self._host.poll(POLL_S):
                if event.topic == self._marker_topic:
                    complete = marked_s is not None
                elif event.topic.startswith(self._snapshot_prefix):
                    self._take_snapshot(event)
                else:
                    self._wait_with(event)
            if complete:
                return True
            if marked_s is not None and time.monotonic() - marked_s > RESTORE_S_MAX:
                _log.warning(
                    "%s: the broker took more than %g s; what has come by now is all", self._processor.name, RESTORE_S_MAX
                )
                return True
        return False

    def _begin(self, stop: Event) -> None:
        """Fold what has come while the snapshots were awaited."""
        self._is_restored = True
        self._unborn_until_s = time.monotonic() + UNBORN_S_MAX
        self._await_edge(stop)
        self._reconnects = self._host.reconnects
        now_s = time.monotonic()
        while self._waiting:
            self._take(self._waiting.popleft(), now_s, has_waited=True)

    def _await_edge(self, stop: Event) -> None:
        """Results can go out once our own node is born; a moment's patience saves the first ones."""
        until_s = time.monotonic() + RESTORE_S_MAX
        while not (self._edge.online or stop.is_set() or time.monotonic() > until_s):
            for event in self._host.poll(POLL_S):
                self._wait_with(event)

    def _wait_with(self, event: HostEvent) -> None:
        has_room = len(self._waiting) < WAITING_MAX
        self.engine.received(event, has_room=has_room)
        if has_room:
            self._waiting.append(event)

    def _take_snapshot(self, event: HostEvent) -> None:
        if not event.payload:
            return
        try:
            machine = self.engine.restore(event.payload)
        except SnapshotError as error:
            _log.warning(
                "%s: snapshot on %s is not restored, the state starts fresh: %s", self._processor.name, event.topic, error
            )
        else:
            _log.info("%s: restored %s", self._processor.name, machine)

    def _close(self) -> None:
        now_s = time.monotonic()
        if self._is_restored:
            self._save(now_s)
            for plain in self.engine.farewell(time.time_ns() // 1_000_000):
                self._host.publish_plain(plain.topic, plain.payload, qos=1, retain=plain.retain)
            self._report(now_s)
        self._edge.stop()
        self._host.stop()

    # Events and actions.

    def _take(self, event: HostEvent, now_s: float, *, has_waited: bool = False) -> None:
        if event.kind is not EventKind.PLAIN:
            if self._recorder is not None and self._processor.listens_to(event.node.node):
                self._recorder.keep(event, time.time_ns() // 1_000_000)
            if not self._apply(self.engine.feed(event, now_s, has_waited=has_waited)):
                self.engine.unsent()
            is_of_edge = event.kind is EventKind.DATA and not is_twin_node(event.node.node)
            if is_of_edge and not any(reading.is_historical for reading in event.readings):
                self._lag.folded(event.node.node, event.timestamp_ms, time.monotonic())
        elif self._recorder is not None and topic_matches_sub(self._recorder.keeps_plain, event.topic):
            self._recorder.keep(event, event.timestamp_ms)
        elif event.payload and any(topic_matches_sub(wanted, event.topic) for wanted in self._listens):
            self._apply(self.engine.plain(event.topic, event.payload, event.timestamp_ms))

    def _apply(self, actions: Sequence[Action]) -> bool:
        """Carry out what the engine asks; whether everything could be sent."""
        sent = True
        for action in actions:
            if isinstance(action, Publish):
                sent = self._publish(action) and sent
            elif isinstance(action, PublishPlain):
                sent = self._host.publish_plain(action.topic, action.payload, qos=action.qos, retain=action.retain) and sent
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
                _log.warning("%s: dead letter of %s: %s", self._processor.name, action.machine, action.payload.decode())
                self._host.publish_plain(self._letter_prefix + topic_level(action.machine), action.payload)
        return sent

    def _publish(self, action: Publish) -> bool:
        if action.machine not in self._declared:
            return True  # of a machine that is offline; its next birth carries what is known then
        try:
            return self._edge.publish(action.machine, action.changes)
        except SparkplugError as error:
            self.engine.counts.dead_letters += 1
            _log.warning("%s: %s: %s", self._processor.name, action.machine, error)
            return True

    # What is due.

    def _report_due(self, now_s: float) -> None:
        self._reported_s = now_s
        self._letters_left = DEAD_LETTERS_A_REPORT_MAX
        self._apply(self.engine.beat(time.time_ns() // 1_000_000))
        self._note_changed(now_s)
        self._report(now_s)

    def _note_changed(self, now_s: float) -> None:
        if self._host.reconnects != self._reconnects:
            self._reconnects = self._host.reconnects
            self.engine.mark_all_changed()  # a broker that was killed may have forgotten what it retained
        for machine in self.engine.take_changed():
            self._unsaved.setdefault(machine, now_s)

    def _save(self, now_s: float) -> None:
        self._note_changed(now_s)
        for machine in list(self._unsaved):
            try:
                payload = self.engine.snapshot(machine)
            except KeyError:  # forgotten since
                del self._unsaved[machine]
                continue
            if self._host.publish_plain(self._snapshot_prefix + topic_level(machine), payload, qos=1, retain=True):
                del self._unsaved[machine]
                self._saved.add(machine)

    def _report(self, now_s: float) -> None:
        ledger, counts, host = self.engine.ledger, self.engine.counts, self._host
        overflowed = host.dropped - self._queue_dropped
        self._queue_dropped += overflowed
        self.engine.overflowed(overflowed)
        at_ms = time.time_ns() // 1_000_000
        self._edge.publish(None, [Change(name, count, at_ms) for name, count in ledger.metrics().items()])
        lag = self._report_lag(now_s, at_ms)
        health: dict[str, int | float | str] = {
            "machines": lag.machines,
            "lag_s": round(self._lag.folded_s, 3),
            "published_lag_s": lag.lag_s,
            "busy_pct": lag.busy_pct,
            "process": lag.process,
            "queue_depth": host.queue_depth,
            "holes": counts.holes,
            "late": counts.late,
            "ticks": counts.ticks,
            "dead_letters": counts.dead_letters,
            "ignored": counts.ignored,
            "snapshot_age_s": round(max((now_s - since_s for since_s in self._unsaved.values()), default=0.0), 3),
            "snapshots_rejected": counts.snapshots_rejected,
            "reconnects": host.reconnects,
        }
        if self._recorder is not None:
            self._give_receipts(self._recorder, at_ms)
            health |= self._recorder.health()
        self._edge.publish(None, [Change(f"health/{name}", value, at_ms) for name, value in health.items()])

    def _report_lag(self, now_s: float, at_ms: int) -> LagReport:
        """Work out the lag, and say it where somebody should know. The alerts of this process hear of it without the way over the
        broker, on which it would come late."""
        self._lag.report(now_s, time.time(), time.process_time())
        lag_s, busy_pct = round(self._lag.published_s, 3), round(self._lag.busy_pct, 1)
        report = LagReport((self._processor.name,), PROCESS, at_ms, lag_s, len(self.engine.machines), busy_pct)
        speaks = lag_s >= SPOKEN_OF_S
        if speaks or self._speaks_of_lag:
            topic, payload = topic_of(self._processor.name), report.payload()
            self._host.publish_plain(topic, payload)
            if any(topic_matches_sub(wanted, topic) for wanted in self._listens):
                self._apply(self.engine.plain(topic, payload, at_ms))
        self._speaks_of_lag = speaks
        return report

    def _give_receipts(self, recorder: Recorder, at_ms: int) -> None:
        """Tell the edges that wait for it what is kept."""
        for node, device, name, value in recorder.receipts():
            with suppress(SparkplugError):  # an edge that is gone, or does not ask for receipts
                self._host.send_command(node, device, [Change(name, value, at_ms)])


def _with_latest(spec: MetricSpec, latest: Sequence[Change]) -> MetricSpec:
    """The declaration with the value that was published last, so that the birth carries it, as of its own time."""
    for name, value, timestamp_ms, quality, reason, _ in latest:
        if name == spec.name:
            return replace(spec, value=value, timestamp_ms=timestamp_ms, quality=quality, reason=reason)
    return spec
