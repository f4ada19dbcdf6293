"""What store-and-forward rests on: a broker takes the packets of a connection in order, so that the acknowledgement of a QoS 1
publish says that all QoS 0 publishes before it have been taken. Held against both brokers.

What a third party sees is another matter: MQTT keeps the order of one topic and QoS only, and HiveMQ lets QoS 1 go another way.
"""

import pytest

from sparkplug.broker import BrokerAddress
from tests.deploy.plant import with_version
from tests.deploy.wire_client import WireClient
from tests.wire.mosquitto import Mosquitto

pytestmark = pytest.mark.broker
DATA, BARRIER = "spBv1.0/cnc/DDATA/edge-okuma/okuma", "cnctwin/barrier/cnc/edge-okuma"
BATCHES, A_BATCH = 10, 200


@pytest.fixture(params=["Mosquitto", "HiveMQ"])
def address(request: pytest.FixtureRequest) -> BrokerAddress:
    """Each broker."""
    if request.param == "HiveMQ":
        return BrokerAddress(*request.getfixturevalue("hivemq").address)
    broker: Mosquitto = request.getfixturevalue("real_mosquitto")
    return BrokerAddress(*broker.address)


@pytest.fixture
def real_mosquitto(mosquitto_program: str) -> object:
    """Mosquitto, which in this folder goes by another name."""
    assert mosquitto_program
    with Mosquitto() as broker:
        yield broker


def batches() -> list[tuple[str, bytes]]:
    """Data at QoS 0, and a barrier at QoS 1 behind each batch."""
    sent: list[tuple[str, bytes]] = []
    for batch in range(BATCHES):
        sent += [(DATA, b"%d %d" % (batch, number)) for number in range(A_BATCH)]
        sent.append((BARRIER, b"%d" % batch))
    return sent


@pytest.mark.parametrize("version", [4, 5], ids=["MQTT 3.1.1", "MQTT 5"])
def test_everything_arrives_once_and_each_topic_in_its_order(address: BrokerAddress, version: int) -> None:
    sent = batches()
    with WireClient(address) as reader, WireClient(with_version(address, version)) as edge:
        reader.subscribe(DATA, BARRIER)
        for topic, payload in sent:
            edge.publish(topic, payload, qos=1 if topic == BARRIER else 0)
        reader.until(lambda: len(reader.received) >= len(sent), "everything")
    for wanted in (DATA, BARRIER):
        assert [message for message in reader.received if message[0] == wanted] == [m for m in sent if m[0] == wanted]


def test_mosquitto_keeps_the_order_over_all_topics(real_mosquitto: Mosquitto) -> None:
    sent = batches()
    with WireClient(BrokerAddress(*real_mosquitto.address)) as reader, WireClient(BrokerAddress(*real_mosquitto.address)) as edge:
        reader.subscribe(DATA, BARRIER)
        for topic, payload in sent:
            edge.publish(topic, payload, qos=1 if topic == BARRIER else 0)
        reader.until(lambda: len(reader.received) >= len(sent), "everything")
    assert reader.received == sent


@pytest.mark.parametrize("version", [4, 5], ids=["MQTT 3.1.1", "MQTT 5"])
def test_what_goes_before_an_acknowledged_barrier_arrives_although_the_edge_is_cut_off_at_once(
    address: BrokerAddress, version: int
) -> None:
    with WireClient(address) as reader:
        reader.subscribe(DATA)
        edge = WireClient(with_version(address, version))
        edge.__enter__()
        for number in range(A_BATCH):
            edge.publish(DATA, b"%d" % number, qos=0)
        edge.settle(edge.publish(BARRIER, b""))
        edge.cut()
        reader.until(lambda: len(reader.received) >= A_BATCH, "all of the batch")
    assert [int(payload) for _, payload in reader.received] == list(range(A_BATCH))
