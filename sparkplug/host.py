"""A host application on a real broker: the session and the connection put together.

Whoever reads the socket only fills a bounded inbox; decoding, ordering and everything after that happen in the thread that
calls `poll`. While that thread waits it drives the loop, and so reads the sockets itself; while it computes for long, the loop's
own thread does. What does not fit, or has waited too long, is dropped and counted, data first: a birth or a death is worth more
than a value.
"""

import logging
import math
import threading
import time
from collections import Counter, deque
from collections.abc import Callable, Collection, Iterable, Sequence
from enum import Enum
from random import Random
from typing import NamedTuple

from sparkplug.actions import Acknowledge, Connect, Publish, Subscribe
from sparkplug.admission.gate import Gate
from sparkplug.admission.limits import DEFAULTS, Limits
from sparkplug.admission.rates import Overrun, Rates
from sparkplug.admission.refusal import Quarantined
from sparkplug.admission.thinning import Lateness, of_devices, thinned
from sparkplug.broker import BrokerAddress
from sparkplug.clock import now_ms
from sparkplug.errors import TopicError
from sparkplug.host_session import EventKind, HostEvent, HostSession
from sparkplug.metric import Change, NodeId
from sparkplug.node_picture import NodePicture
from sparkplug.plain_topics import PlainTopics
from sparkplug.topics import NAMESPACE, STATE_PREFIX, Topic, Verb, check_id, group_filter
from sparkplug.transport.connection import MqttConnection
from sparkplug.transport.listener import Listener
from sparkplug.transport.loop import Loop
from sparkplug.transport.sendable import shortened

__all__ = ["EventKind", "HostApplication", "HostEvent"]

EVENTS_A_POLL = 1000
TICK_S = 0.1
EXCESS_S = 1.0
STALE_S_MAX = 60.0
FAILURE_TOLD_S = 10.0
_NOWHERE = NodeId("", "")
_log = logging.getLogger(__name__)


class _Mark(Enum):
    """A mark in the inbox between messages."""

    CONNECTED = "connected"
    LOST = "lost"


class Held(NamedTuple):
    """A message of QoS 1 that the broker keeps until it is acknowledged, on the connection of this number."""

    packet_id: int
    connection: int


