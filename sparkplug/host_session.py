"""The session of a host application, without I/O (Sparkplug 3.0.0, 5.6 to 5.9).

The transport tells it what happened, with the time; it keeps a picture of every edge node and device, and hands back events
for the application and, in `actions`, what is to be sent. A value is good only while its node is online.
"""

from collections import Counter, deque
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, field
from random import Random
from typing import Any, NamedTuple

from sparkplug.actions import Action, Connect, Disconnect, HostState, Publish, Subscribe
from sparkplug.admission.gate import Gate
from sparkplug.admission.refusal import Quarantine
from sparkplug.codec import encode, parse
from sparkplug.datatype import DataType
from sparkplug.edge_session import BD_SEQ, REBIRTH
from sparkplug.errors import PayloadError, TopicError, UnknownMetricError
from sparkplug.host_event import EventKind, HostEvent
from sparkplug.layouts.memory import Memory, Room
from sparkplug.layouts.route import Route
from sparkplug.metric import Change, NodeId, Reading
from sparkplug.node_picture import NodePicture, Owner, tells_quality
from sparkplug.rebirth import RebirthRequests
from sparkplug.sequence import Delivery, Numbered, SequenceWindow, Verdict
from sparkplug.topics import STATE_PREFIX, Topic, Verb, state_topic
from sparkplug.values import Metric, Payload

__all__ = ["EventKind", "HostEvent", "HostSession"]

NODES_MAX = 10_000
LATE_MS_MAX = 10_000
DEVICE_BIRTH_MS_MAX = 2000
DOUBTS_MAX = 3
DOUBT_MS = 600_000
_DATA = EventKind.DATA


@dataclass(slots=True)
class _Watched:
    """A node's picture with what is needed to keep it in order."""

    picture: NodePicture
    window: SequenceWindow
    received_ms: int = 0  # when its last birth or death came, by the host's clock
    awaiting: set[str] | None = None  # devices that were known before the last NBIRTH and have not been born since
    doubts_ms: deque[int] = field(default_factory=lambda: deque(maxlen=DOUBTS_MAX))  # when its numbers were last doubted


