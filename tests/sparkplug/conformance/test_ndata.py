"""The data of an edge node (4.2.1.2 and 6.4.21)."""

import pytest

from sparkplug.topics import Verb
from tests.sparkplug.conformance.life import EdgeLife, change


@pytest.mark.tck("tck-id-topics-ndata-topic")
def test_the_topic_names_the_node(life: EdgeLife) -> None:
    assert {sent.raw.topic for sent in life.of(Verb.NDATA)} == {"spBv1.0/cnc/NDATA/edge-okuma"}


@pytest.mark.tck("tck-id-topics-ndata-mqtt", "tck-id-payloads-ndata-qos", "tck-id-payloads-ndata-retain")
def test_it_is_published_with_qos_0_and_not_retained(life: EdgeLife) -> None:
    assert {(sent.raw.qos, sent.raw.retain) for sent in life.of(Verb.NDATA)} == {(0, False)}


@pytest.mark.tck("tck-id-topics-ndata-seq-num", "tck-id-payloads-ndata-seq", "tck-id-payloads-ndata-seq-inc")
def test_its_sequence_number_is_one_more_than_that_of_the_message_before(life: EdgeLife) -> None:
    followed = set()
    for before, sent in zip(life.sent, life.sent[1:], strict=False):
        if sent.verb is Verb.NDATA:
            assert sent.payload.HasField("seq")
            assert sent.payload.seq == (before.payload.seq + 1) % 256
            followed.add(before.payload.seq)
    assert len(followed) > 50


@pytest.mark.tck("tck-id-topics-ndata-seq-num", "tck-id-payloads-ndata-seq-inc")
def test_zero_comes_after_255(edge: EdgeLife) -> None:
    numbers = [edge.publish(None, change("health/lag", value, edge.now_ms))[0].payload.seq for value in range(300)]
    assert numbers[0] == edge.sent[-301].payload.seq + 1
    assert numbers == [(numbers[0] + index) % 256 for index in range(300)]


@pytest.mark.tck("tck-id-topics-ndata-timestamp", "tck-id-payloads-ndata-timestamp")
def test_it_says_when_it_was_sent(life: EdgeLife) -> None:
    assert life.of(Verb.NDATA)
    assert [sent.payload.timestamp for sent in life.of(Verb.NDATA)] == [sent.at_ms for sent in life.of(Verb.NDATA)]


@pytest.mark.tck("tck-id-topics-ndata-payload")
def test_it_carries_what_has_changed_and_nothing_else(edge: EdgeLife) -> None:
    births = edge.rebirth()
    (one,) = edge.publish(None, change("health/lag", 5, edge.now_ms))
    (both,) = edge.publish(None, change("health/lag", 6, edge.now_ms), change("health/agent", "up", edge.now_ms))
    lag, agent = births[0].metric("health/lag").alias, births[0].metric("health/agent").alias
    assert [(metric.alias, metric.long_value) for metric in one.payload.metrics] == [(lag, 5)]
    assert [metric.alias for metric in both.payload.metrics] == [lag, agent]
    assert both.payload.metrics[1].string_value == "up"


@pytest.mark.tck("tck-id-payloads-ndata-order")
def test_it_waits_for_all_births(life: EdgeLife) -> None:
    for number in range(len(life.connects)):
        verbs = [sent.verb for sent in life.sent if sent.session == number]
        first = min(verbs.index(Verb.NDATA) if Verb.NDATA in verbs else len(verbs), verbs.index(Verb.DDATA))
        assert verbs[:first] == [Verb.NBIRTH] + [Verb.DBIRTH] * (first - 1)
        assert first > 1


@pytest.mark.tck("tck-id-payloads-ndata-order")
def test_it_is_not_sent_where_nothing_is_born(edge: EdgeLife) -> None:
    edge.lose()
    assert edge.publish(None, change("health/lag", 5, edge.now_ms)) == []
    births = edge.connect(bd_seq=4)
    assert {sent.verb for sent in births} == {Verb.NBIRTH, Verb.DBIRTH}