class HostApplication:
    """Listens to edge nodes; `wanted` picks them, `topic_filters` tells the broker what to send.

    `loop` serves the connection, which has a loop of its own otherwise. Data that have waited for longer than `stale_s_max` are
    dropped. What is beyond `limits` is refused: so are devices with a `reserved` name. `trusted` nodes are free of the limits on
    numbers and rates.

    With `keep_s` the broker keeps the session for so long, and what it delivers at QoS 1 until the application acknowledges it:
    `take_held` returns what `poll` has dealt with since it was last called, and `acknowledge` takes it. Nothing is dropped for
    its age then, and a connection that ends makes nothing stale. `on_life` hears each birth and death, `on_state` each STATE of
    a host application that is subscribed to, with the id of that one. With `packs` data may come packed (`HostEvent`).
    """

    def __init__(
        self,
        broker: BrokerAddress,
        host_id: str,
        topic_filters: Sequence[str] = (group_filter("cnc"),),
        *,
        reorder_timeout_ms: int = 2000,
        rebirth_interval_ms_min: int = 5000,
        queue_max: int = 100_000,
        mqtt_version: int | None = None,
        publish_state: bool = True,
        wanted: Callable[[NodeId], bool] = lambda _: True,
        loop: Loop | None = None,
        stale_s_max: float = STALE_S_MAX,
        limits: Limits = DEFAULTS,
        reserved: Collection[str] = (),
        trusted: Callable[[NodeId], bool] = lambda _: False,
        keep_s: int = 0,
        packs: bool = False,
    ) -> None:
        self.dropped = self.faults = 0  # faults: messages that a bug of ours has lost
        self._queue_max = queue_max
        self._stale_s_max = math.inf if keep_s else stale_s_max
        self._keep_s = keep_s
        self.on_life: Callable[[Topic, bytes], None] | None = None
        self.on_state: Callable[[str, bytes], None] | None = None
        self._held: list[Held] = []
        self._wanted = wanted
        self._session = HostSession(
            host_id,
            topic_filters,
            chance=Random(),  # noqa: S311 — spreads requests, keeps no secret
            reorder_timeout_ms=reorder_timeout_ms,
            rebirth_interval_ms_min=rebirth_interval_ms_min,
            publish_state=publish_state,
            wanted=wanted,
            gate=Gate(limits, reserved, trusted),
            packs=packs,
        )
        self._plain_filters: list[str] = []
        self._inbox: deque[tuple[str | _Mark | Overrun | Held, bytes, float]] = deque()  # with the time of time.monotonic
        self._is_lost = self._waits = False  # is_lost: the connection of a kept session
        self._filled = threading.Event()
        self._ticked_s = self._told_s = 0.0
        self._rates = Rates(limits, trusted)
        self._trusted = trusted
        self._lateness = Lateness()
        self._thinned: Counter[tuple[NodeId, bool]] = Counter()
        self._plain_bytes_max = limits.plain_bytes_max
        self._failure_told_s = -FAILURE_TOLD_S
        called = self._connecting, lambda: None, self._connected, self._message, self._lost, lambda: None
        listener = Listener(*called, wanted=self._is_read, holds=self._hold)
        self._connection = MqttConnection(
            (broker,), f"host-{host_id}", listener, mqtt_version=mqtt_version or broker.mqtt_version, loop=loop
        )
        self._plain_topics = PlainTopics(self._connection.sendable)

    def start(self) -> None:
        """Begin to connect; returns at once."""
        self._connection.start()

    def stop(self, timeout_s: float = 5.0) -> None:
        """Say that this host goes offline, disconnect and stop."""
        self._connection.close(self._session.close(now_ms()), timeout_s)

    @property
    def online(self) -> bool:
        """Return whether the broker has accepted the connection and the host knows it."""
        return self._session.online

    @property
    def reconnects(self) -> int:
        """Return how often the connection was made again."""
        return max(self._connection.connects - 1, 0)

    @property
    def last_error(self) -> str:
        """Why there is no connection; empty while there is one."""
        return self._connection.last_error

    @property
    def queue_depth(self) -> int:
        """Return how many messages wait to be polled."""
        return len(self._inbox)

    @property
    def backlog(self) -> int:
        """The number of messages that wait to be sent."""
        return self._connection.backlog

    @property
    def counts(self) -> dict[str, int]:
        """Return what the session has counted: births, data, holes, lost, late, malformed, …"""
        return dict(self._session.counts)

    @property
    def quarantine(self) -> tuple[Quarantined, ...]:
        """The nodes and devices of which something is refused, oldest first; read it only in the thread that polls."""
        return self._session.admission.quarantine.table()

    def picture(self, node: NodeId) -> NodePicture | None:
        """Return what is known of a node; read it only in the thread that polls."""
        return self._session.picture(node)

    def nodes(self) -> tuple[NodeId, ...]:
        """All nodes that were heard of."""
        return self._session.nodes()

    def births(self) -> list[HostEvent]:
        """Return a birth of each device that is online, with what is known of it by now; call it in the thread that polls."""
        return [
            HostEvent(EventKind.BIRTH, picture.node, device, owner.birth_ms, tuple(owner.readings.values()))
            for picture in filter(None, map(self._session.picture, self._session.nodes()))
            for device, owner in picture.devices.items()
            if picture.online and owner.online
        ]

    def poll(self, timeout_s: float, gather_s: float = 0.0) -> list[HostEvent]:
        """Return the events that have come, at the latest after `timeout_s`; drives the loop.

        gather_s: see `Loop.turn`
        """
        deadline_s = time.monotonic() + timeout_s
        while True:
            wait_s = 0.0 if self._inbox else min(max(deadline_s - time.monotonic(), 0.0), TICK_S)
            if not self._connection.loop.turn(wait_s, gather_s) and wait_s > 0.0:
                self._await_message(wait_s)
            events = self._take()
            now_s = time.monotonic()
            if now_s - self._ticked_s >= TICK_S:
                self._ticked_s = now_s
                try:
                    events += self._session.tick(now_ms())
                except Exception:
                    self._fail("a tick of the session failed")
                events += self._refused_by_rate(now_s)
                if not self._keep_s and self._lateness.is_lasting(now_s - self._inbox[0][2] if self._inbox else 0.0, now_s):
                    self._thin()
            if self._session.actions:
                self._connection.send(self._session.actions)
                self._session.actions = []
            if events or now_s >= deadline_s:
                return events

    def restore(self, births: Iterable[tuple[str, bytes]]) -> None:
        """Take births that an earlier run has heard (`HostSession.restore`). Call it before `start`."""
        self._session.restore(births, now_ms())

    def take_held(self) -> list[Held]:
        """Return the messages that were dealt with, and that the broker keeps until they are acknowledged."""
        held, self._held = self._held, []
        return held

    def acknowledge(self, held: Iterable[Held]) -> None:
        """Let the broker forget messages; those of an earlier connection it delivers again."""
        present = self._connection.connects
        if packet_ids := tuple(one.packet_id for one in held if one.connection == present):
            self._connection.send((Acknowledge(packet_ids),))

    def take_thinned(self) -> dict[NodeId, int]:
        """Return the messages of devices, by node, that were left out since the last call: more came than can be read."""
        if not self._thinned:
            return {}
        thinned, self._thinned = self._thinned, Counter()
        return of_devices(thinned.items())

    def _thin(self) -> None:
        """Leave out data of the nodes with most of them; who reads the socket only appends meanwhile."""
        inbox = self._inbox
        kept, gone = thinned([inbox.popleft() for _ in range(len(inbox))], self._trusted)
        inbox.extendleft(reversed(kept))
        self._thinned += gone

    def _refused_by_rate(self, now_s: float) -> list[HostEvent]:
        """Return an event for each node of which messages were dropped at the door, once a second."""
        if now_s - self._told_s < EXCESS_S:
            return []
        self._told_s = now_s
        return [self._session.admission.exceeded(excess, now_ms()) for excess in self._rates.excess()]

    def publish_plain(self, topic: str, payload: bytes, *, qos: int = 0, retain: bool = False) -> bool:
        """Publish outside the Sparkplug namespace; False where the broker is gone or takes less than it is given, or where the
        message cannot be sent at all."""
        return self.publish_all((Publish(topic, payload, qos, retain),))

    def publish_all(self, messages: Sequence[Publish]) -> bool:
        """Publish several messages outside the Sparkplug namespace; False where not all were sent, as in `publish_plain`."""
        sent = self._plain_topics.sent(list(messages))
        if not self._session.online or self._connection.full:
            return False
        self._connection.send(sent)
        return len(sent) == len(messages)

    def subscribe_plain(self, topic_filter: str) -> None:
        """Have messages outside the Sparkplug namespace come out of `poll` as PLAIN; kept over reconnects."""
        self._plain_filters.append(topic_filter)
        if self._session.online:
            self._connection.send((Subscribe(topic_filter),))

    def send_command(self, node: NodeId, device: str | None, changes: Sequence[Change]) -> bool:
        """Have a node or device write values; raises UnknownMetricError for what its birth does not declare."""
        if not self._session.online:
            return False
        self._connection.send((self._session.command(node, device, changes, now_ms()),))
        return True

    def request_rebirth(self, node: NodeId) -> bool:
        """Ask a node for its births, whether anything was heard of it or not; False where this host is offline."""
        check_id(node.group, "group id")
        check_id(node.node, "edge node id")
        if not self._session.online:
            return False
        self._connection.send((self._session.rebirth_request(node, now_ms()),))
        return True

    def want_birth(self, node: NodeId) -> None:
        """Have a node that was known before this host was started asked for its births, unless it is online or is born by itself.

        Asked again at a growing interval; nothing else would make a node speak that has nothing to say.
        """
        self._session.want_birth(node, now_ms())

    def _take(self) -> list[HostEvent]:
        events: list[HostEvent] = []
        inbox, session = self._inbox, self._session
        stale_s = time.monotonic() - self._stale_s_max
        while inbox and len(events) < EVENTS_A_POLL:
            topic, payload, came_s = inbox.popleft()
            if came_s < stale_s and isinstance(topic, str) and topic.startswith(NAMESPACE) and "DATA/" in topic:
                self.dropped += 1
            elif isinstance(topic, Held):
                self._held.append(topic)
            elif topic is _Mark.CONNECTED:
                events += self._session_begun()
                self._connection.send([*session.actions, *(Subscribe(plain) for plain in self._plain_filters)])
                session.actions = []
            elif topic is _Mark.LOST and self._keep_s:
                self._is_lost, session.online = True, False
                session.actions.clear()
            elif topic is _Mark.LOST:
                events += session.lost(now_ms())
            elif isinstance(topic, str) and topic.startswith(NAMESPACE):
                try:
                    events += session.message(topic, payload, now_ms())
                    if self.on_life is not None and ("BIRTH/" in topic or "DEATH/" in topic):
                        self.on_life(Topic.parse(topic), payload)
                    elif self.on_state is not None and topic.startswith(STATE_PREFIX):
                        self.on_state(topic.removeprefix(STATE_PREFIX), payload)
                except Exception:
                    self._fail(f"a message on {shortened(topic)} could not be taken")
            elif isinstance(topic, Overrun):
                events += session.overrun(topic, now_ms())
            elif len(payload) > self._plain_bytes_max:
                self.dropped += 1
            elif isinstance(topic, str):
                events.append(HostEvent(EventKind.PLAIN, _NOWHERE, None, now_ms(), topic=topic, payload=payload))
        return events

    def _session_begun(self) -> list[HostEvent]:
        """The broker has accepted the connection; where it has not kept the session, what is known is good no more."""
        is_kept = bool(self._keep_s) and self._connection.session_present
        withered = self._session.lost(now_ms()) if self._is_lost and not is_kept else []
        self._is_lost = False
        return [*withered, *self._session.connected(now_ms(), is_kept=is_kept)]

    def _fail(self, what: str) -> None:
        """Count a bug of ours: it costs this message, and no other."""
        self.faults += 1
        if (now_s := time.monotonic()) - self._failure_told_s >= FAILURE_TOLD_S:
            self._failure_told_s = now_s
            _log.exception("%s, %d such faults so far", what, self.faults)

    def _await_message(self, wait_s: float) -> None:
        """Wait where another thread turns the loop."""
        self._filled.clear()
        self._waits = True
        if not self._inbox:
            self._filled.wait(wait_s)
        self._waits = False

    def _put(self, topic: str | _Mark | Overrun | Held, payload: bytes, now_s: float) -> None:
        self._inbox.append((topic, payload, now_s))
        if self._waits:
            self._filled.set()

    def _is_read(self, topic: str) -> bool:
        """Return False for what the session would throw away unread: commands, states of other hosts, nodes nobody wants.

        What the session counts as malformed is for it to count.
        """
        if topic.startswith(STATE_PREFIX):
            return topic == self._session.state_topic or self.on_state is not None
        try:
            verb, node, _ = Topic.parse(topic)
        except TopicError:
            return True
        return verb not in (Verb.NCMD, Verb.DCMD) and self._wanted(node)

    def _connecting(self, _server: int) -> Connect:
        return self._session.connecting(now_ms(), self._keep_s)

    def _connected(self) -> None:
        self._put(_Mark.CONNECTED, b"", time.monotonic())

    def _lost(self) -> None:
        self._put(_Mark.LOST, b"", time.monotonic())

    def _hold(self, packet_id: int) -> bool:
        """Have a message acknowledged once the application has dealt with it."""
        if self._keep_s:
            self._put(Held(packet_id, self._connection.connects), b"", time.monotonic())
        return self._keep_s > 0

    def _message(self, topic: str, payload: bytes) -> None:
        now_s = time.monotonic()
        if not self._rates.admits(topic, len(payload), now_s):
            if (overrun := self._rates.overrun) is not None:
                self._rates.overrun = None
                self._put(overrun, b"", now_s)
            return
        depth = len(self._inbox)
        if depth >= self._queue_max and (depth >= 2 * self._queue_max or "DATA/" in topic):
            self.dropped += 1
            return
        self._put(topic, payload, now_s)
