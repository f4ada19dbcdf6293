"""An edge node as its broker sees it: a recording proxy stands between EdgeNode and a real Mosquitto."""

import time
from collections.abc import Callable, Iterator
from contextlib import AbstractContextManager
from pathlib import Path

import paho.mqtt.publish
import pytest

from sparkplug.actions import HostState
from sparkplug.broker import BrokerAddress
from sparkplug.codec import encode, parse
from sparkplug.datatype import DataType
from sparkplug.edge_node import EdgeNode
from sparkplug.edge_session import REBIRTH
from sparkplug.host import HostApplication
from sparkplug.metric import NodeId
from sparkplug.values import Metric, Payload
from tests.sparkplug.conformance.life import AXIS, EPOCH_MS, HOST_ID, NODE, NODE_METRICS, OKUMA_METRICS, PROBE_METRICS, change
from tests.wire.mosquitto import Mosquitto
from tests.wire.mqtt_packets import Acknowledgement, Connack, Connect, Disconnect, Packet, Publish, Suback, Subscribe
from tests.wire.proxy import Proxy
from tests.wire.recording import Recorded

pytestmark = [pytest.mark.broker, pytest.mark.usefixtures("way")]

NDEATH = "spBv1.0/cnc/NDEATH/edge-okuma"
STATE = "spBv1.0/STATE/scada"


def _on(topic_part: str) -> Callable[[Packet], bool]:
    return lambda packet: isinstance(packet, Publish) and topic_part in packet.topic


def _edge(*proxies: Proxy, version: int, file: Path | None = None, primary_host: str | None = None) -> EdgeNode:
    brokers = [BrokerAddress(port=proxy.port) for proxy in proxies]
    edge = EdgeNode(
        brokers,
        NODE,
        NODE_METRICS,
        session_file=file,
        primary_host=primary_host,
        templates={"Axis": AXIS},
        mqtt_version=version,
    )
    edge.declare_device("okuma", OKUMA_METRICS)
    return edge


def _say(broker: Mosquitto, topic: str, payload: bytes, *, retain: bool = False) -> None:
    """Publish as somebody else, past the proxy."""
    paho.mqtt.publish.single(topic, payload, qos=1, retain=retain, hostname="127.0.0.1", port=broker.port)


def _live(mosquitto: Mosquitto, proxy: Proxy, version: int, file: Path) -> None:
    """Birth, data, a device that comes and goes, a rebirth, a cut, the next birth, and the end."""
    edge = _edge(proxy, version=version, file=file)
    edge.start()
    proxy.wait_for(_on("DBIRTH/edge-okuma/okuma"))
    edge.publish(None, [change("health/lag", 5, EPOCH_MS)])
    edge.publish("okuma", [change("tool_number", 5, EPOCH_MS)])
    edge.declare_device("probe", PROBE_METRICS)
    edge.remove_device("probe")
    proxy.wait_for(_on("DDEATH"))
    _say(mosquitto, "spBv1.0/cnc/NCMD/edge-okuma", encode(Payload(EPOCH_MS, (Metric(REBIRTH, True, DataType.BOOLEAN),))))
    proxy.wait_for(_on("DBIRTH/edge-okuma/okuma"), count=2)
    proxy.cut()
    proxy.wait_for(_on("DBIRTH/edge-okuma/okuma"), count=3)
    edge.stop()
    proxy.wait_for(lambda packet: isinstance(packet, Disconnect))


@pytest.fixture(scope="module")
def new_broker() -> Callable[[], AbstractContextManager[Mosquitto]]:
    """At which broker the lives are lived; tests/hivemq has another one."""
    return Mosquitto


@pytest.fixture(scope="module")
def lives(
    way: str, tmp_path_factory: pytest.TempPathFactory, new_broker: Callable[[], AbstractContextManager[Mosquitto]]
) -> Iterator[dict[int, Proxy]]:
    """The recordings of the same life with MQTT 3.1.1 (4) and with MQTT 5."""
    with new_broker() as broker, Proxy(broker.address) as with_311, Proxy(broker.address) as with_5:
        recordings = {4: with_311, 5: with_5}
        for version, proxy in recordings.items():
            _live(broker, proxy, version, tmp_path_factory.mktemp("edge") / "session.json")
        yield recordings


