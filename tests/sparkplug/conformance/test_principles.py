"""Sessions, order and report by exception (chapter 2 and 5.4); clean sessions are shown in test_edge_wire."""

import pytest

from sparkplug.actions import Connect, Publish, Subscribe
from sparkplug.edge_session import EdgeNodeSession
from sparkplug.topics import Verb
from tests.sparkplug.conformance.life import EPOCH_MS, NODE, NODE_METRICS, PROBE_METRICS, STATE_TOPIC, EdgeLife, HostLife, change


@pytest.mark.tck("tck-id-principles-rbe-recommended")
def test_without_changes_nothing_is_sent_however_long_it_lasts(edge: EdgeLife) -> None:
    for _ in range(24 * 60):
        assert edge.wait(60_000) == []
    assert edge.publish("okuma") == []
    assert len(edge.publish("okuma", change("tool_number", 1, edge.now_ms))) == 1


@pytest.mark.tck("tck-id-principles-birth-certificates-order")
def test_the_first_message_of_an_edge_node_on_each_connection_is_its_birth(life: EdgeLife) -> None:
    for number in range(len(life.connects)):
        first = next(sent for sent in life.sent if sent.session == number)
        assert first.verb is Verb.NBIRTH


@pytest.mark.tck("tck-id-principles-birth-certificates-order")
def test_the_first_message_of_a_host_on_each_connection_is_its_birth(host: HostLife, life: EdgeLife) -> None:
    for _ in range(2):
        host.connect()
        host.receive(*life.of(Verb.DDATA)[:1])
        host.wait(5000)
        published = [action for action in host.actions if isinstance(action, Publish)]
        assert published[0].topic == STATE_TOPIC
        assert b'"online":true' in published[0].payload
        host.session.lost(host.now_ms)
        host.take()
        host.actions.clear()


@pytest.mark.tck("tck-id-principles-birth-certificates-order", "tck-id-message-flow-phid-sparkplug-subscription")
def test_what_a_host_could_not_send_any_more_does_not_go_before_its_next_birth(host: HostLife) -> None:
    host.connect()
    host.session.message(STATE_TOPIC, b'{"online":false,"timestamp":1}', host.now_ms)
    host.session.lost(host.now_ms)
    host.now_ms += 1000
    actions = host.connect()
    assert [type(action) for action in actions] == [Subscribe, Subscribe, Publish]


@pytest.mark.tck("tck-id-message-flow-edge-node-birth-publish-connect")
def test_nothing_is_published_before_the_broker_has_accepted_the_connection() -> None:
    edge = EdgeLife(EdgeNodeSession(NODE, NODE_METRICS, now_ms=EPOCH_MS))
    edge.declare("probe", PROBE_METRICS)
    edge.publish(None, change("health/lag", 1, EPOCH_MS))
    edge.wait(60_000)
    assert isinstance(edge.session.connecting(0, edge.now_ms), Connect)
    edge.publish("probe", change("temperature", 1.0, EPOCH_MS))
    edge.declare("second", PROBE_METRICS)
    edge.rebirth()
    assert edge.log == []
    sent = edge.take(edge.session.connected(edge.now_ms))
    assert [message.verb for message in sent] == [Verb.NBIRTH, Verb.DBIRTH, Verb.DBIRTH]
