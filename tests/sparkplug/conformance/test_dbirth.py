"""The birth certificate of a device (4.2.2, 5.5, 5.16 and 6.4.20)."""

import pytest

from sparkplug.codec import parse
from sparkplug.errors import UnknownMetricError
from sparkplug.topics import Verb
from tests.sparkplug.conformance.life import OKUMA_METRICS, PROBE_METRICS, EdgeLife, change

DECLARED = {
    "okuma": {spec.name for spec in OKUMA_METRICS},
    "probe": {spec.name for spec in PROBE_METRICS},
}


@pytest.mark.tck("tck-id-topics-dbirth-topic", "tck-id-message-flow-device-birth-publish-dbirth-topic")
def test_the_topic_names_group_node_and_device(life: EdgeLife) -> None:
    topics = {f"spBv1.0/cnc/DBIRTH/edge-okuma/{device}" for device in DECLARED}
    assert {sent.raw.topic for sent in life.of(Verb.DBIRTH)} == topics


@pytest.mark.tck("tck-id-message-flow-device-birth-publish-dbirth-match-edge-node-topic")
def test_group_and_node_are_those_of_the_nbirth_before(life: EdgeLife) -> None:
    node = None
    for sent in life.of(Verb.NBIRTH, Verb.DBIRTH):
        node = sent.topic.node if sent.verb is Verb.NBIRTH else node
        assert sent.topic.node == node


@pytest.mark.tck(
    "tck-id-topics-dbirth-mqtt",
    "tck-id-payloads-dbirth-qos",
    "tck-id-payloads-dbirth-retain",
    "tck-id-message-flow-device-birth-publish-dbirth-qos",
    "tck-id-message-flow-device-birth-publish-dbirth-retained",
)
def test_it_is_published_with_qos_0_and_not_retained(life: EdgeLife) -> None:
    assert {(sent.raw.qos, sent.raw.retain) for sent in life.of(Verb.DBIRTH)} == {(0, False)}


@pytest.mark.tck(
    "tck-id-topics-dbirth-seq",
    "tck-id-payloads-dbirth-seq",
    "tck-id-payloads-dbirth-seq-inc",
    "tck-id-message-flow-device-birth-publish-dbirth-payload-seq",
)
def test_its_sequence_number_is_one_more_than_that_of_the_message_before(edge: EdgeLife) -> None:
    for _ in range(300):
        before = edge.sent[-1].payload
        (sent,) = edge.declare("probe", PROBE_METRICS)
        assert sent.payload.HasField("seq")
        assert sent.payload.seq == (before.seq + 1) % 256
        assert 0 <= sent.payload.seq <= 255


@pytest.mark.tck("tck-id-topics-dbirth-timestamp", "tck-id-payloads-dbirth-timestamp")
def test_it_says_when_it_was_sent(life: EdgeLife) -> None:
    assert [sent.payload.timestamp for sent in life.of(Verb.DBIRTH)] == [sent.at_ms for sent in life.of(Verb.DBIRTH)]


@pytest.mark.tck("tck-id-message-flow-device-birth-publish-dbirth-payload")
def test_its_payload_is_a_sparkplug_payload(life: EdgeLife) -> None:
    for sent in life.of(Verb.DBIRTH):
        assert parse(sent.raw.payload).SerializeToString() == sent.raw.payload


@pytest.mark.tck("tck-id-topics-dbirth-metric-reqs", "tck-id-operational-behavior-data-publish-dbirth")
def test_it_declares_every_metric_that_the_device_ever_sends(life: EdgeLife) -> None:
    declared: dict[str | None, set[int]] = {}
    for sent in life.of(Verb.DBIRTH, Verb.DDATA):
        if sent.verb is Verb.DBIRTH:
            assert set(sent.names) == DECLARED[sent.topic.device or ""]
            declared[sent.topic.device] = {metric.alias for metric in sent.payload.metrics}
        else:
            assert {metric.alias for metric in sent.payload.metrics} <= declared[sent.topic.device]