class _Received(NamedTuple):
    """A message and the bytes from which it was parsed."""

    topic: Topic
    message: Any
    payload: bytes


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
    ) -> None:
        self.state_topic = state_topic(host_id)
        self.actions: list[Action] = []
        self.counts: Counter[str] = Counter()
        self.online = False
        self.quarantine = Quarantine()
        self._gate = gate or Gate()
        self._topic_filters = tuple(topic_filters)
        self._reorder_timeout_ms = reorder_timeout_ms
        self._publish_state = publish_state
        self._wanted = wanted
        self._nodes: dict[NodeId, _Watched] = {}
        self._routes: dict[str, Route] = {}
        self._room = Room()
        self._requests = RebirthRequests(chance, interval_ms_min=rebirth_interval_ms_min)
        self._connect_ms = 0

    # What the transport tells.

    def connecting(self, now_ms: int) -> Connect:
        """A connection is about to be opened; its will says when this host was last seen."""
        self._connect_ms = now_ms
        return Connect(will=self._state(online=False, timestamp_ms=now_ms) if self._publish_state else None)

    def connected(self, now_ms: int) -> list[HostEvent]:
        """The broker has accepted the connection: subscribe, then say that this host is online, then ask who is there."""
        self.online = True
        if self._publish_state:
            self.actions.append(Subscribe(self.state_topic))
        self.actions += [Subscribe(topic_filter) for topic_filter in self._topic_filters]
        if self._publish_state:
            self.actions.append(self._state(online=True, timestamp_ms=self._connect_ms))
        for node in self._nodes:
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
        try:
            if topic == self.state_topic:
                return self._own_state(payload)
            if topic.startswith(STATE_PREFIX):
                return []
            return self._node_message(Topic.parse(topic), payload, now_ms)
        except (PayloadError, TopicError):
            self.counts["malformed"] += 1
            return []

    def tick(self, now_ms: int) -> list[HostEvent]:
        """Time has passed: reorder windows end, devices that were not born again go offline, rebirths are asked for."""
        events: list[HostEvent] = []
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
        """What is known of a node; None where nothing was heard of it."""
        watched = self._nodes.get(node)
        return None if watched is None else watched.picture

    def nodes(self) -> tuple[NodeId, ...]:
        """All nodes that were heard of."""
        return tuple(self._nodes)

    def command(self, node: NodeId, device: str | None, changes: Iterable[Change], now_ms: int) -> Publish:
        """The message that writes values to a node or device; raises UnknownMetricError where its birth does not declare one."""
        picture = self.picture(node)
        owner = None if picture is None else picture.owner(device)
        if picture is None or owner is None:
            raise UnknownMetricError(f"{_name(node, device)} was never born; nothing to command")
        alias_of = {binding.name: alias for alias, binding in owner.aliases.items()}
        metrics = []
        for change in changes:
            if change.name == REBIRTH and owner.offers_rebirth:
                metrics.append(Metric(REBIRTH, change.value, DataType.BOOLEAN, change.timestamp_ms))
                continue
            binding = owner.bindings.get(change.name)
            if binding is None:
                raise UnknownMetricError(f"{_name(node, device)} has not declared {change.name!r}; nothing to command")
            alias = alias_of.get(change.name)
            name = change.name if alias is None else None
            metrics.append(Metric(name, change.value, binding.datatype, change.timestamp_ms, alias))
        verb = Verb.NCMD if device is None else Verb.DCMD
        return Publish(str(Topic(verb, node, device)), encode(Payload(now_ms, tuple(metrics))))

    def rebirth_request(self, node: NodeId, now_ms: int) -> Publish:
        """The message that asks a node for its births, whether anything was heard of it or not."""
        self.counts["rebirths_requested"] += 1
        metric = Metric(REBIRTH, True, DataType.BOOLEAN, now_ms)
        return Publish(str(Topic(Verb.NCMD, node)), encode(Payload(now_ms, (metric,))))

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
            watched = _Watched(NodePicture(node), SequenceWindow(self._reorder_timeout_ms))
            self._nodes[node] = watched
        message = parse(payload)
        if verb is Verb.NBIRTH:
            return self._node_birth(watched, message, now_ms)
        if verb is Verb.NDEATH:
            return self._node_death(watched, message, now_ms)
        if not watched.picture.online:
            self.counts["before_birth"] += 1
            self._requests.want(node, now_ms)
            return []
        stamp = message.timestamp
        if stamp and stamp < watched.picture.own.birth_ms and now_ms - watched.received_ms < LATE_MS_MAX:
            self.counts["late"] += 1  # left over from before the birth; its number may look right all the same
            return []
        received = _Received(topic, message, payload)
        if watched.window.is_next(message.seq, stamp):
            return self._in_order(watched, received, now_ms)
        delivery = watched.window.take(Numbered(message.seq, stamp, received), now_ms)
        return self._deliver(watched, delivery, now_ms)

    def _node_birth(self, watched: _Watched, message: Any, now_ms: int) -> list[HostEvent]:
        picture, stamp = watched.picture, message.timestamp
        bd_seq = _bd_seq(message)
        recent = now_ms - watched.received_ms < LATE_MS_MAX
        repeated = bd_seq == picture.bd_seq and stamp == picture.own.birth_ms
        if recent and stamp and (repeated or stamp < picture.own.birth_ms):
            # Also while the node is offline: the copy of an older birth would bring a dead node back for good.
            self.counts["late"] += 1
            return []
        try:
            readings = picture.own.bear(message, stamp or now_ms, picture.holders)
        except PayloadError as error:
            # What follows it would be read by the birth before it: better to know nothing until there is one that can be read.
            self.counts["malformed"] += 1
            return self._wither(watched, now_ms, f"birth certificate unreadable: {error}") if picture.online else []
        lost = watched.window.begin(message.seq, stamp)
        picture.bd_seq, watched.received_ms = bd_seq, now_ms
        self.counts["sloppy_births"] += _is_sloppy(message)
        picture.holders = dict.fromkeys(picture.own.aliases, picture.own)
        for owner in picture.devices.values():
            owner.forget_birth()  # DBIRTHs follow
        watched.awaiting = {device for device, owner in picture.devices.items() if owner.online}
        self._requests.born(picture.node)
        self.counts["births"] += 1
        born = HostEvent(EventKind.BIRTH, picture.node, None, stamp or now_ms, readings)
        return [*self._hole(watched, lost, now_ms, ask=False), born]

    def _node_death(self, watched: _Watched, message: Any, now_ms: int) -> list[HostEvent]:
        bd_seq, picture = _bd_seq(message), watched.picture
        if not picture.online:
            return []
        if bd_seq is not None and picture.bd_seq is not None and bd_seq != picture.bd_seq:
            self.counts["stale_deaths"] += 1  # the will of an earlier session, delivered late
            return []
        events = self._deliver(watched, watched.window.flush(), now_ms)
        self._requests.born(picture.node)  # a dead node has no birth to give
        return events + self._wither(watched, now_ms, "edge node offline")

    def _wither(self, watched: _Watched, now_ms: int, reason: str) -> list[HostEvent]:
        """The node and all its devices go offline by the host's clock."""
        watched.received_ms, watched.awaiting = now_ms, None
        picture = watched.picture
        self.counts["deaths"] += 1
        return [
            HostEvent(EventKind.DEATH, picture.node, device, now_ms, owner.wither(now_ms, reason), reason)
            for device, owner in picture.owners()
            if owner.online
        ]

    def _deliver(self, watched: _Watched, delivery: Delivery, now_ms: int) -> list[HostEvent]:
        if delivery.verdict is Verdict.LATE:
            self.counts["late"] += 1
        elif delivery.verdict is Verdict.SLOPPY:
            self.counts["sloppy_sequence"] += 1
            self._doubt(watched, now_ms)
        events = self._hole(watched, delivery.lost, now_ms, ask=True)
        for numbered in delivery.messages:
            try:
                events += self._in_order(watched, numbered.message, now_ms)
            except PayloadError:
                self.counts["malformed"] += 1
        return events

    def _in_order(self, watched: _Watched, received: _Received, now_ms: int) -> list[HostEvent]:
        topic, message, payload = received
        picture, device = watched.picture, topic.device
        stamp = message.timestamp or now_ms
        if topic.verb is Verb.DBIRTH and device is not None:
            owner = picture.devices.setdefault(device, Owner())
            try:
                readings = owner.bear(message, stamp, picture.holders)
            except PayloadError as error:
                self.counts["malformed"] += 1
                return _death(picture.node, device, owner, stamp, f"birth certificate unreadable: {error}")
            if watched.awaiting:
                watched.awaiting.discard(device)
            self.counts["births"] += 1
            self.counts["sloppy_aliases"] += owner.aliases_shared
            return [HostEvent(EventKind.BIRTH, picture.node, device, stamp, readings)]
        known = picture.owner(device)
        if known is None or not known.online:
            self.counts["before_birth"] += 1
            self._requests.want(picture.node, now_ms)
            return []
        if topic.verb is Verb.DDEATH:
            self.counts["deaths"] += 1
            if watched.awaiting and device is not None:
                watched.awaiting.discard(device)
            return _death(picture.node, device, known, stamp, "device offline")
        data, complete = picture.read_data(known, message, stamp, may_tell_quality=tells_quality(payload))
        readings = tuple(data)
        names = known.take(readings)
        if not complete:
            self.counts["unknown_metrics"] += 1
            self._requests.want(picture.node, now_ms)
        elif readings:
            self._route(watched, topic, known).learn(payload, message, readings, names)
        self.counts["data"] += 1
        oldest_ms, newest_ms = _span_ms(readings) if names else (0, 0)
        return [HostEvent(_DATA, picture.node, device, stamp, readings, "", "", b"", names, oldest_ms, newest_ms)]

    def _route(self, watched: _Watched, topic: Topic, owner: Owner) -> Route:
        """Return the route of a data topic whose owner was born."""
        name = str(topic)
        route = self._routes.get(name)
        if route is None:
            owner.layouts = Memory(self._room)
            route = self._routes[name] = Route(watched.picture, watched.window, owner, topic.device, owner.layouts, self._gate)
        return route

    def _doubt(self, watched: _Watched, now_ms: int) -> None:
        """A peer that counts sloppily is let be; but its numbers may also have begun again with a birth that was lost.

        The birth is asked for, at most `DOUBTS_MAX` times in `DOUBT_MS`, so that a sloppy peer is not made to repeat it for ever.
        """
        doubts_ms = watched.doubts_ms
        if len(doubts_ms) < DOUBTS_MAX or now_ms - doubts_ms[0] >= DOUBT_MS:
            doubts_ms.append(now_ms)
            self._requests.want(watched.picture.node, now_ms)

    def _hole(self, watched: _Watched, lost: int, now_ms: int, *, ask: bool) -> list[HostEvent]:
        if not lost:
            return []
        self.counts["holes"] += 1
        self.counts["lost"] += lost
        node = watched.picture.node
        if ask:
            self._requests.want(node, now_ms)
        return [HostEvent(EventKind.HOLE, node, None, now_ms, detail=f"{lost} messages of {node} are lost")]


def _death(node: NodeId, device: str | None, owner: Owner, stamp: int, reason: str) -> list[HostEvent]:
    return [HostEvent(EventKind.DEATH, node, device, stamp, owner.wither(stamp, reason), reason)] if owner.online else []


def _span_ms(readings: Sequence[Reading]) -> tuple[int, int]:
    """The oldest and the newest time stamp."""
    stamps_ms = [reading.timestamp_ms for reading in readings]
    return min(stamps_ms), max(stamps_ms)


def _is_sloppy(message: Any) -> bool:
    """Whether an NBIRTH leaves out what the specification demands and we can do without: said, and accepted."""
    types = {metric.name: metric.datatype for metric in message.metrics}
    well_formed = types.get(BD_SEQ) == DataType.INT64 and types.get(REBIRTH) == DataType.BOOLEAN
    return not well_formed or not all(metric.timestamp for metric in message.metrics)


def _name(node: NodeId, device: str | None) -> str:
    return str(node) if device is None else f"{node}/{device}"


def _bd_seq(message: Any) -> int | None:
    for metric in message.metrics:
        if metric.name == BD_SEQ:
            return int(metric.long_value or metric.int_value) % 256
    return None
