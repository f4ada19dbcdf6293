"""The session of a host application, without I/O (Sparkplug 3.0.0, 5.6 to 5.9).

The transport tells it what happened, with the time; it keeps a picture of every edge node and device, and hands back events
for the application and, in `actions`, what is to be sent. A value is good only while its node is online.
"""

from collections import Counter
from collections.abc import Callable, Iterable, Sequence
from random import Random
from typing import Any

from sparkplug.actions import Action, Connect, Disconnect, HostState, Publish, Subscribe
from sparkplug.admission.admission import Admission
from sparkplug.admission.gate import Gate
from sparkplug.admission.rates import Overrun
from sparkplug.admission.refusal import Refusal
from sparkplug.codec import parse
from sparkplug.errors import PayloadError, TopicError
from sparkplug.host_event import NODE_OFFLINE, EventKind, HostEvent
from sparkplug.layouts.memory import Memory, Room
from sparkplug.layouts.route import Route
from sparkplug.metric import Change, NodeId
from sparkplug.node_picture import NodePicture, Owner, tells_quality
from sparkplug.rebirth import RebirthRequests
from sparkplug.sequence import Delivery, Numbered, SequenceWindow, Verdict
from sparkplug.topics import STATE_PREFIX, Topic, Verb, state_topic
from sparkplug.watched import Received, Watched, bd_seq_of, command, is_sloppy, rebirth_request

__all__ = ["EventKind", "HostEvent", "HostSession"]

NODES_MAX = 10_000
LATE_MS_MAX = 10_000
DEVICE_BIRTH_MS_MAX = 2000
_DATA = EventKind.DATA


def _anyone(_: NodeId) -> bool:
    return True


