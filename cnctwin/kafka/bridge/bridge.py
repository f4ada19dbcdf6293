"""The bridge at work: one loop in which a host session's events go to the log, and results of the log to the broker.

broker ──► host session ──► records by machine and by cell ──► readings, cells
broker ◄── edge nodes twin-… ◄────────────────────────────────── results
"""

import logging
import time
from collections.abc import Sequence
from pathlib import Path
from threading import Event
from zlib import crc32

from paho.mqtt.client import topic_matches_sub

from cnctwin.kafka.bridge.back import Back
from cnctwin.kafka.bridge.births import Births
from cnctwin.kafka.bridge.keying import Keying
from cnctwin.kafka.bridge.origins import Origins
from cnctwin.kafka.bridge.outward import Outward
from cnctwin.kafka.bridge.reports import Reports
from cnctwin.kafka.kept import read_kept
from cnctwin.kafka.request import Request
from cnctwin.kafka.settings import KafkaSettings
from cnctwin.kafka.topics import Topics
from processors.description import machine_and_role
from processors.description_folder import DescriptionFolder
from processors.running.cycles import seldom_looked_for
from processors.running.descriptions import Descriptions
from processors.running.runtime import Configured
from sparkplug.edge_node import EdgeNode
from sparkplug.host import HostApplication
from sparkplug.host_event import EventKind, HostEvent
from sparkplug.metric import NodeId
from twin.vocabulary import topics as plain_topics
from twin.vocabulary.nodes import is_twin_node

POLL_S = 0.02
GATHER_S = 0.02
WATERMARK_MS = 1000
RESTORE_S_MAX = 120.0
REFRESH_SHARE = 4  # births are asked for again so many times while a record is kept
_log = logging.getLogger(__name__)
_PLAIN, _REFUSED, _HOLE = EventKind.PLAIN, EventKind.REFUSED, EventKind.HOLE


