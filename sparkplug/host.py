"""A host application on a real broker: the session and the connection put together.

Whoever reads the socket only fills a bounded inbox; decoding, ordering and everything after that happen in the thread that
calls `poll`. While that thread waits it reads the socket itself; while it computes, the connection's own thread does. What does
not fit is dropped and counted, data first: a birth or a death is worth more than a value.
"""

import threading
import time
from collections import deque
from collections.abc import Callable, Sequence
from enum import Enum
from random import Random

from sparkplug.actions import Connect, Publish, Subscribe
from sparkplug.broker import BrokerAddress
from sparkplug.connection import Listener, MqttConnection, now_ms
from sparkplug.host_session import EventKind, HostEvent, HostSession
from sparkplug.metric import Change, NodeId
from sparkplug.node_picture import NodePicture
from sparkplug.topics import NAMESPACE, group_filter

__all__ = ["EventKind", "HostApplication", "HostEvent"]

EVENTS_A_POLL = 1000
TICK_S = 0.1
_NOWHERE = NodeId("", "")


class _Mark(Enum):
    """What stands in the inbox between messages."""

    CONNECTED = "connected"
    LOST = "lost"


class HostApplication:
    """Listens to edge nodes; `wanted` picks them, `topic_filters` tells the broker what to send."""

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
    ) -> None:
        self.dropped = 0
        self._queue_max = queue_max
        self._session = HostSession(
            host_id,
            topic_filters,
            chance=Random(),  # noqa: S311 — spreads requests, keeps no secret
            reorder_timeout_ms=reorder_timeout_ms,
            rebirth_interval_ms_min=rebirth_interval_ms_min,
            publish_state=publish_state,
            wanted=wanted,
        )
        self._plain_filters: list[str] = []
        self._inbox: deque[tuple[str | _Mark, bytes]] = deque()
        self._filled = threading.Event()
        self._ticked_s = 0.0
        listener = Listener(self._connecting, lambda: None, self._connected, self._message, self._lost, lambda: None)
        self._connection = MqttConnection(
            (broker,), f"host-{host_id}", listener, mqtt_version=mqtt_version or broker.mqtt_version
        )

    def start(self) -> None:
        """Begin to connect; returns at once."""
        self._connection.start()

    def stop(self, timeout_s: float = 5.0) -> None:
        """Say that this host goes offline, disconnect and stop."""
        self._connection.close(self._session.close(now_ms()), timeout_s)

    @property
    def online(self) -> bool:
        """Whether the broker has accepted the connection and the host knows it."""
        return self._session.online

    @property
    def reconnects(self) -> int:
        """How often the connection was made again."""
        return max(self._connection.connects - 1, 0)

    @property
    def last_error(self) -> str:
        """Why there is no connection; empty while there is one."""
        return self._connection.last_error

    @property
    def queue_depth(self) -> int:
        """How many messages wait to be polled."""
        return len(self._inbox)

    @property
    def backlog(self) -> int:
        """How many messages wait to be sent."""
        return self._connection.backlog

    @property
    def counts(self) -> dict[str, int]:
        """What the session has counted: births, data, holes, lost, late, malformed, …"""
        return dict(self._session.counts)

    def picture(self, node: NodeId) -> NodePicture | None:
        """What is known of a node; read it only in the thread that polls."""
        return self._session.picture(node)

    def nodes(self) -> tuple[NodeId, ...]:
        """All nodes that were heard of."""
        return self._session.nodes()

    def poll(self, timeout_s: float) -> list[HostEvent]:
        """The events that have come, at the latest after `timeout_s`."""
        deadline_s = time.monotonic() + timeout_s
        while True:
            events = self._take()
            now_s = time.monotonic()
            if now_s - self._ticked_s >= TICK_S:
                self._ticked_s = now_s
                events += self._session.tick(now_ms())
            if self._session.actions:
                self._connection.send(self._session.actions)
                self._session.actions = []
            if events or now_s >= deadline_s:
                return events
            wait_s = min(deadline_s - now_s, TICK_S)
            if not self._connection.drive(wait_s):
                self._filled.wait(wait_s)

    def publish_plain(self, topic: str, payload: bytes, *, qos: int = 0, retain: bool = False) -> bool:
        """Publish outside the Sparkplug namespace; False where the broker is gone or takes less than it is given."""
        if topic.startswith(f"{NAMESPACE}/"):
            raise ValueError(f"{topic!r} lies in the Sparkplug namespace; a host writes there by commands only")
        if not self._session.online or self._connection.full:
            return False
        self._connection.send((Publish(topic, payload, qos, retain),))
        return True

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

    def _take(self) -> list[HostEvent]:
        events: list[HostEvent] = []
        inbox, session = self._inbox, self._session
        self._filled.clear()
        while inbox and len(events) < EVENTS_A_POLL:
            topic, payload = inbox.popleft()
            if topic is _Mark.CONNECTED:
                events += session.connected(now_ms())
                self._connection.send([*session.actions, *(Subscribe(plain) for plain in self._plain_filters)])
                session.actions = []
            elif topic is _Mark.LOST:
                events += session.lost(now_ms())
            elif isinstance(topic, str) and topic.startswith(NAMESPACE):
                events += session.message(topic, payload, now_ms())
            elif isinstance(topic, str):
                events.append(HostEvent(EventKind.PLAIN, _NOWHERE, None, now_ms(), topic=topic, payload=payload))
        return events

    def _put(self, topic: str | _Mark, payload: bytes) -> None:
        self._inbox.append((topic, payload))
        if not self._filled.is_set():
            self._filled.set()

    def _connecting(self, _server: int) -> Connect:
        return self._session.connecting(now_ms())

    def _connected(self) -> None:
        self._put(_Mark.CONNECTED, b"")

    def _lost(self) -> None:
        self._put(_Mark.LOST, b"")

    def _message(self, topic: str, payload: bytes) -> None:
        depth = len(self._inbox)
        if depth >= self._queue_max and (depth >= 2 * self._queue_max or "DATA/" in topic):
            self.dropped += 1
            return
        self._put(topic, payload)
