"""One processor at work: folds what it is given, writes to an edge node of its own, keeps its state on the broker.

A machine whose edges are all offline has its twin device die (DDEATH), so that every reader marks its values stale by Sparkplug's
own rule, and is born again with it.
"""

import logging
import threading
import time
from collections.abc import Callable, Collection, Iterable, Iterator, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass
from functools import lru_cache

from paho.mqtt.client import topic_matches_sub

from processors.actions import Action, DeadLetter, Pin
from processors.config import Configuration, ProcessorConfig
from processors.discovery import AnyProcessor
from processors.errors import SnapshotError
from processors.plain_topic import topic_level
from processors.running.containment import Containment, Reach, shown
from processors.running.dead_letter import letter_of_message
from processors.running.engine import Engine, Way
from processors.running.ledger import DropReason
from processors.running.ports import EdgePort, HostPort, Recorder
from processors.running.saves import Saves
from processors.running.sender import Sender
from sparkplug.errors import SparkplugError
from sparkplug.host_session import EventKind, HostEvent
from sparkplug.metric import Change, NodeId
from twin.vocabulary import topics

BORN_S_MAX = 5.0  # for our own node to be born, before a restarted processor goes on without
UNBORN_S_MAX = 15.0  # for a restored machine to be born again, before it is taken for offline
Shared = Mapping[str, int | float | str]
"""The health of the process, by the names that processors/running/health.py declares."""
_log = logging.getLogger(__name__)


@dataclass(slots=True)
class Down:
    """The time in which a processor is down. `born_until_s`: how long its new edge node is awaited, once it is started."""

    until_s: float
    stopper: threading.Thread
    born_until_s: float | None = None