class HostSession:
    """One host application on one broker. `wanted` tells which nodes are listened to, always the same ones."""

    def __init__(
        self,
        host_id: str,
        topic_filters: Sequence[str] = ("spBv1.0/#",),
        *,
        chance: Random,
        reorder_timeout_ms: int = 2000,
        rebirth_interval_ms_min: int = 5000,
        publish_state: bool = True,
        wanted: Callable[[NodeId], bool] = _anyone,
        gate: Gate | None = None,
        packs: bool = False,
    ) -> None:
        self.state_topic = state_topic(host_id)
        self.actions: list[Action] = []
        self.counts: Counter[str] = Counter()
        self.online = False
        self._gate = gate or Gate()
        self.admission = Admission(self._gate, self.counts)
        self._topic_filters, self._reorder_timeout_ms = tuple(topic_filters), reorder_timeout_ms
        self._publish_state, self._wanted, self._packs = publish_state, wanted, packs
        self._nodes: dict[NodeId, Watched] = {}
        self._routes: dict[str, Route] = {}
        self._room = Room()
        self._requests = RebirthRequests(chance, interval_ms_min=rebirth_interval_ms_min)
        self._connect_ms = 0

    # What the transport tells.

    def connecting(self, now_ms: int, keep_s: int = 0) -> Connect:
        """A connection is about to be opened; its will says when this host was last seen."""
        self._connect_ms = now_ms
        return Connect(self._state(online=False, timestamp_ms=now_ms) if self._publish_state else None, keep_s)

    def restore(self, births: Iterable[tuple[str, bytes]], now_ms: int) -> None:
        """Take births that an earlier run has heard, NBIRTHs first: what comes in a kept session is read by them."""
        for topic, payload in births:
            self.message(topic, payload, now_ms)
        for watched in self._nodes.values():
            watched.window.skip()
            watched.awaiting = None

    def connected(self, now_ms: int, *, is_kept: bool = False) -> list[HostEvent]:
        """The broker has accepted the connection: subscribe, say so, and ask who is there unless the session was kept."""
        self.online = True
        if self._publish_state:
            self.actions.append(Subscribe(self.state_topic))
        self.actions += [Subscribe(topic_filter) for topic_filter in self._topic_filters]
        if self._publish_state:
            self.actions.append(self._state(online=True, timestamp_ms=self._connect_ms))
        for node in self._nodes if not is_kept else ():
            self._requests.want(node, now_ms)
        return []

    def lost(self, now_ms: int) -> list[HostEvent]:
        """The connection is gone: nothing that is known is good any more, and nothing of it is sent on the next one."""
        self.online = False
        self.actions.clear()
        events: list[HostEvent] = []
        for watched in self._nodes.values():
            watched.window.flush()
            if watched.picture.online:
                events += self._wither(watched, now_ms, "this host lost its connection to the broker")
        return events

    def close(self, now_ms: int) -> list[Action]:
        """The host ends by its own will: its death with the present time, then the DISCONNECT."""
        self.online = False
        death = [self._state(online=False, timestamp_ms=now_ms)] if self._publish_state else []
        return [*death, Disconnect()]

    def message(self, topic: str, payload: bytes, now_ms: int) -> list[HostEvent]:
        """A message of the Sparkplug namespace has come; a malformed one is counted and changes nothing."""
        route = self._routes.get(topic)
        if route is not None and (event := route.take(payload)) is not None:
            self.counts["data"] += 1
            return [event]
        self._gate.at(now_ms)
        try:
            if topic == self.state_topic:
                return self._own_state(payload)
            if topic.startswith(STATE_PREFIX):
                return []
            return self._node_message(Topic.parse(topic), payload, now_ms)
        except (PayloadError, TopicError):
            self.counts["malformed"] += 1
            return []

    def overrun(self, overrun: Overrun, now_ms: int) -> list[HostEvent]:
        """From here on messages of a node were dropped at the door. Its next one begins a new count; where births or deaths are
        among them, nothing that is known of it holds until it is born again."""
        watched = self._nodes.get(overrun.node)
        if watched is None or not watched.picture.online:
            return []
        events = self._deliver(watched, watched.window.flush(), now_ms)
        if overrun.is_life:
            self._requests.want(overrun.node, now_ms)
            return events + self._wither(watched, now_ms, "more births than are let in")
        watched.window.skip()
        self.counts["holes"] += 1
        return [
            *events,
            HostEvent(EventKind.HOLE, overrun.node, None, now_ms, detail=f"{overrun.node} sends more than is let in"),
        ]

    def tick(self, now_ms: int) -> list[HostEvent]:
        """Time has passed: reorder windows end, devices that were not born again go offline, rebirths are asked for."""
        events: list[HostEvent] = []
        self._gate.at(now_ms)
        self.admission.quarantine.sweep(now_ms)
        for watched in self._nodes.values():
            if (delivery := watched.window.expire(now_ms)) is not None:
                events += self._deliver(watched, delivery, now_ms)
            if watched.awaiting and now_ms - watched.received_ms >= DEVICE_BIRTH_MS_MAX:
                for device in sorted(watched.awaiting):
                    readings = watched.picture.devices[device].wither(now_ms, "not born again with its edge node")
                    events.append(HostEvent(EventKind.DEATH, watched.picture.node, device, now_ms, readings))
                watched.awaiting = None
        if self.online:
            self.actions += [self.rebirth_request(node, now_ms) for node in self._requests.due(now_ms)]
        return events

    # What the application asks.

    def picture(self, node: NodeId) -> NodePicture | None:
        """Return what is known of a node; None where nothing was heard of it."""
        watched = self._nodes.get(node)
        return None if watched is None else watched.picture

    def nodes(self) -> tuple[NodeId, ...]:
        """All nodes that were heard of."""
        return tuple(self._nodes)

    def command(self, node: NodeId, device: str | None, changes: Iterable[Change], now_ms: int) -> Publish:
        """The message that writes values to a node or device; raises UnknownMetricError where its birth does not declare one."""
        return command(node, self.picture(node), device, changes, now_ms)

    def rebirth_request(self, node: NodeId, now_ms: int) -> Publish:
        """The message that asks a node for its births, whether anything was heard of it or not."""
        self.counts["rebirths_requested"] += 1
        return rebirth_request(node, now_ms)

    def want_birth(self, node: NodeId, now_ms: int) -> None:
        """Have a node asked for its births unless it is online, or is born by itself in a moment."""
        known = self._nodes.get(node)
        if known is None or not known.picture.online:
            self._requests.want(node, now_ms)

    # How it is done.

    def _state(self, *, online: bool, timestamp_ms: int) -> Publish:
        return Publish(self.state_topic, HostState(online, timestamp_ms).encode(), qos=1, retain=True)

    def _own_state(self, payload: bytes) -> list[HostEvent]:
        if not HostState.decode(payload).online and self._publish_state and self.online:
            # The late will of an earlier connection: say at once that this host lives.
            self.actions.append(self._state(online=True, timestamp_ms=self._connect_ms))
        return []

    def _node_message(self, topic: Topic, payload: bytes, now_ms: int) -> list[HostEvent]:
        verb, node, _ = topic
        if verb is Verb.NCMD or verb is Verb.DCMD or not self._wanted(node):
            return []
        watched = self._nodes.get(node)
        if watched is None:
            if len(self._nodes) >= NODES_MAX:
                self.counts["nodes_over_limit"] += 1
                return []
            if (refused := self.admission.stranger(topic, now_ms)) is not None:
                return [refused]
            watched = Watched(NodePicture(node), SequenceWindow(self._reorder_timeout_ms))
            self._nodes[node] = watched
        if verb not in (Verb.NBIRTH, Verb.NDEATH) and self.admission.quarantine.of(node, None) is not None:
            return [held] if (held := self.admission.held(topic, now_ms)) is not None else []
        message = parse(payload)
        if verb is Verb.NBIRTH:
            return self._node_birth(watched, message, len(payload), now_ms)
        if verb is Verb.NDEATH:
            return self._node_death(watched, message, now_ms)
        if not watched.picture.online:
            self.counts["before_birth"] += 1
            self._requests.want(node, now_ms)
            return []
        stamp = self._gate.stamp(message)
        if stamp and stamp < watched.picture.own.birth_ms and now_ms - watched.received_ms < LATE_MS_MAX:
            self.counts["late"] += 1  # left over from before the birth; its number may look right all the same
            return []
        received = Received(topic, message, payload)
        if watched.window.is_next(message.seq, stamp):
            return self._in_order(watched, received, now_ms)
        delivery = watched.window.take(Numbered(message.seq, stamp, received), now_ms)
        return self._deliver(watched, delivery, now_ms)

    def _node_birth(self, watched: Watched, message: Any, size: int, now_ms: int) -> list[HostEvent]:
        picture, stamp = watched.picture, self._gate.stamp(message)
        bd_seq = bd_seq_of(message)
        recent = now_ms - watched.received_ms < LATE_MS_MAX
        repeated = bd_seq == picture.bd_seq and stamp == picture.own.birth_ms
        if recent and stamp and (repeated or stamp < picture.own.birth_ms):
            # Also while the node is offline: the copy of an older birth would bring a dead node back for good.
            self.counts["late"] += 1
            return []
        node = picture.node
        if (fault := self.admission.birth_fault(node, None, message, size, 0)) is not None:
            dead = self._wither(watched, now_ms, f"birth certificate refused: {fault.text}") if picture.online else []
            self._requests.born(node)
            return [*dead, self.admission.refuse(node, None, fault, now_ms, is_whole=True)]
        try:
            readings = picture.own.bear(message, stamp or now_ms, picture.holders)
        except PayloadError as error:
            # What follows it would be read by the birth before it: better to know nothing until there is one that can be read.
            self.counts["malformed"] += 1
            return self._wither(watched, now_ms, f"birth certificate unreadable: {error}") if picture.online else []
        self.admission.born(node, None, message, size)
        readings, refused = self.admission.believed(node, None, readings, stamp or now_ms, now_ms)
        picture.own.replace(readings if refused else ())
        lost = watched.window.begin(message.seq, stamp)
        picture.bd_seq, watched.received_ms = bd_seq, now_ms
        self.counts["sloppy_births"] += is_sloppy(message)
        picture.holders = dict.fromkeys(picture.own.aliases, picture.own)
        for owner in picture.devices.values():
            owner.forget_birth()  # DBIRTHs follow
        watched.awaiting = {device for device, owner in picture.devices.items() if owner.online}
        self._requests.born(picture.node)
        self.counts["births"] += 1
        born = HostEvent(EventKind.BIRTH, picture.node, None, stamp or now_ms, readings, seq=message.seq)
        return [*self._hole(watched, lost, now_ms, ask=False), born, *refused]

    def _node_death(self, watched: Watched, message: Any, now_ms: int) -> list[HostEvent]:
        bd_seq, picture = bd_seq_of(message), watched.picture
        if not picture.online:
            return []
        if bd_seq is not None and picture.bd_seq is not None and bd_seq != picture.bd_seq:
            self.counts["stale_deaths"] += 1  # the will of an earlier session, delivered late
            return []
        events = self._deliver(watched, watched.window.flush(), now_ms)
        self._requests.born(picture.node)  # a dead node has no birth to give
        return events + self._wither(watched, now_ms, NODE_OFFLINE)

    def _wither(self, watched: Watched, now_ms: int, reason: str) -> list[HostEvent]:
        """The node and all its devices go offline by the host's clock."""
        watched.received_ms, watched.awaiting = now_ms, None
        picture = watched.picture
        self.counts["deaths"] += 1
        return [
            HostEvent(EventKind.DEATH, picture.node, device, now_ms, owner.wither(now_ms, reason), reason)
            for device, owner in picture.owners()
            if owner.online
        ]

    def _deliver(self, watched: Watched, delivery: Delivery, now_ms: int) -> list[HostEvent]:
        if delivery.verdict is Verdict.LATE:
            self.counts["late"] += 1
        elif delivery.verdict is Verdict.SLOPPY:
            self.counts["sloppy_sequence"] += 1
            if watched.is_doubted(now_ms):
                self._requests.want(watched.picture.node, now_ms)
        events = self._hole(watched, delivery.lost, now_ms, ask=True)
        for numbered in delivery.messages:
            try:
                events += self._in_order(watched, numbered.message, now_ms)
            except PayloadError:
                self.counts["malformed"] += 1
        return events

    def _in_order(self, watched: Watched, received: Received, now_ms: int) -> list[HostEvent]:
        topic, message, payload = received
        picture, device = watched.picture, topic.device
        stamp = self._gate.stamp(message) or now_ms
        if topic.verb is Verb.DBIRTH and device is not None:
            return self._device_birth(watched, received, device, stamp, now_ms)
        known = picture.owner(device)
        if known is None or not known.online:
            if (refused := self.admission.held(topic, now_ms)) is not None:
                if topic.verb is Verb.DDEATH:
                    self.admission.quarantine.release(picture.node, device)
                return [refused]
            self.counts["before_birth"] += 1
            self._requests.want(picture.node, now_ms)
            return []
        if topic.verb is Verb.DDEATH:
            self.counts["deaths"] += 1
            if watched.awaiting and device is not None:
                watched.awaiting.discard(device)
            return _death(picture.node, device, known, stamp, "device offline", seq=message.seq)
        trimmed = self._gate.trim(message, len(payload))
        data, complete = picture.read_data(known, message, message.timestamp or now_ms, may_tell_quality=tells_quality(payload))
        readings, refused_part = self.admission.kept(picture.node, device, data, trimmed, now_ms)
        if refused_part and not readings:
            return refused_part
        names = known.take(readings)
        if not complete:
            self.counts["unknown_metrics"] += 1
            self._requests.want(picture.node, now_ms)
        elif readings and not refused_part:
            self._route(watched, topic, known).learn(payload, message, readings, names)
        self.counts["data"] += 1
        stamps_ms = [reading.timestamp_ms for reading in readings] if names else [0]
        span_ms = min(stamps_ms), max(stamps_ms)
        event = HostEvent(_DATA, picture.node, device, stamp, readings, "", "", b"", names, *span_ms, seq=message.seq)
        return [event, *refused_part]

    def _device_birth(self, watched: Watched, received: Received, device: str, stamp: int, now_ms: int) -> list[HostEvent]:
        _, message, payload = received
        picture, node = watched.picture, watched.picture.node
        owner, size = picture.devices.get(device), len(payload)
        if watched.awaiting:
            watched.awaiting.discard(device)
        devices = len(picture.devices) if owner is None else 0
        fault = self.admission.birth_fault(node, device, message, size, devices)
        if fault is not None and fault.refusal is Refusal.QUOTA and owner is None and (gone := picture.forget_one()) is not None:
            self._routes.pop(str(Topic(Verb.DDATA, node, gone)), None)
            self.admission.forget(node, gone)
            fault = self.admission.birth_fault(node, device, message, size, devices - 1)
        if fault is not None:
            reason = f"birth certificate refused: {fault.text}"
            dead = [] if owner is None else _death(node, device, owner, now_ms, reason)
            return [*dead, self.admission.refuse(node, device, fault, now_ms, is_whole=True)]
        owner = owner or Owner()
        try:
            readings = owner.bear(message, stamp, picture.holders)
        except PayloadError as error:
            self.counts["malformed"] += 1
            return _death(node, device, owner, stamp, f"birth certificate unreadable: {error}")
        picture.devices[device] = owner
        self.admission.born(node, device, message, size)
        readings, refused = self.admission.believed(node, device, readings, stamp, now_ms)
        owner.replace(readings if refused else ())
        self.counts["births"] += 1
        self.counts["sloppy_aliases"] += owner.aliases_shared
        return [HostEvent(EventKind.BIRTH, node, device, stamp, readings, seq=message.seq), *refused]

    def _route(self, watched: Watched, topic: Topic, owner: Owner) -> Route:
        """Return the route of a data topic whose owner was born."""
        name = str(topic)
        route = self._routes.get(name)
        if route is None:
            owner.layouts = Memory(self._room)
            of_node = watched.picture, watched.window, owner
            route = self._routes[name] = Route(*of_node, topic.device, owner.layouts, self._gate, self._packs)
        return route

    def _hole(self, watched: Watched, lost: int, now_ms: int, *, ask: bool) -> list[HostEvent]:
        if not lost:
            return []
        self.counts["holes"] += 1
        self.counts["lost"] += lost
        node = watched.picture.node
        if ask:
            self._requests.want(node, now_ms)
        return [HostEvent(EventKind.HOLE, node, None, now_ms, detail=f"{lost} messages of {node} are lost")]


def _death(node: NodeId, device: str | None, owner: Owner, stamp: int, reason: str, *, seq: int = -1) -> list[HostEvent]:
    if not owner.online:
        return []
    return [HostEvent(EventKind.DEATH, node, device, stamp, owner.wither(stamp, reason), reason, seq=seq)]