@pytest.mark.tck("tck-id-topics-dbirth-metric-reqs", "tck-id-operational-behavior-data-publish-dbirth")
def test_a_metric_that_it_does_not_declare_is_never_sent(edge: EdgeLife) -> None:
    with pytest.raises(UnknownMetricError):
        edge.publish("okuma", change("temperature", 1.0, edge.now_ms))
    with pytest.raises(UnknownMetricError):
        edge.publish("no such device", change("temperature", 1.0, edge.now_ms))


@pytest.mark.tck("tck-id-topics-dbirth-metrics")
def test_each_metric_has_name_datatype_and_value(life: EdgeLife) -> None:
    for sent in life.of(Verb.DBIRTH):
        for metric in sent.payload.metrics:
            assert metric.name
            assert metric.HasField("datatype")
            assert (metric.WhichOneof("value") is None) == metric.is_null


@pytest.mark.tck("tck-id-operational-behavior-data-publish-dbirth-values", "tck-id-topics-dbirth-metrics")
def test_each_value_is_the_current_one_or_null(edge: EdgeLife) -> None:
    edge.publish("okuma", change("spindle_load", 77.0, edge.now_ms), change("tool_number", None, edge.now_ms))
    edge.publish("okuma", change("spindle_load", 1.0, edge.now_ms - 90_000, is_historical=True))
    birth = next(sent for sent in edge.rebirth() if sent.topic.device == "okuma")
    load, tool = birth.metric("spindle_load"), birth.metric("tool_number")
    assert (load.double_value, load.is_null) == (77.0, False)
    assert tool.is_null
    assert tool.WhichOneof("value") is None


@pytest.mark.tck("tck-id-operational-behavior-data-publish-dbirth-values")
def test_a_device_that_is_declared_anew_keeps_the_values_that_it_has(edge: EdgeLife) -> None:
    edge.publish("okuma", change("spindle_load", 77.0, edge.now_ms))
    (birth,) = edge.declare("okuma", OKUMA_METRICS[:1])
    assert birth.names == ["spindle_load"]
    assert birth.metric("spindle_load").double_value == 77.0


@pytest.mark.tck("tck-id-operational-behavior-data-publish-dbirth-change")
def test_ddata_is_sent_for_changes_of_the_device_only(edge: EdgeLife) -> None:
    before = len(edge.of(Verb.DDATA))
    edge.publish(None, change("health/lag", 1, edge.now_ms))
    edge.publish("okuma")
    for _ in range(3600):
        edge.wait(1000)
    assert len(edge.of(Verb.DDATA)) == before
    (sent,) = edge.publish("okuma", change("spindle_load", 1.0, edge.now_ms))
    assert (sent.verb, sent.topic.device, len(sent.payload.metrics)) == (Verb.DDATA, "okuma", 1)


@pytest.mark.tck("tck-id-operational-behavior-data-publish-dbirth-order")
def test_the_values_of_a_birth_stand_in_the_order_of_their_times(edge: EdgeLife) -> None:
    edge.publish("okuma", change("tool_number", 1, edge.now_ms))
    edge.publish("okuma", change("spindle_load", 5.0, edge.now_ms + 1))
    birth = next(sent for sent in edge.rebirth() if sent.topic.device == "okuma")
    times_ms = [metric.timestamp for metric in birth.payload.metrics]
    assert times_ms == sorted(times_ms)


def test_the_values_of_ddata_stand_in_the_order_of_their_times(edge: EdgeLife) -> None:
    now_ms = edge.now_ms
    changes = [change("tool_number", number, now_ms - age_ms) for number, age_ms in enumerate((5, 50, 0, 20))]
    (sent,) = edge.publish("okuma", *changes)
    assert [metric.timestamp for metric in sent.payload.metrics] == [now_ms - 50, now_ms - 20, now_ms - 5, now_ms]


@pytest.mark.tck("tck-id-payloads-dbirth-order")
def test_the_devices_are_born_directly_after_their_node_and_before_any_data(life: EdgeLife, edge: EdgeLife) -> None:
    for lived in (life, edge):
        for index, sent in enumerate(lived.sent):
            if sent.verb is Verb.NBIRTH:
                born = [follower.topic.device for follower in lived.sent[index + 1 : index + 3]]
                assert {"okuma"} <= set(born)
    births = edge.rebirth()
    assert [sent.verb for sent in births] == [Verb.NBIRTH] + [Verb.DBIRTH] * len(edge.session.devices())
