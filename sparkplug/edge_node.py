"""An edge node on a real broker: the session and the connection put together."""

import threading
from collections.abc import Callable, Collection, Iterable, Mapping, Sequence
from pathlib import Path

from sparkplug.actions import Barrier, Connect, HostState, Publish
from sparkplug.broker import BrokerAddress
from sparkplug.clock import now_ms
from sparkplug.edge_session import Command, EdgeNodeSession, Phase
from sparkplug.errors import SparkplugError, TopicError
from sparkplug.metric import Change, MetricSpec, NodeId
from sparkplug.session_files.alias_file import AliasFile
from sparkplug.session_files.bdseq import BdSeq
from sparkplug.session_files.session_lock import SessionLock
from sparkplug.transport.connection import MqttConnection
from sparkplug.transport.listener import Listener
from sparkplug.transport.loop import Loop
from sparkplug.transport.sendable import shortened, topic_fault
from sparkplug.values import Template


class EdgeNode:
    """Publishes the metrics of one edge node and its devices; every method may be called from any thread.

    `brokers` is one address, or a list that is walked while the primary host is offline. `session_file` keeps bdSeq over
    restarts, and a file beside it the aliases. `mqtt_version` (4 or 5) goes before that of the first address. `on_command` is
    called from the connection's thread for each value that a host wants written, `on_confirmed` for each `barrier` that the
    broker has acknowledged; they are published on `barrier_topic`. `on_host_state` is called for each STATE of one of the
    `watched_hosts` (None: the retained one was removed), which the node does not wait for. `loop` serves the connection,
    which has a loop of its own otherwise.
    """

    def __init__(
        self,
        brokers: BrokerAddress | Sequence[BrokerAddress],
        node: NodeId,
        metrics: Sequence[MetricSpec] = (),
        *,
        session_file: Path | None = None,
        primary_host: str | None = None,
        watched_hosts: Collection[str] = (),
        templates: Mapping[str, Template] | None = None,
        mqtt_version: int | None = None,
        on_command: Callable[[Command], None] | None = None,
        barrier_topic: str = "",
        on_confirmed: Callable[[int], None] = lambda _: None,
        on_host_state: Callable[[str, HostState | None], None] = lambda _host, _state: None,
        loop: Loop | None = None,
    ) -> None:
        self._own = None if session_file is None else SessionLock(session_file, f"{node.group}/{node.node}")
        self._bd_seq = BdSeq(session_file)
        self._aliases = AliasFile(None if session_file is None else session_file.with_name(session_file.name + ".aliases"))
        addresses = (brokers,) if isinstance(brokers, BrokerAddress) else tuple(brokers)
        self._session = EdgeNodeSession(
            node,
            metrics,
            now_ms=now_ms(),
            primary_host=primary_host,
            servers=len(addresses),
            watched_hosts=watched_hosts,
            templates=templates,
            aliases=self._aliases.read(),
        )
        self._number = 0
        self._barrier_topic = barrier_topic
        self._lock = threading.Lock()
        self._on_command, self._on_host_state = on_command, on_host_state
        listener = Listener(
            self._connecting, self._bd_seq.give_back, self._connected, self._message, self._lost, self._tick, on_confirmed
        )
        self._connection = MqttConnection(
            addresses,
            f"{node.group}/{node.node}",
            listener,
            mqtt_version=mqtt_version or addresses[0].mqtt_version,
            loop=loop,
        )

    def start(self) -> None:
        """Begin to connect; returns at once."""
        self._aliases.keep(self._session.aliases)
        self._connection.start()

    def stop(self, timeout_s: float = 5.0) -> None:
        """Publish the node's death, disconnect and stop."""
        with self._lock:
            farewell = self._session.close(now_ms())
            self._aliases.keep(self._session.aliases)
        self._connection.close(farewell, timeout_s)
        if self._own is not None:
            self._own.release()

    @property
    def online(self) -> bool:
        """Return whether the node is born: connected, and the primary host, if one is needed, is online."""
        return self._session.phase is Phase.BORN

    @property
    def session(self) -> int:
        """The number of the present connection, or of the last one. What was sent in one that ended may not have arrived."""
        return self._number

    @property
    def reconnects(self) -> int:
        """Return how often the connection was made again."""
        return max(self._connection.connects - 1, 0)

    @property
    def last_error(self) -> str:
        """Why there is no connection; empty while there is one."""
        return self._connection.last_error

    @property
    def unsent(self) -> int:
        """Return how many messages that `publish` took were dropped with a connection that ended before it took them.

        What was already in the socket of such a connection is not known: at QoS 0 nobody confirms it.
        """
        return self._connection.unsent

    @property
    def backlog(self) -> int:
        """Return how many messages wait for the broker to take them."""
        return self._connection.backlog

    def declare_device(self, device: str, metrics: Iterable[MetricSpec]) -> None:
        """Add a device (its birth is sent now if the node is born), or give one other metrics.

        Raises TopicError for a name on whose topics no broker takes a message.
        """
        if fault := topic_fault(device):
            raise TopicError(f"device id {shortened(device)} can stand in no topic: {fault}; give it another name")
        with self._lock:
            actions = self._session.declare_device(device, metrics, now_ms())
            self._aliases.keep(self._session.aliases)
            self._connection.send(actions)

    def remove_device(self, device: str) -> None:
        """Publish the death of a device and forget it."""
        with self._lock:
            self._connection.send(self._session.remove_device(device, now_ms()))

    def publish(self, device: str | None, changes: Sequence[Change]) -> bool:
        """Send changes of a device (None: of the node) in one message, and keep them for the next birth.

        False where they were not sent, because the node is offline, the broker takes less than it is given, or no message so
        long; then the next birth carries the values. Raises UnknownMetricError or MetricValueError for what the birth does not
        declare.
        """
        with self._lock:
            if self._connection.full:
                # Nothing is sent, so no sequence number is used and no host sees a hole; the caller counts the loss.
                self._session.note(device, changes)
                return False
            actions = self._session.publish(device, changes, now_ms())
            self._connection.send(actions)
        message = actions[0] if actions else None
        return isinstance(message, Publish) and len(message.payload) < self._connection.sendable.packet_bytes_max

    def barrier(self, token: int, session: int) -> bool:
        """Have `on_confirmed(token)` called when the broker has taken all that was published before in this session.

        False where that session is over: what was published in it has to be taken as lost.
        """
        if not self._barrier_topic:
            raise SparkplugError(f"edge node {self._session.node} was given no barrier_topic")
        with self._lock:
            if session != self._number or self._session.phase is Phase.OFFLINE:
                return False
            self._connection.send([Barrier(self._barrier_topic, token)])
        return True

    def _connecting(self, server: int) -> Connect:
        with self._lock:
            self._number += 1
            return self._session.connecting(self._bd_seq.next(), now_ms(), server)

    def _connected(self) -> None:
        with self._lock:
            self._connection.send(self._session.connected(now_ms()))

    def _lost(self) -> None:
        with self._lock:
            self._session.lost()

    def _message(self, topic: str, payload: bytes) -> None:
        with self._lock:
            self._connection.send(self._session.message(topic, payload, now_ms()))
            commands, self._session.commands = self._session.commands, []
            states, self._session.host_states = self._session.host_states, []
        if self._on_command is not None:
            for command in commands:
                self._on_command(command)
        for host, state in states:
            self._on_host_state(host, state)

    def _tick(self) -> None:
        with self._lock:
            self._aliases.keep(self._session.aliases)
            self._connection.send(self._session.tick(now_ms()))
