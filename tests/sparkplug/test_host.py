"""A host application's inbox: what it takes, and what it drops."""

from __future__ import annotations

import threading
import time
from random import Random

import pytest

from sparkplug import host as host_module
from sparkplug.actions import Publish
from sparkplug.broker import BrokerAddress
from sparkplug.datatype import DataType
from sparkplug.edge_node import EdgeNode
from sparkplug.edge_session import EdgeNodeSession
from sparkplug.errors import TopicError
from sparkplug.host import EventKind, HostApplication, HostEvent
from sparkplug.host_session import HostSession
from sparkplug.metric import Change, MetricSpec, NodeId
from sparkplug.transport.loop import Loop
from tests.wire.mosquitto import Mosquitto
from tests.wire.mqtt_packets import Publish as PublishPacket
from tests.wire.proxy import Proxy

NODE = NodeId("cnc", "twin-thermal")
OTHER = NodeId("cnc", "edge-okuma")
PATIENCE_S = 60.0


def life(node: NodeId, values: int) -> list[Publish]:
    """The births of a node with one device, and so many values."""
    session = EdgeNodeSession(node)
    session.declare_device("okuma", [MetricSpec("load", DataType.DOUBLE)], 1)
    session.connecting(0, 1)
    actions = session.connected(1)
    for number in range(values):
        actions += session.publish("okuma", [Change("load", float(number), 2 + number)], 2 + number)
    return [action for action in actions if isinstance(action, Publish)]


def values_of(events: list[HostEvent]) -> list[object]:
    return [event.readings[0].value for event in events if event.kind is EventKind.DATA]


def unconnected(**options: object) -> HostApplication:
    return HostApplication(BrokerAddress(), "test", **options)  # type: ignore[arg-type]


def test_a_node_that_was_known_before_the_start_is_asked_once_unless_it_is_online() -> None:
    session = HostSession("test", chance=Random(0))
    session.connected(0)
    for message in life(NODE, 0):
        session.message(message.topic, message.payload, 1)
    session.actions.clear()
    session.want_birth(NODE, 2)
    session.want_birth(OTHER, 2)
    session.want_birth(OTHER, 3)
    for now_ms in range(2, 1000):
        session.tick(now_ms)
    assert [action.topic for action in session.actions if isinstance(action, Publish)] == ["spBv1.0/cnc/NCMD/edge-okuma"]


@pytest.mark.parametrize(
    ("topic", "is_read"),
    [
        ("spBv1.0/cnc/DDATA/edge-okuma/okuma", True),
        ("spBv1.0/cnc/NDEATH/edge-okuma", True),
        ("spBv1.0/cnc/NCMD/edge-okuma", False),
        ("spBv1.0/cnc/DCMD/edge-okuma/okuma", False),
        ("spBv1.0/cnc/NBIRTH/edge-nobody", False),  # not wanted
        ("spBv1.0/STATE/test", True),
        ("spBv1.0/STATE/another", False),
        ("spBv1.0/cnc/NONSENSE/edge-okuma", True),  # the session counts it as malformed
        ("cnc/okuma/load", True),
    ],
)
def test_what_nobody_would_read_is_thrown_away_by_its_topic(topic: str, is_read: bool) -> None:
    host = unconnected(wanted=lambda node: node.node != "edge-nobody")
    assert host._is_read(topic) is is_read


def test_data_that_have_waited_too_long_are_dropped_and_births_and_deaths_are_kept(monkeypatch: pytest.MonkeyPatch) -> None:
    host = unconnected(stale_s_max=60.0)
    now_s = time.monotonic()
    monkeypatch.setattr(host_module.time, "monotonic", lambda: now_s)
    birth, device, *data = life(NODE, 3)
    for message in (birth, device, *data):
        host._message(message.topic, message.payload)
    host._message("cnc/DATA/plain", b"of any age")
    now_s += 61.0
    death = Publish("spBv1.0/cnc/DDEATH/twin-thermal/okuma", b"")
    host._message(death.topic, death.payload)
    events = host.poll(0.0)
    assert [event.kind for event in events if event.kind is not EventKind.HOLE][:3] == [
        EventKind.BIRTH,
        EventKind.BIRTH,
        EventKind.PLAIN,
    ]
    assert not values_of(events)
    assert host.dropped == 3


