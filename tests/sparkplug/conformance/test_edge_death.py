"""The will of an edge node, its NDEATH, and how it disconnects (4.2, 5.4 and 6.4.25); the wire itself is in test_edge_wire."""

import pytest

from sparkplug.actions import Disconnect, HostState, Publish, WalkToNextServer
from sparkplug.codec import parse
from sparkplug.edge_session import EdgeNodeSession
from tests.sparkplug.conformance.life import NODE, NODE_METRICS, STATE_TOPIC, EdgeLife


@pytest.mark.tck(
    "tck-id-topics-ndeath-topic",
    "tck-id-message-flow-edge-node-birth-publish-will-message",
    "tck-id-message-flow-edge-node-birth-publish-will-message-topic",
    "tck-id-message-flow-edge-node-birth-publish-will-message-qos",
    "tck-id-message-flow-edge-node-birth-publish-will-message-will-retained",
    "tck-id-payloads-ndeath-will-message",
    "tck-id-payloads-ndeath-will-message-qos",
    "tck-id-payloads-ndeath-will-message-retain",
)
def test_every_connect_registers_the_ndeath_as_its_will(life: EdgeLife) -> None:
    assert len(life.connects) == 3
    for connect in life.connects:
        assert connect.will.topic == "spBv1.0/cnc/NDEATH/edge-okuma"
        assert connect.will.qos == 1
        assert connect.will.retain is False


@pytest.mark.tck(
    "tck-id-topics-ndeath-payload",
    "tck-id-topics-ndeath-seq",
    "tck-id-payloads-ndeath-seq",
    "tck-id-message-flow-edge-node-birth-publish-will-message-payload",
)
def test_an_ndeath_carries_bdseq_and_nothing_else(life: EdgeLife) -> None:
    deaths = life.deaths()
    assert len(deaths) == 5
    for payload in deaths:
        assert [metric.name for metric in payload.metrics] == ["bdSeq"]
        assert not payload.HasField("seq")
        assert parse(payload.SerializeToString()) == payload


@pytest.mark.tck("tck-id-topics-ndeath-topic")
def test_a_published_ndeath_has_the_topic_of_the_will(life: EdgeLife) -> None:
    topics = {sent.raw.topic for sent in life.sent if "NDEATH" in sent.raw.topic}
    assert topics == {"spBv1.0/cnc/NDEATH/edge-okuma"}


@pytest.mark.tck(
    "tck-id-operational-behavior-edge-node-intentional-disconnect-ndeath",
    "tck-id-operational-behavior-edge-node-intentional-disconnect-packet",
    "tck-id-payloads-ndeath-will-message-publisher",
    "tck-id-payloads-ndeath-will-message-publisher-disconnect-mqtt311",
    "tck-id-payloads-ndeath-will-message-publisher-disconnect-mqtt50",
)
def test_a_node_that_ends_by_its_own_will_publishes_its_death_and_disconnects_with_the_will(edge: EdgeLife) -> None:
    death, disconnect = edge.session.close(edge.now_ms)
    assert isinstance(death, Publish)
    assert death.topic == edge.connects[-1].will.topic
    assert disconnect == Disconnect(with_will=True)


@pytest.mark.tck("tck-id-payloads-ndeath-will-message-publisher-disconnect-mqtt311")
def test_a_node_that_was_not_born_yet_publishes_its_death_too_before_it_disconnects() -> None:
    edge = EdgeLife(EdgeNodeSession(NODE, NODE_METRICS, primary_host="scada"))
    assert edge.connect(bd_seq=0) == []
    death, disconnect = edge.session.close(edge.now_ms)
    assert isinstance(death, Publish)
    assert isinstance(disconnect, Disconnect)


@pytest.mark.tck("tck-id-payloads-ndeath-will-message-publisher-disconnect-mqtt311")
def test_a_node_that_walks_on_before_its_birth_publishes_its_death() -> None:
    edge = EdgeLife(EdgeNodeSession(NODE, NODE_METRICS, primary_host="scada", servers=2))
    edge.connect(bd_seq=0)
    actions = edge.session.message(STATE_TOPIC, HostState(False, 5).encode(), edge.now_ms)
    assert [type(action) for action in actions] == [Publish, WalkToNextServer]


def test_nothing_is_published_after_the_end(edge: EdgeLife) -> None:
    edge.close()
    assert edge.session.close(edge.now_ms) == []
    assert edge.rebirth() == []
