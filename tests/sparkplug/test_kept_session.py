"""A host whose session the broker keeps: what it was not told, and what it has not acknowledged, comes when it is back."""

import time
from collections.abc import Callable, Iterator

import pytest

from sparkplug.broker import BrokerAddress
from sparkplug.datatype import DataType
from sparkplug.edge_node import EdgeNode
from sparkplug.host import EventKind, Held, HostApplication, HostEvent
from sparkplug.metric import Change, MetricSpec, NodeId
from sparkplug.topics import Topic, group_filter
from tests.wire.mosquitto import Mosquitto

NODE = NodeId("kept", "edge")
WITHIN_S = 20.0


@pytest.fixture(scope="module")
def broker() -> Iterator[BrokerAddress]:
    """A broker that delivers at the QoS of the subscription."""
    with Mosquitto(extra=("upgrade_outgoing_qos true",)) as mosquitto:
        yield BrokerAddress("127.0.0.1", mosquitto.port)


class Listening:
    """A host application with what it has heard of the device: values of data, and kinds of the rest."""

    def __init__(self, broker: BrokerAddress, name: str, births: list[tuple[str, bytes]]) -> None:
        self.host = HostApplication(broker, name, [group_filter("kept")], keep_s=3600, publish_state=False)
        self.host.on_life = self.life
        self.births = births
        self.host.restore(births)
        self.values: list[float] = []
        self.kinds: list[EventKind] = []
        self.held: list[Held] = []
        self.host.start()

    def life(self, topic: Topic, payload: bytes) -> None:
        self.births.append((str(topic), payload))

    def take(self, event: HostEvent) -> None:
        if event.device is None:
            return
        if event.kind is EventKind.DATA:
            self.values += [float(one.value) for one in event.readings]  # type: ignore[arg-type]
        else:
            self.kinds.append(event.kind)

    def until(self, holds: Callable[[], bool]) -> None:
        deadline_s = time.monotonic() + WITHIN_S
        while not holds():
            assert time.monotonic() < deadline_s, (self.values[-3:], self.kinds)
            for event in self.host.poll(0.1):
                self.take(event)
            self.held += self.host.take_held()

    def killed(self) -> None:
        """End as a kill does: the connection is gone, and nobody is told anything."""
        self.host._connection._stream.finish()  # type: ignore[union-attr]
        self.host._connection.close((), 1.0)


def edge_of(broker: BrokerAddress) -> EdgeNode:
    edge = EdgeNode(broker, NODE)
    edge.declare_device("okuma", [MetricSpec("load", DataType.DOUBLE, value=0.0)])
    edge.start()
    return edge


def say(edge: EdgeNode, values: range) -> None:
    for value in values:
        assert edge.publish("okuma", [Change("load", float(value), 1_790_000_000_000 + value)])


def test_what_was_said_while_it_was_away_comes_in_order_and_needs_no_birth(broker: BrokerAddress) -> None:
    births: list[tuple[str, bytes]] = []
    first = Listening(broker, "away", births)
    first.until(lambda: first.host.online)
    edge = edge_of(broker)
    try:
        first.until(lambda: EventKind.BIRTH in first.kinds)
        say(edge, range(1, 4))
        first.until(lambda: first.values == [1.0, 2.0, 3.0])
        first.until(lambda: len(first.held) >= 5)  # two births and three messages
        first.host.acknowledge(first.held)
        say(edge, range(4, 7))
        first.until(lambda: first.values[-1] == 6.0)  # read, and never acknowledged
        first.killed()
        say(edge, range(7, 60))
        second = Listening(broker, "away", births)
        second.until(lambda: bool(second.values) and second.values[-1] == 59.0)
        assert second.values == [float(value) for value in range(4, 60)]
        assert second.kinds == []
        second.host.stop()
    finally:
        edge.stop()


def test_a_connection_that_ends_makes_nothing_stale_while_the_session_is_kept(broker: BrokerAddress) -> None:
    one = Listening(broker, "cut", [])
    one.until(lambda: one.host.online)
    edge = edge_of(broker)
    try:
        one.until(lambda: EventKind.BIRTH in one.kinds)
        one.host.acknowledge(one.held)
        one.kinds.clear()
        one.host._connection._stream.finish()  # type: ignore[union-attr]
        say(edge, range(1, 4))
        one.until(lambda: one.values[-3:] == [1.0, 2.0, 3.0])
        assert EventKind.DEATH not in one.kinds
        assert one.host.reconnects >= 1
        one.host.stop()
    finally:
        edge.stop()
