"""The data of a device (4.2.2.2 and 6.4.22)."""

import pytest

from sparkplug.topics import Verb
from tests.sparkplug.conformance.life import EdgeLife, change


@pytest.mark.tck("tck-id-topics-ddata-topic")
def test_the_topic_names_the_device(life: EdgeLife) -> None:
    topics = {f"spBv1.0/cnc/DDATA/edge-okuma/{device}" for device in ("okuma", "probe")}
    assert {sent.raw.topic for sent in life.of(Verb.DDATA)} == topics


@pytest.mark.tck("tck-id-topics-ddata-mqtt", "tck-id-payloads-ddata-qos", "tck-id-payloads-ddata-retain")
def test_it_is_published_with_qos_0_and_not_retained(life: EdgeLife) -> None:
    assert {(sent.raw.qos, sent.raw.retain) for sent in life.of(Verb.DDATA)} == {(0, False)}


@pytest.mark.tck("tck-id-topics-ddata-seq-num", "tck-id-payloads-ddata-seq", "tck-id-payloads-ddata-seq-inc")
def test_its_sequence_number_is_one_more_than_that_of_the_message_before(life: EdgeLife) -> None:
    followed = set()
    for before, sent in zip(life.sent, life.sent[1:], strict=False):
        if sent.verb is Verb.DDATA:
            assert sent.payload.HasField("seq")
            assert sent.payload.seq == (before.payload.seq + 1) % 256
            followed.add(before.payload.seq)
    assert len(followed) > 50


@pytest.mark.tck("tck-id-topics-ddata-seq-num", "tck-id-payloads-ddata-seq-inc")
def test_zero_comes_after_255(edge: EdgeLife) -> None:
    numbers = [edge.publish("okuma", change("tool_number", value, edge.now_ms))[0].payload.seq for value in range(300)]
    assert numbers[0] == edge.sent[-301].payload.seq + 1
    assert numbers == [(numbers[0] + index) % 256 for index in range(300)]


@pytest.mark.tck("tck-id-topics-ddata-timestamp", "tck-id-payloads-ddata-timestamp")
def test_it_says_when_it_was_sent(life: EdgeLife) -> None:
    assert life.of(Verb.DDATA)
    assert [sent.payload.timestamp for sent in life.of(Verb.DDATA)] == [sent.at_ms for sent in life.of(Verb.DDATA)]


@pytest.mark.tck("tck-id-topics-ddata-payload")
def test_it_carries_what_has_changed_and_nothing_else(edge: EdgeLife) -> None:
    birth = next(sent for sent in edge.rebirth() if sent.topic.device == "okuma")
    (one,) = edge.publish("okuma", change("spindle_load", 5.0, edge.now_ms))
    (both,) = edge.publish("okuma", change("spindle_load", None, edge.now_ms), change("tool_number", -3, edge.now_ms))
    load, tool = birth.metric("spindle_load").alias, birth.metric("tool_number").alias
    assert [(metric.alias, metric.double_value) for metric in one.payload.metrics] == [(load, 5.0)]
    assert [(metric.alias, metric.is_null) for metric in both.payload.metrics] == [(load, True), (tool, False)]
    assert both.payload.metrics[1].int_value == 2**32 - 3


@pytest.mark.tck("tck-id-payloads-ddata-order")
def test_it_waits_for_all_births(life: EdgeLife) -> None:
    for number in range(len(life.connects)):
        verbs = [sent.verb for sent in life.sent if sent.session == number]
        first = min(verbs.index(Verb.NDATA) if Verb.NDATA in verbs else len(verbs), verbs.index(Verb.DDATA))
        assert verbs[:first] == [Verb.NBIRTH] + [Verb.DBIRTH] * (first - 1)
        assert first > 1


@pytest.mark.tck("tck-id-payloads-ddata-order")
def test_it_is_not_sent_where_nothing_is_born(edge: EdgeLife) -> None:
    edge.lose()
    assert edge.publish("okuma", change("tool_number", 5, edge.now_ms)) == []
    births = edge.connect(bd_seq=4)
    assert {sent.verb for sent in births} == {Verb.NBIRTH, Verb.DBIRTH}