both = pytest.mark.parametrize("version", [4, 5], ids=["MQTT 3.1.1", "MQTT 5"])


@pytest.mark.tck("tck-id-principles-persistence-clean-session-311")
def test_with_mqtt_311_the_session_is_clean(lives: dict[int, Proxy]) -> None:
    connects = lives[4].packets("up", Connect)
    assert [(connect.version, connect.clean) for connect in connects] == [(4, True), (4, True)]


@pytest.mark.tck("tck-id-principles-persistence-clean-session-50")
def test_with_mqtt_5_the_start_is_clean_and_the_session_ends_with_the_connection(lives: dict[int, Proxy]) -> None:
    connects = lives[5].packets("up", Connect)
    assert [(connect.version, connect.clean) for connect in connects] == [(5, True), (5, True)]
    assert all(dict(connect.properties).get("session_expiry_interval", 0) == 0 for connect in connects)


@both
@pytest.mark.tck(
    "tck-id-topics-ndeath-topic",
    "tck-id-message-flow-edge-node-birth-publish-will-message",
    "tck-id-message-flow-edge-node-birth-publish-will-message-topic",
    "tck-id-message-flow-edge-node-birth-publish-will-message-payload",
    "tck-id-message-flow-edge-node-birth-publish-will-message-qos",
    "tck-id-message-flow-edge-node-birth-publish-will-message-will-retained",
    "tck-id-payloads-ndeath-will-message",
    "tck-id-payloads-ndeath-will-message-qos",
    "tck-id-payloads-ndeath-will-message-retain",
)
def test_the_will_stands_in_the_connect(lives: dict[int, Proxy], version: int) -> None:
    for connect in lives[version].packets("up", Connect):
        assert connect.will is not None
        assert (connect.will.topic, connect.will.qos, connect.will.retain) == (NDEATH, 1, False)
        assert [metric.name for metric in parse(connect.will.payload).metrics] == ["bdSeq"]


@both
@pytest.mark.tck(
    "tck-id-topics-nbirth-bdseq-matching",
    "tck-id-topics-nbirth-bdseq-increment",
    "tck-id-message-flow-edge-node-birth-publish-will-message-payload-bdSeq",
    "tck-id-message-flow-edge-node-birth-publish-nbirth-payload-bdSeq",
    "tck-id-payloads-nbirth-bdseq-repeat",
    "tck-id-operational-behavior-data-commands-rebirth-action-3",
)
def test_each_connect_has_the_next_bdseq_and_the_births_on_it_repeat_it(lives: dict[int, Proxy], version: int) -> None:
    for number, births in ((0, 2), (1, 1)):
        (connect,) = lives[version].packets("up", Connect, connection=number)
        assert connect.will is not None
        assert parse(connect.will.payload).metrics[0].long_value == number
        found = [p for p in lives[version].packets("up", Publish, connection=number) if "NBIRTH" in p.topic]
        assert len(found) == births
        for birth in found:
            assert next(m for m in parse(birth.payload).metrics if m.name == "bdSeq").long_value == number


@both
@pytest.mark.tck(
    "tck-id-message-flow-edge-node-birth-publish-connect",
    "tck-id-message-flow-edge-node-ncmd-subscribe",
    "tck-id-message-flow-device-dcmd-subscribe",
    "tck-id-principles-birth-certificates-order",
    "tck-id-payloads-dbirth-order",
)
def test_after_the_connack_come_the_subscriptions_and_then_the_births(lives: dict[int, Proxy], version: int) -> None:
    proxy = lives[version]
    for number in (0, 1):
        up = proxy.packets("up", connection=number)
        subscribed = [f for packet in up if isinstance(packet, Subscribe) for f in packet.filters]
        assert subscribed[:2] == [("spBv1.0/cnc/NCMD/edge-okuma", 1), ("spBv1.0/cnc/DCMD/edge-okuma/okuma", 1)]
        assert [type(packet) for packet in up[:5]] == [Connect, Subscribe, Subscribe, Publish, Publish]
        topics = [packet.topic for packet in up if isinstance(packet, Publish)]
        assert topics[:2] == ["spBv1.0/cnc/NBIRTH/edge-okuma", "spBv1.0/cnc/DBIRTH/edge-okuma/okuma"]
        of_connection = [seen for seen in proxy.recorded if seen.connection == number]
        accepted = next(seen.at_s for seen in of_connection if isinstance(seen.packet, Connack))
        assert accepted < next(seen.at_s for seen in of_connection if isinstance(seen.packet, Publish))


