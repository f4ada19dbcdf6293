"""The rules find nothing in the recordings of our own clients, and find each fault that is put into them."""

import time
from collections.abc import Callable, Iterator
from dataclasses import replace
from typing import Any

import pytest

from sparkplug.broker import BrokerAddress
from sparkplug.clock import now_ms
from sparkplug.codec import parse
from sparkplug.datatype import DataType
from sparkplug.edge_node import EdgeNode
from sparkplug.host import HostApplication
from sparkplug.metric import Change, MetricSpec, NodeId
from tests.wire.mosquitto import Mosquitto
from tests.wire.mqtt_packets import Connect, Disconnect, Packet, Publish, Subscribe, Will
from tests.wire.proxy import Proxy
from tests.wire.recording import Recorded
from tests.wire.session_rules import violations

pytestmark = [pytest.mark.broker, pytest.mark.usefixtures("way")]

NODE = NodeId("cnc", "edge")
LOAD = MetricSpec("load", DataType.DOUBLE)
TOOL = MetricSpec("tool", DataType.INT32)


def _live(proxy: Proxy, version: int) -> None:
    """A host and an edge node with two devices on one broker; both are cut once and end by their own will."""
    host = HostApplication(BrokerAddress(port=proxy.port), "scada", mqtt_version=version)
    edge = EdgeNode(BrokerAddress(port=proxy.port), NODE, [MetricSpec("lag", DataType.INT64)], mqtt_version=version)
    edge.declare_device("okuma", [LOAD, TOOL])
    host.start()
    # Whoever subscribes after a birth does not know of it until the node sends something.
    _poll_until(host, lambda: any(isinstance(p, Publish) for p in proxy.packets("up")))
    edge.start()
    since_ms = 0
    for round_ in (1, 2):
        _poll_until(host, lambda: edge.online and _born_ms(host) > since_ms)  # noqa: B023
        edge.declare_device("probe", [LOAD])
        edge.publish(None, [Change("lag", 1, 1_700_000_000_000)])
        edge.publish("okuma", [Change("load", 1.0, 1_700_000_000_000), Change("tool", 2, 1_700_000_000_001)])
        edge.publish("probe", [Change("load", 1.0, 1_700_000_000_000)])
        edge.remove_device("probe")
        host.send_command(NODE, "okuma", [Change("tool", 3, 1_700_000_000_000)])
        # The two clients write on connections of their own, so the command may overtake what the edge node has still to write.
        for last in ("/DCMD/", "/DDEATH/"):
            _poll_until(host, lambda: sum(last in p.topic for p in proxy.packets("up", Publish)) == round_)  # noqa: B023
        if round_ == 1:
            since_ms = now_ms()
            proxy.cut()
    edge.stop()
    host.stop()
    proxy.wait_for(lambda packet: isinstance(packet, Disconnect), count=2)


def _born_ms(host: HostApplication) -> int:
    """When the node was born whose device the host knows; 0 where it does not."""
    picture = host.picture(NODE)
    # Between the birth of the node and that of its device, nothing of the device can be commanded.
    known = picture is not None and picture.online and "okuma" in picture.devices and "tool" in picture.devices["okuma"].bindings
    return picture.own.birth_ms if picture is not None and known else 0


def _poll_until(host: HostApplication, ready: Callable[[], Any]) -> None:
    deadline_s = time.monotonic() + 60.0
    while not ready():
        assert time.monotonic() < deadline_s
        host.poll(0.05)


@pytest.fixture(scope="module")
def recordings(way: str) -> Iterator[dict[int, list[Recorded]]]:
    """The same life with MQTT 3.1.1 (4) and MQTT 5."""
    lives = {}
    for version in (4, 5):
        with Mosquitto() as broker, Proxy(broker.address) as proxy:
            _live(proxy, version)
            lives[version] = proxy.recorded
    yield lives


@pytest.mark.parametrize("version", [4, 5])
def test_our_own_clients_keep_the_rules(recordings: dict[int, list[Recorded]], version: int) -> None:
    assert violations(recordings[version]) == []


