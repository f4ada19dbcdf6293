"""Edge nodes and a host application joined by a broker that exists only in memory and does what it is told: lose, repeat, delay.

Nothing here knows how the sessions work inside. What an edge has published is kept apart as the truth, and what the host says in
its events is kept apart as what a follower of those events would believe.
"""

from __future__ import annotations

import json
from collections import Counter
from random import Random
from typing import Any

from sparkplug.actions import Action, Disconnect, Publish, Subscribe, WalkToNextServer
from sparkplug.datatype import DataType
from sparkplug.edge_session import EdgeNodeSession, Phase
from sparkplug.host_session import EventKind, HostEvent, HostSession
from sparkplug.metric import Change, MetricSpec, NodeId, Reading
from sparkplug.quality import Quality
from tests.sparkplug.edge_watch import EdgeWatch
from tests.sparkplug.simulated_edge import Edge, Flying, Known, flying_of

EPOCH_MS = 1_750_000_000_000
HOST_ID = "scada"
STATE_TOPIC = f"spBv1.0/STATE/{HOST_ID}"
REBIRTH_TOPIC_PART = "/NCMD/"
REBIRTH_INTERVAL_MS = 5000
RESTART_MS = 50
QUIET_MS = 75_000  # longer than the host's longest pause between two requests for a rebirth