@both
@pytest.mark.tck(
    "tck-id-topics-nbirth-mqtt",
    "tck-id-topics-dbirth-mqtt",
    "tck-id-topics-ndata-mqtt",
    "tck-id-topics-ddata-mqtt",
    "tck-id-topics-ddeath-mqtt",
)
def test_everything_but_the_death_of_the_node_goes_with_qos_0_and_nothing_is_retained(
    lives: dict[int, Proxy], version: int
) -> None:
    published = lives[version].packets("up", Publish)
    verbs = {packet.topic.split("/")[2] for packet in published}
    assert verbs == {"NBIRTH", "DBIRTH", "NDATA", "DDATA", "DDEATH", "NDEATH"}
    for packet in published:
        assert packet.retain is False
        assert packet.qos == (1 if "NDEATH" in packet.topic else 0)
        assert packet.duplicate is False


@both
@pytest.mark.tck("tck-id-payloads-sequence-num-incrementing")
def test_the_sequence_numbers_go_up_in_the_order_of_the_wire(lives: dict[int, Proxy], version: int) -> None:
    expected = 0
    for packet in lives[version].packets("up", Publish):
        if "NDEATH" not in packet.topic:
            expected = 0 if "NBIRTH" in packet.topic else expected + 1
            assert parse(packet.payload).seq == expected


@pytest.mark.tck(
    "tck-id-operational-behavior-edge-node-intentional-disconnect-ndeath",
    "tck-id-operational-behavior-edge-node-intentional-disconnect-packet",
    "tck-id-payloads-ndeath-will-message-publisher",
    "tck-id-payloads-ndeath-will-message-publisher-disconnect-mqtt311",
)
def test_with_mqtt_311_the_death_goes_directly_before_the_disconnect(lives: dict[int, Proxy]) -> None:
    *_, death, disconnect = lives[4].packets("up")
    assert isinstance(death, Publish)
    assert (death.topic, parse(death.payload).metrics[0].long_value) == (NDEATH, 1)
    assert isinstance(disconnect, Disconnect)


@pytest.mark.tck(
    "tck-id-operational-behavior-edge-node-intentional-disconnect-ndeath",
    "tck-id-operational-behavior-edge-node-intentional-disconnect-packet",
    "tck-id-payloads-ndeath-will-message-publisher-disconnect-mqtt50",
)
def test_with_mqtt_5_the_disconnect_asks_for_the_will_too(lives: dict[int, Proxy]) -> None:
    *_, death, disconnect = lives[5].packets("up")
    assert isinstance(death, Publish)
    assert death.topic == NDEATH
    assert isinstance(disconnect, Disconnect)
    assert disconnect.reason == 0x04


@both
@pytest.mark.tck("tck-id-payloads-ndeath-bdseq")
def test_a_cut_connection_makes_the_broker_publish_the_death_with_the_bdseq_of_the_birth(
    mosquitto: Mosquitto, proxy: Proxy, version: int
) -> None:
    with Proxy(mosquitto.address) as watched:
        host = HostApplication(BrokerAddress(port=watched.port), HOST_ID)
        host.start()
        while not watched.packets("down", Suback):
            host.poll(0.05)
        edge = _edge(proxy, version=version)
        edge.start()
        proxy.wait_for(_on("DBIRTH"))
        proxy.cut()
        (death,) = watched.wait_for(_on(NDEATH))
        assert isinstance(death.packet, Publish)
        birth = next(p for p in proxy.packets("up", Publish) if "NBIRTH" in p.topic)
        bd_seq = next(m.long_value for m in parse(birth.payload).metrics if m.name == "bdSeq")
        assert parse(death.packet.payload).metrics[0].long_value == bd_seq
        edge.stop()
        host.stop()