class Worker:
    """See the module. `run` of a Runner calls it, always in one thread."""

    def __init__(
        self,
        processor: AnyProcessor,
        configuration: Configuration[ProcessorConfig],
        host: HostPort,
        edge: EdgePort,
        recorder: Recorder | None = None,
        *,
        new_edge: Callable[[], EdgePort] | None = None,
    ) -> None:
        """`new_edge`: makes the edge node of a restart, where the old one cannot be started again."""
        self.name = processor.name
        self.records = recorder is not None
        self.engine = Engine(processor, configuration)
        self.forget_ways: Callable[[], None] = lambda: None  # called when what `engine.way_of` returned must not be used any more
        self._processor, self._host, self._edge, self._recorder = processor, host, edge, recorder
        self._configuration = configuration
        self._new_edge = new_edge or (lambda: edge)
        self._faults = Containment()
        self._down: Down | None = None
        self._is_recording = recorder is not None
        self._sender = Sender(processor, host, edge, alarmed=self._press, pin=self._pin)
        self._snapshot_prefix = topics.snapshots_of(processor.name)
        self._listens = processor.listens
        self._snapshots: dict[str, bytes] = {}  # of each unit, as it was restored or saved last
        self._saves = Saves()
        self._unborn_until_s: float | None = None
        self._reconnects = 0

    # Its life, in this order.

    def plain_filters(self) -> Iterator[str]:
        """The plain topics that it reads: its snapshots, what the processor listens to, what the recorder keeps."""
        yield self._snapshot_prefix + "+"
        yield from self._listens
        if self._recorder is not None:
            yield from self._recorder.keeps_plain

    def start(self) -> None:
        """Have the edge node begin to connect."""
        self._edge.start()

    def restore(self, event: HostEvent) -> None:
        """Take a plain message that was there before us: a retained snapshot of this processor is restored."""
        if not event.payload or not event.topic.startswith(self._snapshot_prefix):
            return
        try:
            unit = self.engine.restore(event.payload)
        except SnapshotError as error:
            _log.warning("%s: snapshot on %s is not restored, the state starts fresh: %s", self.name, event.topic, error)
        except Exception as error:
            self._judge(event.topic, "", error, time.monotonic())
        else:
            self._snapshots[unit] = event.payload
            _log.info("%s: restored %s", self.name, unit)

    def begin(self, now_s: float) -> None:
        """Begin once all snapshots have come, and ask whoever told what they hold for births: a machine at rest says nothing."""
        self._unborn_until_s = now_s + UNBORN_S_MAX
        for node in self.engine.awaited:
            self._host.want_birth(node)
        self._reconnects = self._host.reconnects

    def turn(self, now_s: float) -> None:
        """Do what is due."""
        if self._down is not None:
            self._recover(self._down, now_s)
            return
        try:
            if self._unborn_until_s is not None and now_s >= self._unborn_until_s:
                self._unborn_until_s = None
                self._apply(self.engine.bury_unborn(time.time_ns() // 1_000_000), now_s)
            self._save(self._saves.due(now_s))
            if self._faults.aside:
                self._take_up(self._faults.taken_up(now_s), now_s)
        except Exception as error:
            self._go_down("a turn", error, now_s)

    def beat(self, now_s: float, shared: Shared) -> None:
        """A second has passed: report, with the state that all processors of the process share."""
        self._sender.reported()
        if self._down is not None:
            return
        try:
            self._apply(self.engine.beat(time.time_ns() // 1_000_000), now_s)
            self._note_changed(now_s)
            self._report(now_s, shared)
        except Exception as error:
            self._go_down("a beat", error, now_s)

    def finish(self, now_s: float, shared: Shared) -> None:
        """Save everything, and say goodbye."""
        if self._down is not None:
            return
        try:
            self._note_changed(now_s)
            self._save(self._saves.all())
            for plain in self.engine.farewell(time.time_ns() // 1_000_000):
                self._host.publish_plain(plain.topic, plain.payload, qos=1, retain=plain.retain)
            self._report(now_s, shared)
        except Exception:
            _log.exception("%s: the goodbye failed", self.name)

    def stop(self) -> None:
        """Have the edge node die and disconnect."""
        if self._down is None or not self._down.stopper.is_alive():
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

    def take(self, event: HostEvent, now_s: float) -> None:
        """Fold an event of a node that it reads, and send what comes of it."""
        if self._down is not None or (event.device or str(event.node)) in self._faults.aside:
            self.engine.lost(event, DropReason.FAULT)
            return
        try:
            actions = self.engine.feed(event, now_s)
        except Exception as error:
            self.failed(event, error, now_s)
            return
        self.send(actions, event, now_s)
        if event.kind is EventKind.BIRTH and event.device is not None:
            self._press(event.device, is_new=True)

    def record(self, event: HostEvent, now_s: float) -> None:
        """Have an event recorded as it comes, where the processor records it; also while its fold is down."""
        if self._recorder is None or not self._is_recording:
            return
        if event.kind is EventKind.PLAIN and not any(_matches(wanted, event.topic) for wanted in self._recorder.keeps_plain):
            return
        try:
            self._recorder.keep(event, time.time_ns() // 1_000_000)
        except Exception as error:
            self._is_recording = False
            self._go_down("the recorder", error, now_s)

    def way_of(self, node: NodeId, device: str) -> Way | None:
        """Return the shortest way for data of a device, as `Engine.way_of`; it holds until `forget_ways` is called."""
        return None if self._down is not None else self.engine.way_of(node, device)

    def send(self, actions: Sequence[Action], event: HostEvent, now_s: float) -> None:
        """Send what came of an event, the last one that was folded."""
        try:
            if actions and (reason := self._apply(actions, now_s)) is not None:
                self.engine.unsent(reason)
        except Exception as error:
            self.engine.unsent(DropReason.FAULT)
            self._judge(event.device or str(event.node), str(event.node), error, now_s)

    def take_plain(self, event: HostEvent, now_s: float) -> None:
        """Fold a plain message, where the processor listens to its topic."""
        if self._down is None and event.payload and any(_matches(wanted, event.topic) for wanted in self._listens):
            if event.topic in self._faults.aside:
                return
            try:
                self._apply(self.engine.plain(event.topic, event.payload, event.timestamp_ms), now_s)
            except Exception as error:
                self._judge(event.topic, "", error, now_s)

    def silence(self, now_s: float) -> None:
        """Nothing waits: give the ticks of machines that are silent."""
        if self._down is not None:
            return
        try:
            if actions := self.engine.silence(now_s):
                self._apply(actions, now_s)
        except Exception as error:
            self._go_down("a silence", error, now_s)

    def _apply(self, actions: Sequence[Action], now_s: float) -> DropReason | None:
        """Carry out what the engine asks; why not everything could be sent."""
        missed, failures = self._sender.apply(actions, self.engine.counts)
        for machine, error in failures:
            self._judge(machine, "", error, now_s)
        return missed

    def _pin(self, pin: Pin) -> None:
        if self._recorder is not None:
            self._recorder.pin(pin)

    # Faults.

    def failed(self, event: HostEvent, error: Exception, now_s: float) -> None:
        """An event could not be folded; it is counted, and nothing but what it is about is set aside."""
        self.engine.lost(event, DropReason.FAULT)
        self._apply([DeadLetter(event.device or str(event.node), letter_of_message(self.name, event, error))], now_s)
        self._judge(event.device or str(event.node), str(event.node), error, now_s)

    def _judge(self, name: str, node: str, error: Exception, now_s: float) -> None:
        """A message of a machine has failed, or of a node or a topic of that name."""
        reach = self._faults.failed(name, node, error, now_s, machines=len(self.engine.machines))
        _log.warning("%s: %s", self.name, self._faults.text, exc_info=error)
        if reach is not Reach.MESSAGE:
            self.forget_ways()
            self._snapshots.pop(name, None)
            self._apply(self.engine.abandon(name, time.time_ns() // 1_000_000), now_s)
        if reach is Reach.PROCESSOR:
            self._go_down("most machines", error, now_s)

    def _take_up(self, machines: Collection[str], now_s: float) -> None:
        """Begin with machines again, from the births that the host session remembers."""
        for event in self._host.births() if machines else ():
            if event.device in machines and self.listens_to(event.node.node):
                self.take(event, now_s)

    def _go_down(self, what: str, error: Exception, now_s: float) -> None:
        """Die, so that everybody sees it, and come back after a pause. Nothing of it keeps the other processors waiting."""
        if self._down is not None:
            return
        until_s = self._faults.down(what, error, now_s)
        _log.error("%s: %s", self.name, self._faults.text, exc_info=error)
        stopper = threading.Thread(target=self._edge.stop, name=f"stop {self.name}", daemon=True)
        self._down = Down(until_s, stopper)
        self.forget_ways()
        self.engine.close()
        stopper.start()

    def _recover(self, down: Down, now_s: float) -> None:
        """Come back once the pause is over: from the snapshots, as after a restart of the process."""
        if now_s < down.until_s or down.stopper.is_alive():
            return
        try:
            if down.born_until_s is None:
                self._edge = self._new_edge()
                self._sender.begin(self._edge)
                self._edge.start()
                down.born_until_s = now_s + BORN_S_MAX
            if not self._edge.online and now_s < down.born_until_s:
                return
            self._begin_again(now_s)
        except Exception as error:
            self._down = None
            self._go_down("the restart", error, now_s)

    def _begin_again(self, now_s: float) -> None:
        self.engine = Engine(self._processor, self._configuration, before=self.engine)
        for unit, payload in list(self._snapshots.items()):
            try:
                self.engine.restore(payload)
            except SnapshotError as error:
                del self._snapshots[unit]
                _log.warning("%s: snapshot of %s is not restored, the state starts fresh: %s", self.name, shown(unit), error)
        if self._recorder is not None and not self._is_recording:
            self._recorder.begin_again()
            self._is_recording = True
        self._saves = Saves()
        self._down = None
        self.begin(now_s)
        _log.warning("%s: is back", self.name)
        for event in self._host.births():
            if self.listens_to(event.node.node):
                self.take(event, now_s)

    @property
    def is_hopeless(self) -> bool:
        """True while it is down, and has failed until its pause could grow no longer."""
        return self._down is not None and self._faults.is_at_the_longest_pause

    @property
    def fault(self) -> str:
        """The last fault, in one line; empty where there was none."""
        return self._faults.text

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
                self._snapshots.pop(unit, None)
                continue
            if self._host.publish_plain(self._snapshot_prefix + topic_level(unit), payload, qos=1, retain=True):
                self._saves.saved(unit, len(payload))
                self._snapshots[unit] = payload

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
            "overload": ledger.dropped[DropReason.OVERLOAD],
            "faults": self._faults.faults,
            "fault": self._faults.text,
            "restarts": self._faults.restarts,
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