def test_the_rules_look_at_every_message_type(recordings: dict[int, list[Recorded]]) -> None:
    verbs = {
        seen.packet.topic.split("/")[2] for seen in recordings[4] if isinstance(seen.packet, Publish) and seen.direction == "up"
    }
    assert verbs >= {"NBIRTH", "DBIRTH", "NDATA", "DDATA", "DDEATH", "NDEATH", "DCMD", "scada"}


def _payload(change: Callable[[Any], object]) -> Callable[[Publish], Packet]:
    """A fault inside the protobuf payload of a message."""

    def mutate(packet: Publish) -> Packet:
        message = parse(packet.payload)
        change(message)
        return replace(packet, payload=message.SerializeToString())

    return mutate


def _will(**fields: Any) -> Callable[[Connect], Packet]:
    def mutate(connect: Connect) -> Packet:
        assert isinstance(connect.will, Will)
        return replace(connect, will=replace(connect.will, **fields))

    return mutate


def _metric(name: str, change: Callable[[Any], object]) -> Callable[[Any], object]:
    return lambda message: [change(metric) for metric in message.metrics if metric.name == name]


EDGE, HOST = "/NDEATH/", "/STATE/"
# What is changed (a packet type, a part of its topic or of its will's topic), how, and the rule that must say so.
FAULTS: list[tuple[type[Packet], str, Callable[[Any], Packet | None], str]] = [
    (Connect, EDGE, lambda p: replace(p, clean=False), "not clean"),
    (Connect, EDGE, lambda p: replace(p, version=5, properties=(("session_expiry_interval", 9),)), "outlives"),
    (Connect, EDGE, _will(qos=0), "the will of a node has QoS 0"),
    (Connect, EDGE, _will(retain=True), "retain True"),
    (Connect, EDGE, _will(payload=b"\x18\x01"), "one metric"),
    (Connect, HOST, _will(qos=0), "the will of a host has QoS 0"),
    (Connect, HOST, _will(retain=False), "retain False"),
    (Connect, HOST, _will(payload=b'{"online":true,"timestamp":1}'), "online True"),
    (Connect, HOST, _will(payload=b'{"online":false,"timestamp":1}'), "time stamp"),
    (Subscribe, "/NCMD/", lambda p: replace(p, filters=((p.filters[0][0], 0),)), "QoS 1"),
    (Subscribe, "/STATE/", lambda _: None, "before the subscriptions"),
    (Publish, "/NBIRTH/", lambda _: None, "before the NBIRTH"),
    (Publish, "/NBIRTH/", lambda p: replace(p, qos=1), "QoS 1"),
    (Publish, "/NBIRTH/", lambda p: replace(p, retain=True), "retained"),
    (Publish, "/NBIRTH/", _payload(lambda m: setattr(m, "seq", 7)), "of an NBIRTH is 7"),
    (Publish, "/NBIRTH/", _payload(lambda m: m.ClearField("seq")), "no sequence number"),
    (Publish, "/NBIRTH/", _payload(lambda m: m.ClearField("timestamp")), "when it was sent"),
    (Publish, "/NBIRTH/", _payload(_metric("bdSeq", lambda x: setattr(x, "long_value", 9))), "bdSeq 9"),
    (Publish, "/NBIRTH/", _payload(_metric("Node Control/Rebirth", lambda x: setattr(x, "alias", 9))), "no alias"),
    (Publish, "/NBIRTH/", _payload(_metric("Node Control/Rebirth", lambda x: setattr(x, "boolean_value", True))), "Rebirth"),
    (Publish, "/NBIRTH/", _payload(_metric("lag", lambda x: x.ClearField("datatype"))), "lacks"),
    (Publish, "/NBIRTH/", _payload(_metric("lag", lambda x: x.ClearField("timestamp"))), "no time stamp"),
    (Publish, "/DBIRTH/edge/probe", lambda _: None, "where"),
    (Publish, "/DBIRTH/", _payload(lambda m: setattr(m.metrics[0], "alias", m.metrics[1].alias)), "two metrics"),
    (Publish, "/DBIRTH/", _payload(lambda m: m.metrics[0].ClearField("is_null")), "neither a value nor a null"),
    (Publish, "/NDATA/", _payload(lambda m: setattr(m.metrics[0], "alias", 999)), "999 was not born"),
    (Publish, "/NDATA/", _payload(lambda m: setattr(m.metrics[0], "name", "lag")), "although it has an alias"),
    (Publish, "/DDATA/", _payload(lambda m: setattr(m.metrics[0], "datatype", 10)), "although it has an alias"),
    (Publish, "/DDATA/edge/okuma", _payload(lambda m: setattr(m.metrics[1], "timestamp", 1)), "order of their times"),
    (Publish, "/DDATA/", _payload(lambda m: setattr(m, "seq", m.seq + 1)), "is due"),
    (Publish, "/DDATA/", lambda p: replace(p, topic=p.topic + "2"), "was not born"),
    (Publish, "/DDATA/", lambda p: replace(p, payload=b"\xff\xff"), "no Sparkplug payload"),
    (Publish, "/DDEATH/", lambda p: replace(p, topic=p.topic + "2"), "was not born"),
    (Publish, "/NDEATH/", _payload(lambda m: setattr(m.metrics[0], "long_value", 77)), "bdSeq 77"),
    (Publish, "/NDEATH/", _payload(lambda m: setattr(m, "seq", 1)), "no sequence number"),
    (Publish, "/NDEATH/", lambda _: None, "no NDEATH before"),
    (Publish, "/DCMD/", _payload(lambda m: setattr(m, "seq", 1)), "no sequence number"),
    (Publish, "/DCMD/", lambda p: replace(p, qos=1), "a command has QoS 1"),
    (Publish, "/DCMD/", lambda p: replace(p, topic="spBv1.0/cnc/NDATA/edge"), "nothing but commands"),
    (Publish, "/STATE/", lambda p: replace(p, retain=False), "retain False"),
    (Publish, "/STATE/", lambda p: replace(p, payload=b"ONLINE"), "STATE b'ONLINE'"),
]


