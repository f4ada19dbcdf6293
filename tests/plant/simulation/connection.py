"""A stand-in for `sparkplug.transport`: a connection and its loop with the same surface, on the model of a broker.

The life of a connection is that of `MqttConnection`: an attempt in a task of its own, the real itinerary with its pauses, the
real bounds of what can be sent, an outbox that goes down with the connection, listeners called by whoever turns the loop. The
bytes of MQTT, paho and sockets are not modelled.
"""

from collections import deque
from collections.abc import Sequence
from typing import Any, ClassVar

from sparkplug.actions import Action, Barrier, Disconnect, Publish, Subscribe
from sparkplug.broker import BrokerAddress
from sparkplug.transport.connection import OUTBOX_BYTES_MAX, OUTBOX_MAX
from sparkplug.transport.itinerary import Itinerary
from sparkplug.transport.listener import Listener
from sparkplug.transport.sendable import Sendable
from tests.plant.simulation.broker import CONNACK, ENDED, MESSAGE, PUBACK, Broker, Link
from tests.plant.simulation.kernel import Kernel, Process, Signal

TICK_S = 0.2
READ_AT_ONCE = 500
MQTT_5 = 5


class SimulatedLoop:
    """As `sparkplug.transport.loop.Loop`: whoever turns it does its work."""

    kernel: ClassVar[Kernel]
    broker: ClassVar[Broker]

    def __init__(self, name: str = "mqtt") -> None:
        self.arrived = Signal(self.kernel)
        self.connections: list[SimulatedConnection] = []
        self._tick_s = self._read_s = 0.0

    def turn(self, timeout_s: float, gather_s: float = 0.0) -> bool:
        """Send what waits, wait until something comes, handle all that has come."""
        kernel = self.kernel
        for connection in list(self.connections):
            connection.flush()
        pause_s = min(self._read_s + gather_s - kernel.now_s, timeout_s)
        if gather_s > 0.0 and pause_s > 0.0:
            kernel.sleep(pause_s)
            timeout_s -= pause_s
        if not any(connection.inbox for connection in self.connections) and timeout_s > 0.0:
            self.arrived.wait(min(timeout_s, TICK_S))
        for connection in list(self.connections):
            if connection.inbox:
                self._read_s = kernel.now_s
                connection.read()
        if kernel.now_s >= self._tick_s:
            self._tick_s = kernel.now_s + TICK_S
            for connection in list(self.connections):
                connection.tick()
        return True


class SimulatedConnection:
    """As `sparkplug.transport.connection.MqttConnection`."""

    def __init__(
        self,
        brokers: Sequence[BrokerAddress],
        client_id: str,
        listener: Listener,
        *,
        mqtt_version: int = 4,
        loop: SimulatedLoop | None = None,
        **_: Any,
    ) -> None:
        self.loop = loop or SimulatedLoop()
        self.kernel = SimulatedLoop.kernel
        self.last_error = ""
        self.connects = self.unsent = 0
        self.inbox: deque[tuple[str, Any]] = deque()
        self._broker = SimulatedLoop.broker
        self._process: Process = self.kernel.me().process
        self._client_id, self._listener, self._is_5 = client_id, listener, mqtt_version == MQTT_5
        self.sendable = Sendable(client_id)
        self._itinerary = Itinerary(brokers, self.kernel.chance)
        self._link: Link | None = None
        self._outbox: deque[Action] = deque()
        self._accepted = self._stopping = self._is_leaving = False
        self._dial_s: float | None = None
        self._process.at_death.append(self._died)

    # What the owner calls.

    def start(self) -> None:
        """Begin to connect."""
        self.loop.connections.append(self)
        self._dial()

    def send(self, actions: Sequence[Action]) -> None:
        """Send these in order, with the next turn of the loop."""
        self._outbox.extend(actions)
        if len(self._outbox) > READ_AT_ONCE:
            self.flush()

    @property
    def full(self) -> bool:
        """True if no more should be put into the outbox."""
        size = sum(len(action.payload) for action in self._outbox if isinstance(action, Publish)) if len(self._outbox) > 50 else 0
        return len(self._outbox) >= OUTBOX_MAX or size >= OUTBOX_BYTES_MAX

    @property
    def backlog(self) -> int:
        """The number of actions that wait to be sent."""
        return len(self._outbox)

    def close(self, farewell: Sequence[Action], timeout_s: float) -> None:
        """Send the last messages and stop."""
        if self not in self.loop.connections:
            return
        self._outbox.extend(farewell)
        self._stopping = True
        self.flush()
        if not self._is_leaving:
            self._over()

    # What the loop calls.

    def flush(self) -> None:
        """Send what waits."""
        link = self._link
        while link is not None and self._accepted and self._outbox:
            action = self._outbox.popleft()
            if isinstance(action, Publish):
                if self.sendable.takes(action):
                    self._broker.publish(link, action)
            elif isinstance(action, Barrier):
                self._broker.publish(link, Publish(action.topic, str(action.token).encode(), 1), action.token)
            elif isinstance(action, Subscribe):
                self._broker.subscribe(link, action.topic_filter, action.qos)
            else:
                self._accepted, self._is_leaving = False, True
                self._outbox.clear()
                with_will = self._is_5 and (not isinstance(action, Disconnect) or action.with_will)
                self._broker.disconnect(link, with_will=with_will)
                if not isinstance(action, Disconnect):
                    self._itinerary.walk()
                if self._stopping:
                    self._over()

    def read(self) -> None:
        """Hand on what has come."""
        for _ in range(READ_AT_ONCE):
            if not self.inbox:
                return
            what, value = self.inbox.popleft()
            if what == ENDED:
                self._over()
            elif what == CONNACK:
                self.connects += 1
                self.last_error = ""
                self._accepted = True
                self._itinerary.accepted(self.kernel.now_s)
                self._listener.connected()
                self.flush()
            elif self._is_leaving:
                continue
            elif what == PUBACK:
                self._listener.confirmed(value)
            elif what == MESSAGE and self._listener.wanted(value[0]):
                self._listener.message(*value)

    def tick(self) -> None:
        """Do what is due."""
        if self._dial_s is not None:
            if self.kernel.now_s >= self._dial_s:
                self._dial()
        elif self._link is not None and self._accepted:
            self._listener.tick()
            self.flush()

    # How it is done.

    def _dial(self) -> None:
        self._dial_s = None
        self._process.spawn(self._attempt, f"dial {self._client_id}")

    def _attempt(self) -> None:
        while self._outbox:
            self.unsent += isinstance(self._outbox.popleft(), Publish)
        connect = self._listener.connecting(self._itinerary.server)
        self.kernel.sleep(0.001)
        self._is_leaving = False
        self._link = self._broker.dial(self._client_id, connect.will, self._receive(object()))
        if self._link is None:
            self._listener.unsent()
            self.last_error = "nobody answers"
            self._over()

    def _receive(self, mark: object) -> Any:
        self._mark = mark

        def receive(what: str, value: Any) -> None:
            if self._mark is mark and self._process.is_alive:
                self.inbox.append((what, value))
                self.loop.arrived.fire()

        return receive

    def _over(self) -> None:
        was_reached = self._link is not None
        self._link, self._accepted, self._mark = None, False, None
        self.inbox.clear()
        self._listener.lost()
        if self._stopping:
            self.loop.connections.remove(self)
            return
        now_s = self.kernel.now_s
        self._dial_s = now_s + self._itinerary.ended(now_s, somebody_listens=was_reached)

    def _died(self) -> None:
        if self._link is not None:
            self._broker.reset(self._link)