@pytest.mark.tck(
    "tck-id-topics-nbirth-bdseq-increment",
    "tck-id-message-flow-edge-node-birth-publish-will-message-payload-bdSeq",
)
def test_attempts_that_find_no_broker_use_up_no_bdseq(proxy: Proxy) -> None:
    proxy.refuse()
    edge = _edge(proxy, version=4)
    edge.start()
    time.sleep(1.0)
    proxy.accept()
    (connect,) = proxy.wait_for(lambda packet: isinstance(packet, Connect))
    edge.stop()
    assert isinstance(connect.packet, Connect)
    assert connect.packet.will is not None
    assert parse(connect.packet.will.payload).metrics[0].long_value == 0


@both
def test_a_restarted_program_goes_on_with_the_next_bdseq(proxy: Proxy, tmp_path: Path, version: int) -> None:
    for run in range(3):
        edge = _edge(proxy, version=version, file=tmp_path / "session.json")
        edge.start()
        proxy.wait_for(_on("DBIRTH"), count=run + 1)
        edge.stop()
    wills = [connect.will for connect in proxy.packets("up", Connect)]
    assert [parse(will.payload).metrics[0].long_value for will in wills if will is not None] == [0, 1, 2]


@both
def test_a_message_that_the_network_cut_in_two_is_followed_by_a_whole_new_birth(proxy: Proxy, version: int) -> None:
    edge = _edge(proxy, version=version)
    edge.start()
    proxy.wait_for(_on("DBIRTH"))
    proxy.cut_when(_on("DDATA"), bytes_passed=20)
    edge.publish("okuma", [change("tool_number", 7, EPOCH_MS)])
    birth = proxy.wait_for(_on("DBIRTH"), count=2)[1].packet
    edge.stop()
    assert isinstance(birth, Publish)
    tool = next(metric for metric in parse(birth.payload).metrics if metric.name == "tool_number")
    assert tool.int_value == 7


def test_different_nodes_and_hosts_have_different_client_ids(proxy: Proxy) -> None:
    clients: list[EdgeNode | HostApplication] = [
        EdgeNode(BrokerAddress(port=proxy.port), NodeId("a-b", "c")),
        EdgeNode(BrokerAddress(port=proxy.port), NodeId("a", "b-c")),
        EdgeNode(BrokerAddress(port=proxy.port), NodeId("host", "x")),
        HostApplication(BrokerAddress(port=proxy.port), "x"),
    ]
    for client in clients:
        client.start()
        connects = proxy.wait_for(lambda packet: isinstance(packet, Connect), count=clients.index(client) + 1)
        client.stop()
    names = [seen.packet.client_id for seen in connects if isinstance(seen.packet, Connect)]
    assert len(set(names)) == len(clients)


@both
@pytest.mark.tck(
    "tck-id-message-flow-edge-node-birth-publish-phid-wait",
    "tck-id-message-flow-edge-node-birth-publish-phid-offline",
    "tck-id-operational-behavior-edge-node-birth-sequence-wait",
    "tck-id-operational-behavior-edge-node-termination-host-offline-reconnect",
)
def test_a_node_waits_connected_and_dies_once_each_time_its_host_goes(mosquitto: Mosquitto, proxy: Proxy, version: int) -> None:
    _say(mosquitto, STATE, HostState(False, 1000).encode(), retain=True)
    edge = _edge(proxy, version=version, primary_host=HOST_ID)
    edge.start()
    for number in range(3):
        stamp_ms = 1000 + 10 * number
        proxy.wait_for(lambda packet: isinstance(packet, Publish) and packet.topic == STATE and packet.retain, count=number + 1)
        for later_ms in range(1, 5):
            _say(mosquitto, STATE, HostState(False, stamp_ms + later_ms).encode(), retain=True)
        _say(mosquitto, STATE, HostState(True, stamp_ms + 5).encode(), retain=True)
        proxy.wait_for(_on("DBIRTH"), count=number + 1)
        _say(mosquitto, STATE, HostState(False, stamp_ms + 10).encode(), retain=True)
        proxy.wait_for(lambda packet: isinstance(packet, Connect), count=number + 2)
    edge.stop()
    for number in range(3):
        published = [p.topic.split("/")[2] for p in proxy.packets("up", Publish, connection=number)]
        assert published == ["NBIRTH", "DBIRTH", "NDEATH"]
    assert len(proxy.packets("up", Connect)) == 4