def _about(packet: Packet) -> str:
    """The topic that tells one packet from another of its type."""
    if isinstance(packet, Publish):
        return packet.topic
    if isinstance(packet, Subscribe):
        return packet.filters[0][0]
    return packet.will.topic if isinstance(packet, Connect) and packet.will is not None else ""


@pytest.mark.parametrize(("kind", "topic", "mutate", "rule"), FAULTS, ids=[f"{f[0].__name__} {f[1]} {f[3]}" for f in FAULTS])
def test_each_fault_is_found(
    recordings: dict[int, list[Recorded]],
    kind: type[Packet],
    topic: str,
    mutate: Callable[[Any], Packet | None],
    rule: str,
) -> None:
    recorded = list(recordings[4])
    index = next(
        i
        for i, seen in enumerate(recorded)
        if seen.direction == "up" and isinstance(seen.packet, kind) and topic in _about(seen.packet)
    )
    fault = mutate(recorded[index].packet)
    recorded[index : index + 1] = [] if fault is None else [recorded[index]._replace(packet=fault)]
    found = violations(recorded)
    assert any(rule in violation for violation in found), found


def test_a_bdseq_that_is_used_twice_is_found(recordings: dict[int, list[Recorded]]) -> None:
    connects = [seen for seen in recordings[4] if isinstance(seen.packet, Connect) and EDGE in _about(seen.packet)]
    assert violations([connects[0], connects[0]._replace(connection=9)]) == ["connection 9, Connect: bdSeq 0 where 1 is due"]
    assert violations([connects[1]], first_bd_seq=None) == []


def test_a_disconnect_without_the_will_is_found_with_mqtt_5(recordings: dict[int, list[Recorded]]) -> None:
    recorded = [
        seen._replace(packet=replace(seen.packet, reason=0)) if isinstance(seen.packet, Disconnect) else seen
        for seen in recordings[5]
    ]
    assert any("0x04 is due" in violation for violation in violations(recorded))