def test_an_inbox_that_cannot_be_read_in_time_loses_data_of_who_floods_and_the_rest_is_read_in_order(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    host, clock = unconnected(), [1000.0]
    monkeypatch.setattr("sparkplug.host.time.monotonic", lambda: clock[0])
    for flooding, quiet in zip(life(NODE, 1000), [*life(OTHER, 20), *[None] * 1000], strict=False):
        for message in filter(None, (flooding, quiet)):
            host._message(message.topic, message.payload)
    monkeypatch.setattr(host_module, "EVENTS_A_POLL", 1)
    events = []
    for _ in range(30):
        clock[0] += 0.1
        events += host.poll(0.0)
    monkeypatch.setattr(host_module, "EVENTS_A_POLL", 10_000)
    events += host.poll(0.0)
    left_out = host.take_thinned()
    assert set(left_out) == {NODE}
    assert host.take_thinned() == {}
    flood = [event.readings[0].value for event in events if event.node == NODE and event.kind is EventKind.DATA]
    assert flood == sorted(flood)  # type: ignore[type-var]
    assert flood[-1] == 999.0
    assert len(flood) + left_out[NODE] == 1000
    assert len(flood) < 500
    assert [event.readings[0].value for event in events if event.node == OTHER and event.kind is EventKind.DATA] == [
        float(number) for number in range(20)
    ]
    assert host._session.actions == [], "nobody is asked for a rebirth"


def test_data_of_any_age_below_the_bound_are_read(monkeypatch: pytest.MonkeyPatch) -> None:
    host = unconnected(stale_s_max=60.0)
    now_s = time.monotonic()
    monkeypatch.setattr(host_module.time, "monotonic", lambda: now_s)
    for message in life(NODE, 3):
        host._message(message.topic, message.payload)
    now_s += 59.0
    assert values_of(host.poll(0.0)) == [0.0, 1.0, 2.0]
    assert host.dropped == 0


@pytest.mark.broker
@pytest.mark.parametrize("version", [4, 5])
def test_a_host_and_a_node_share_a_loop_and_all_of_the_node_is_read_once(mosquitto: Mosquitto, version: int) -> None:
    with Proxy(upstream=mosquitto.address) as proxy:
        loop = Loop()
        host = HostApplication(BrokerAddress(*mosquitto.address), "test", mqtt_version=version, loop=loop)
        node = EdgeNode(BrokerAddress(port=proxy.port), NODE, mqtt_version=version, loop=loop)
        node.declare_device("okuma", [MetricSpec("load", DataType.DOUBLE)])
        events: list[HostEvent] = []

        def poll_until(kinds: list[EventKind]) -> None:
            deadline_s = time.monotonic() + PATIENCE_S
            while [event.kind for event in events] != kinds:
                assert time.monotonic() < deadline_s, events
                events.extend(host.poll(0.1))

        host.start()
        while not host.online:
            host.poll(0.1)
        node.start()
        births, deaths = [EventKind.BIRTH] * 2, [EventKind.DEATH] * 2
        poll_until(births)
        for number in range(3):
            assert node.publish("okuma", [Change("load", float(number), number)])
        poll_until([*births, *[EventKind.DATA] * 3])
        proxy.cut()
        poll_until([*births, *[EventKind.DATA] * 3, *deaths, *births])
        assert values_of(events) == [0.0, 1.0, 2.0]
        assert not [thread for thread in threading.enumerate() if thread.name.startswith("mqtt cnc")], "one loop, one thread"
        node.stop()
        poll_until([*births, *[EventKind.DATA] * 3, *deaths, *births, *deaths])
        host.stop()
        assert proxy.packets("up", PublishPacket)[-1].topic == "spBv1.0/cnc/NDEATH/twin-thermal"


@pytest.mark.broker
def test_a_host_asks_a_node_of_which_it_has_heard_nothing_for_its_births(mosquitto: Mosquitto) -> None:
    node = EdgeNode(BrokerAddress(*mosquitto.address), OTHER)
    node.declare_device("okuma", [MetricSpec("load", DataType.DOUBLE)])
    host = HostApplication(BrokerAddress(*mosquitto.address), "test")
    assert not host.request_rebirth(OTHER), "offline"
    node.start()
    deadline_s = time.monotonic() + PATIENCE_S
    while not node.online:
        assert time.monotonic() < deadline_s
        time.sleep(0.01)
    host.start()
    events: list[HostEvent] = []
    asked = False
    while len(events) < 2:
        assert time.monotonic() < deadline_s
        events += host.poll(0.1)
        asked = asked or host.request_rebirth(OTHER)
    assert [(event.kind, event.device) for event in events[:2]] == [(EventKind.BIRTH, None), (EventKind.BIRTH, "okuma")]
    assert host.counts["rebirths_requested"] == 1
    host.stop()
    node.stop()


@pytest.mark.parametrize("node", [NodeId("cnc", "+"), NodeId("#", "edge"), NodeId("cnc", "a/b")])
def test_a_rebirth_is_asked_of_one_node_only(node: NodeId) -> None:
    with pytest.raises(TopicError):
        unconnected().request_rebirth(node)