class World:
    """The whole plant; every method is one thing that can happen."""

    def __init__(self, edges: int = 2) -> None:
        self.now_ms = EPOCH_MS
        self.host = self._new_host()
        self.host_will: Publish | None = None
        self.late_host_wills: list[Publish] = []
        self.flight: list[Flying] = []
        self.late_wills: list[Flying] = []
        self.retained_state: bytes | None = None
        self.followed: dict[tuple[NodeId, str | None], dict[str, Reading]] = {}
        self.births_lost = False
        self.step_ms = 1
        self.published: Counter[tuple[Any, ...]] = Counter()
        self.taken: Counter[tuple[Any, ...]] = Counter()
        self.asked_ms: dict[NodeId, int] = {}
        self.edges: list[Edge] = []
        metrics = (MetricSpec("beat", DataType.INT64, value=0), MetricSpec("lag", DataType.DOUBLE, unit="ms"))
        for number in range(edges):
            node = NodeId("cnc", f"edge-{number}")
            primary = HOST_ID if number == 1 else None
            edge = Edge(node, metrics, primary, EdgeNodeSession(node, metrics, now_ms=self.now_ms, primary_host=primary))
            self._declare_truth(edge, None, metrics, keep=False)
            self.edges.append(edge)

    @staticmethod
    def _new_host() -> HostSession:
        return HostSession(HOST_ID, chance=Random(0), rebirth_interval_ms_min=REBIRTH_INTERVAL_MS)

    # The edge's side.

    def connect_edge(self, edge: Edge) -> None:
        """The node opens a connection and the broker accepts it."""
        self._pass(1)
        number = 0 if edge.bd_seq is None else (edge.bd_seq + 1) % 256
        connect = edge.session.connecting(number, self.now_ms)
        edge.watch.connecting(connect, edge.bd_seq)
        edge.bd_seq, edge.will = number, connect.will
        self._do_edge(edge, edge.session.connected(self.now_ms))

    def cut_edge(self, edge: Edge) -> None:
        """The connection breaks; the broker will send the will, some time."""
        assert edge.will is not None
        self.late_wills.append(flying_of(edge.will, edge.node))
        self._end_edge(edge)

    def close_edge(self, edge: Edge) -> None:
        """The node ends by its own will."""
        self._pass(1)
        self._do_edge(edge, edge.session.close(self.now_ms))

    def restart_edge(self, edge: Edge, *, remembers_bd_seq: bool) -> None:
        """The node's process is killed and started again; it knows nothing but, perhaps, its last bdSeq."""
        if edge.connected:
            self.cut_edge(edge)
        self._pass(RESTART_MS)
        edge.session = EdgeNodeSession(edge.node, edge.metrics, now_ms=self.now_ms, primary_host=edge.primary_host)
        edge.truth, edge.specs, edge.state_ms = {}, {}, 0
        self._declare_truth(edge, None, edge.metrics, keep=False)
        if not remembers_bd_seq:
            edge.bd_seq = None
            edge.watch = EdgeWatch()

    def publish(self, edge: Edge, device: str | None, changes: list[Change]) -> None:
        """The application has new values."""
        self._pass(self.step_ms)
        self._do_edge(edge, edge.session.publish(device, changes, self.now_ms))
        self.published.update((edge.node, device, c.name, repr(c.value), c.timestamp_ms) for c in changes)
        for change in sorted(changes, key=lambda c: c.timestamp_ms):
            if not change.is_historical:
                edge.truth[device][change.name] = Known(change.value, change.timestamp_ms, change.quality)

    def declare(self, edge: Edge, device: str, specs: tuple[MetricSpec, ...]) -> None:
        """The application declares a device, perhaps another time."""
        self._pass(self.step_ms)
        keep = device in edge.truth
        actions = edge.session.declare_device(device, specs, self.now_ms)
        self._declare_truth(edge, device, specs, keep=keep)
        self._do_edge(edge, actions)

    def remove(self, edge: Edge, device: str) -> None:
        """The device is gone."""
        self._pass(self.step_ms)
        del edge.truth[device], edge.specs[device]
        self._do_edge(edge, edge.session.remove_device(device, self.now_ms))

    def command(self, edge: Edge, topic: str, payload: bytes) -> None:
        """A host publishes a command."""
        if edge.connected and topic in edge.subscriptions:
            edge.inbox.append((topic, payload))

    def deliver_to_edge(self, edge: Edge) -> None:
        """The node reads the next message that waits for it; a STATE older than one it knows says nothing to it."""
        topic, payload = edge.inbox.pop(0)
        actions = edge.session.message(topic, payload, self.now_ms)
        if topic == STATE_TOPIC:
            stamp_ms = json.loads(payload)["timestamp"]
            assert stamp_ms >= edge.state_ms or not actions, f"{edge.node} believes a STATE that is out of date"
            edge.state_ms = max(stamp_ms, edge.state_ms)
        self._do_edge(edge, actions)

    # The host's side.

    def connect_host(self) -> None:
        """The host opens a connection and the broker accepts it."""
        self._pass(1)
        self.host_will = self.host.connecting(self.now_ms).will
        self._follow(self.host.connected(self.now_ms))

    def cut_host(self, *, will_is_late: bool) -> None:
        """The host's connection breaks; what was on its way is gone with it."""
        assert self.host_will is not None
        will, self.host_will = self.host_will, None
        self.flight.clear()
        self._follow(self.host.lost(self.now_ms))
        if will_is_late:
            self.late_host_wills.append(will)
        else:
            self._state(will)

    def close_host(self) -> None:
        """The host ends by its own will."""
        self._pass(1)
        actions = self.host.close(self.now_ms)
        self.flight.clear()
        self._follow(self.host.lost(self.now_ms))
        self._do_host(actions)
        self.host_will = None

    def deliver_host_will(self) -> None:
        """The broker sends the will of an earlier connection of the host."""
        self._state(self.late_host_wills.pop(0))

    def deliver(self, count: int) -> None:
        """The host reads the next messages that are on their way to it."""
        for flying in self.flight[:count]:
            self._hand_over(flying)
        del self.flight[:count]

    def deliver_will(self, index: int) -> None:
        """The broker sends the will of an edge's earlier connection."""
        flying = self.late_wills.pop(index)
        if self.host.online:
            self.flight.append(flying)

    def wait(self, milliseconds: int) -> None:
        """Time passes."""
        self._pass(milliseconds)
        for edge in self.edges:
            self._do_edge(edge, edge.session.tick(self.now_ms))
        self._follow(self.host.tick(self.now_ms))

    # What happens to messages on their way.

    def lose(self, index: int, count: int) -> int:
        """Messages are lost with all their copies, but never an NDEATH, which travels with QoS 1."""
        self.births_lost |= any(flying.verb == "NBIRTH" for flying in self.flight[index : index + count])
        lost = {id(flying.publish) for flying in self.flight[index : index + count] if flying.verb != "NDEATH"}
        self.flight = [flying for flying in self.flight if id(flying.publish) not in lost]
        return len(lost)

    def repeat(self, index: int, later_by: int) -> None:
        """A message comes a second time."""
        self.flight.insert(index + 1 + later_by, self.flight[index])

    def delay(self, index: int, later_by: int) -> None:
        """A message is overtaken by those behind it; only no NDEATH overtakes the NBIRTH of its own session.

        No host could tell the NBIRTH that comes after it from that of a node which was started again.
        """
        flying = self.flight.pop(index)
        place = min(index + later_by, len(self.flight))
        if flying.verb == "NBIRTH":
            deaths = (i for i in range(index, place) if self.flight[i][1:] == (flying.node, "NDEATH", flying.bd_seq))
            place = next(deaths, place)
        self.flight.insert(place, flying)

    # Quiet.

    def quiesce(self) -> None:
        """Everything arrives, each edge says something, and time passes until nobody asks for anything.

        A rebirth can be lost in such a way that the numbers after it happen to fit those before it; no host can see that until
        they fit no longer. So where an NBIRTH was lost, one more is lost before the second thing that an edge says.
        """
        if not self.host.online:
            self.connect_host()
        while self.late_host_wills:
            self.deliver_host_will()
        while self.late_wills:
            self.deliver_will(0)
        self._settle()
        for nudge in (False, self.births_lost):
            for edge in self.edges:
                if nudge:
                    self._beat(edge)
                    self.flight.clear()
                self._beat(edge)
                self._settle()
            for _ in range(QUIET_MS // 1500):
                self.wait(1500)
                self._settle()
        self.births_lost = False

    def _beat(self, edge: Edge) -> None:
        self.publish(edge, None, [Change("beat", edge.truth[None]["beat"].value + 1, self.now_ms)])

    def _settle(self) -> None:
        while self.flight or any(edge.inbox for edge in self.edges):
            self.deliver(len(self.flight))
            for edge in self.edges:
                while edge.inbox:
                    self.deliver_to_edge(edge)

    # How it is done.

    def _pass(self, milliseconds: int) -> None:
        self.now_ms += milliseconds

    def _declare_truth(self, edge: Edge, device: str | None, specs: tuple[MetricSpec, ...], *, keep: bool) -> None:
        past = edge.truth.get(device, {}) if keep else {}
        types = {spec.name: spec.datatype for spec in edge.specs.get(device, ())} if keep else {}
        edge.truth[device] = {
            spec.name: past[spec.name] if types.get(spec.name) is spec.datatype else self._first(spec) for spec in specs
        }
        edge.specs[device] = specs

    def _first(self, spec: MetricSpec) -> Known:
        """Return what is true of a metric that was only declared: without a value it is not good."""
        return Known(spec.value, self.now_ms, Quality.BAD if spec.value is None else Quality.GOOD)

    def _do_edge(self, edge: Edge, actions: list[Action]) -> None:
        declared = [device for device in edge.truth if device is not None]
        for action in actions:
            if isinstance(action, Publish):
                edge.watch.sent(action, declared)
                if self.host.online:
                    self.flight.append(flying_of(action, edge.node))
            elif isinstance(action, Subscribe):
                edge.subscriptions.add(action.topic_filter)
                if action.topic_filter == STATE_TOPIC and self.retained_state is not None:
                    edge.inbox.append((STATE_TOPIC, self.retained_state))
            elif isinstance(action, Disconnect | WalkToNextServer):
                self._end_edge(edge)

    @staticmethod
    def _end_edge(edge: Edge) -> None:
        edge.will = None
        edge.subscriptions.clear()
        edge.inbox.clear()
        edge.session.lost()

    def _hand_over(self, flying: Flying) -> None:
        before = self.host.picture(flying.node)
        was_online, bd_seq = (False, None) if before is None else (before.online, before.bd_seq)
        self._follow(self.host.message(flying.publish.topic, flying.publish.payload, self.now_ms))
        if flying.verb == "NDEATH" and was_online:
            assert before is not None
            assert before.online == (flying.bd_seq != bd_seq), "an NDEATH ends its own session and no other"

    def _follow(self, events: list[HostEvent]) -> None:
        for event in events:
            table = self.followed.setdefault((event.node, event.device), {})
            if event.kind is EventKind.DATA:
                for reading in event.readings:
                    what = (event.node, event.device, reading.name, repr(reading.value), reading.timestamp_ms)
                    self.taken[what] += 1
                    # After a lost birth the host follows numbers that began again, and an old message may fit them once more.
                    told_twice = self.taken[what] > self.published[what] and not self.births_lost
                    assert not told_twice, f"{what} is told twice in one life"
            if event.kind is EventKind.BIRTH:
                table.clear()
            if event.kind is EventKind.BIRTH and event.device is None:  # a copy of what came before its birth looks new after it
                self.taken = Counter({what: count for what, count in self.taken.items() if what[0] != event.node})
            table.update({r.name: r for r in event.readings if not r.is_historical})
        actions, self.host.actions = self.host.actions, []
        self._do_host(actions)

    def _do_host(self, actions: list[Action]) -> None:
        for action in actions:
            if isinstance(action, Publish) and action.topic == STATE_TOPIC:
                self._state(action)
            elif isinstance(action, Publish):
                (edge,) = (edge for edge in self.edges if edge.node.node == action.topic.split("/")[3])
                if REBIRTH_TOPIC_PART in action.topic:
                    last_ms = self.asked_ms.get(edge.node, 0)
                    assert self.now_ms - last_ms >= REBIRTH_INTERVAL_MS, "the host asks a node for a rebirth too often"
                    self.asked_ms[edge.node] = self.now_ms
                self.command(edge, action.topic, action.payload)

    def _state(self, publish: Publish) -> None:
        assert (publish.topic, publish.qos, publish.retain) == (STATE_TOPIC, 1, True)
        self.retained_state = publish.payload
        for edge in self.edges:
            if STATE_TOPIC in edge.subscriptions:
                edge.inbox.append((STATE_TOPIC, publish.payload))
        if self.host.online:
            self._follow(self.host.message(STATE_TOPIC, publish.payload, self.now_ms))

    # What must hold.

    def check_always(self) -> None:
        """Nothing is good while its owner is offline, and the events tell the same story as the picture."""
        for node in self.host.nodes():
            picture = self.host.picture(node)
            assert picture is not None
            for device, owner in picture.owners():
                offline = not (owner.online and picture.online and self.host.online)
                for reading in owner.readings.values():
                    assert not (offline and reading.quality is Quality.GOOD), f"{node} {device} {reading} is good and offline"
                assert self.followed.get((node, device), {}) == owner.readings, f"{node} {device}: events differ from the picture"

    def check_quiet(self) -> None:
        """The host's picture is the edges' truth."""
        for edge in self.edges:
            picture = self.host.picture(edge.node)
            born = edge.session.phase is Phase.BORN
            assert (picture is not None and picture.online) == born, f"{edge.node} is born: {born}"
            if picture is None or not born:
                continue
            online = {device for device, owner in picture.devices.items() if owner.online}
            assert online == edge.truth.keys() - {None}, f"{edge.node}: devices {online} are online"
            for device, table in edge.truth.items():
                owner = picture.owner(device)
                assert owner is not None
                seen = {name: Known(r.value, r.timestamp_ms, r.quality) for name, r in owner.readings.items()}
                assert seen == table, f"{edge.node} {device}"