class Bridge:
    """See the module. All of it happens in the thread that calls `run`.

    pairs: the processors that run on the log; nodes: edge nodes of those whose results this bridge publishes
    """

    def __init__(
        self,
        settings: KafkaSettings,
        topics: Topics,
        name: str,
        pairs: Sequence[Configured],
        *,
        host: HostApplication,
        nodes: dict[str, EdgeNode],
        machines: Path | None = None,
        keeps_session: bool = False,
    ) -> None:
        self._keeps_session = keeps_session
        self._settings, self._topics, self._name, self._host, self._nodes = settings, topics, name, host, nodes
        self._keying = Keying(topics, pairs)
        self._origins = Origins(host.picture)
        self._outward = Outward(settings, name, owes=keeps_session)
        self._births = Births(lambda topic, payload: self._outward.keep(topics.births, topic, payload))
        if keeps_session:
            host.on_life = self._births.take
        published = [(processor, one) for processor, one in pairs if processor.name in nodes]
        self._back = Back(settings, topics, name, published, host=host, nodes=nodes) if nodes else None
        self._learning: Request[None] | None = None  # what was published before
        # Of several bridges the one that publishes a processor's results hands on what that processor listens to: once.
        self._cell_listeners = [(topics.cells(one.name), one) for one, _ in published if one.is_of_cells]
        self._descriptions = Descriptions(host, (), DescriptionFolder(machines)) if machines is not None else None
        self._reports = Reports(settings, topics, name, nodes)
        self._marked_ms = 0
        self._received_ms = 0
        self._refreshed_s: dict[NodeId, float] = {}
        self.events = 0

    def prepare(self) -> None:
        """Learn which births an earlier run has kept. Raises SnapshotError where the log does not answer."""
        for topic_filter in dict.fromkeys(self._plain_filters()):
            self._host.subscribe_plain(topic_filter)
        if self._back is not None:
            self._learning = Request(self._back.begin)
        if self._keeps_session:
            self._host.restore(self._births.restored(self._known_births()))

    def run(self, stop: Event) -> None:
        """Work until `stop` is set. Raises SnapshotError where the log does not answer."""
        with seldom_looked_for():
            self._run(stop)

    def _run(self, stop: Event) -> None:
        self._host.start()
        try:
            while not stop.is_set():
                self.turn()
        finally:
            if self._learning is None:  # else the nodes were never there, and a thread has the consumer
                for node in self._nodes.values():
                    node.stop()
            self._host.stop()
            if self._back is not None and self._learning is None:
                self._back.close()
            self._reports.leave(self._outward)
            if waiting := self._outward.close():
                _log.warning("%d records were not acknowledged", waiting)
            self._reports.close()

    def _known_births(self) -> dict[str, bytes]:
        numbers = list(range(self._settings.partitions))
        kept = read_kept(self._settings.client(), self._topics.births, numbers, timeout_s=RESTORE_S_MAX)
        return {topic: payload for of_partition in kept.values() for topic, payload in of_partition.items()}

    def _plain_filters(self) -> Sequence[str]:
        listened = [wanted for _, processor in self._cell_listeners for wanted in processor.listens]
        return [plain_topics.DESCRIPTION + "#", *listened]

    def turn(self) -> None:
        """One round: what the broker says, then what the log says, then what is due."""
        events = self._host.poll(POLL_S, GATHER_S)
        now_ms = self._now_ms()
        for event in events:
            self._take(event, now_ms)
        self._births.catch_up()
        self._outward.owe(self._host.take_held())
        if self._back is not None and self._publishes():
            self._back.turn()  # else results wait in the log: what is published while nobody listens is lost
        self._outward.poll()
        self._host.acknowledge(self._outward.take_safe())
        now_s = time.monotonic()
        if not self._host.queue_depth:
            self._mark(now_ms)
        for node, device in self._outward.take_untold():
            self._tell_again(node, device, now_ms)
        if self._back is not None and self._learning is None:
            self._back.commit(now_s)
        if self._reports.is_due(now_s):
            self._look(now_s)

    def _publishes(self) -> bool:
        """Return True if results can be published. The edge nodes are born once the bridge knows what was published before; until
        then it only writes what machines send to the log."""
        if self._learning is not None:
            if not self._learning.is_over:
                return False
            self._learning.answer()
            self._learning = None
            for node in self._nodes.values():
                node.start()
        return self._host.online and all(node.online for node in self._nodes.values())

    def _now_ms(self) -> int:
        """Return the time on the wall, which never goes back."""
        self._received_ms = max(self._received_ms, time.time_ns() // 1_000_000)
        return self._received_ms

    # To the log.

    def _take(self, event: HostEvent, now_ms: int) -> None:
        if event.kind is _PLAIN:
            self._plain(event, now_ms)
            return
        if event.kind is _REFUSED:
            return
        self.events += 1
        origin = self._origins.of(event)
        if event.device is not None:
            for topic, key, part in self._keying.addressed(event):
                self._outward.put(topic, key, part, now_ms, origin)
        elif event.kind is _HOLE:
            picture = self._host.picture(event.node)
            for device in () if picture is None else picture.devices:
                self._take(event._replace(device=device), now_ms)

    def _plain(self, event: HostEvent, now_ms: int) -> None:
        """Hand a description to its machine's partition, and what a processor listens to to all partitions of its topic."""
        if (key := machine_and_role(event.topic)) is not None:
            self._outward.put_plain(self._topics.readings, key[0], -1, event, now_ms)
        if self._descriptions is not None and event.topic.startswith(plain_topics.DESCRIPTION):
            self._descriptions.take(event, time.monotonic())
        for topic, processor in self._cell_listeners:
            if any(topic_matches_sub(wanted, event.topic) for wanted in processor.listens):
                for number in range(self._settings.partitions):
                    self._outward.put_plain(topic, event.topic, number, event, now_ms)

    def _mark(self, now_ms: int) -> None:
        """Say how far the log has come, at each full second."""
        at_ms = now_ms // WATERMARK_MS * WATERMARK_MS
        if at_ms <= self._marked_ms or not self._host.online:
            return
        self._marked_ms = at_ms
        for topic in self._keying.topics:
            for number in range(self._settings.partitions):
                self._outward.watermark(topic, number, at_ms)

    def _tell_again(self, node: NodeId, device: str, now_ms: int) -> None:
        """Something found no room: say what holds by now."""
        picture = self._host.picture(node)
        owner = None if picture is None else picture.devices.get(device)
        if owner is None:
            return
        kind = EventKind.BIRTH if owner.online else EventKind.DEATH
        readings = tuple(owner.readings.values())
        at_ms = max((owner.birth_ms, *(one.timestamp_ms for one in readings)))
        self._take(HostEvent(kind, node, device, at_ms, readings, "told again"), now_ms)

    # Once a second.

    def _look(self, now_s: float) -> None:
        if self._back is not None:
            self._back.reported()
        if self._descriptions is not None:
            self._descriptions.look()
        self._refresh(now_s)
        self._reports.report(now_s, self._host, self._outward, self.events)

    def _refresh(self, now_s: float) -> None:
        """Ask each node for its births before the log forgets the last ones."""
        every_s = self._settings.retention_hours * 3600 / REFRESH_SHARE
        for node in self._host.nodes():
            if is_twin_node(node.node):
                continue
            spread_s = crc32(str(node).encode()) % 1000 / 1000 * every_s
            if now_s - self._refreshed_s.setdefault(node, now_s - spread_s) >= every_s:
                self._refreshed_s[node] = now_s
                self._host.request_rebirth(node)