@pytest.fixture
def brokers() -> Iterator[tuple[tuple[Mosquitto, Proxy], tuple[Mosquitto, Proxy]]]:
    """Two brokers that know nothing of each other, each behind a proxy."""
    with Mosquitto() as first, Mosquitto() as second, Proxy(first.address) as one, Proxy(second.address) as two:
        yield (first, one), (second, two)


Brokers = tuple[tuple[Mosquitto, Proxy], tuple[Mosquitto, Proxy]]


def _walk(brokers: Brokers, version: int) -> None:
    """The primary host is online on the second broker only, then on the first one only."""
    (first, one), (second, two) = brokers
    _say(first, STATE, HostState(False, 1000).encode(), retain=True)
    _say(second, STATE, HostState(True, 1000).encode(), retain=True)
    edge = _edge(one, two, version=version, primary_host=HOST_ID)
    edge.start()
    two.wait_for(_on("DBIRTH"))
    _say(first, STATE, HostState(True, 2000).encode(), retain=True)
    _say(second, STATE, HostState(False, 2000).encode(), retain=True)
    one.wait_for(_on("DBIRTH"))
    edge.stop()
    one.wait_for(lambda packet: isinstance(packet, Disconnect), count=2)


@both
@pytest.mark.tck(
    "tck-id-operational-behavior-primary-application-state-with-multiple-servers-walk",
    "tck-id-operational-behavior-primary-application-state-with-multiple-servers-single-server",
    "tck-id-operational-behavior-edge-node-birth-sequence-wait",
    "tck-id-operational-behavior-edge-node-termination-host-offline-reconnect",
    "tck-id-message-flow-edge-node-birth-publish-phid-wait",
    "tck-id-message-flow-edge-node-birth-publish-phid-offline",
)
def test_a_node_walks_to_the_broker_where_its_primary_host_is_and_is_never_on_two(brokers: Brokers, version: int) -> None:
    _walk(brokers, version)
    (_, one), (_, two) = brokers
    assert [type(p).__name__ for p in one.packets("up", connection=0)][:1] == ["Connect"]
    assert not any("BIRTH" in p.topic for p in one.packets("up", Publish, connection=0))
    assert [p.topic for p in two.packets("up", Publish)][-1] == NDEATH
    assert isinstance(two.packets("up")[-1], Disconnect)
    spans_s = sorted(_span_s(proxy.recorded, number) for proxy, number in ((one, 0), (two, 0), (one, 1)))
    assert spans_s[0][1] < spans_s[1][0]
    assert spans_s[1][1] < spans_s[2][0]


@pytest.mark.tck("tck-id-payloads-ndeath-will-message-publisher-disconnect-mqtt50")
def test_with_mqtt_5_the_disconnect_of_a_walk_asks_for_the_will_too(brokers: Brokers) -> None:
    _walk(brokers, version=5)
    (_, one), (_, two) = brokers
    assert [d.reason for d in (*one.packets("up", Disconnect), *two.packets("up", Disconnect))] == [4, 4, 4]


@pytest.mark.tck("tck-id-payloads-ndeath-will-message-publisher-disconnect-mqtt311")
def test_with_mqtt_311_a_death_goes_before_the_disconnect_of_every_walk(brokers: Brokers) -> None:
    _walk(brokers, version=4)
    (_, one), (_, two) = brokers
    for proxy, number in ((one, 0), (two, 0), (one, 1)):
        # Acknowledgements of what the broker sent may stand anywhere.
        sent = [p for p in proxy.packets("up", connection=number) if not isinstance(p, Acknowledgement)]
        *_, death, disconnect = sent
        assert isinstance(disconnect, Disconnect)
        assert isinstance(death, Publish)


def _span_s(recorded: list[Recorded], connection: int) -> tuple[float, float]:
    """When a connection began and when its client said the last word."""
    times_s = [seen.at_s for seen in recorded if seen.connection == connection and seen.direction == "up"]
    return times_s[0], times_s[-1]
