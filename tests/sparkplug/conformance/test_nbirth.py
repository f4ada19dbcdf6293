"""The birth certificate of an edge node (4.2.1, 5.3, 5.16 and 6.4.19)."""

import pytest

from sparkplug.codec import parse
from sparkplug.datatype import DataType
from sparkplug.edge_session import EdgeNodeSession
from sparkplug.errors import SparkplugError, UnknownMetricError
from sparkplug.metric import MetricSpec
from sparkplug.topics import Verb
from tests.sparkplug.conformance.life import AXIS, EPOCH_MS, NODE, NODE_METRICS, PROBE_METRICS, EdgeLife, change

CONTROL = {"bdSeq", "Node Control/Rebirth"}


@pytest.mark.tck("tck-id-topics-nbirth-topic", "tck-id-message-flow-edge-node-birth-publish-nbirth-topic")
def test_the_topic_names_group_and_node(life: EdgeLife) -> None:
    assert {sent.raw.topic for sent in life.of(Verb.NBIRTH)} == {"spBv1.0/cnc/NBIRTH/edge-okuma"}


@pytest.mark.tck(
    "tck-id-topics-nbirth-mqtt",
    "tck-id-payloads-nbirth-qos",
    "tck-id-payloads-nbirth-retain",
    "tck-id-message-flow-edge-node-birth-publish-nbirth-qos",
    "tck-id-message-flow-edge-node-birth-publish-nbirth-retained",
)
def test_it_is_published_with_qos_0_and_not_retained(life: EdgeLife) -> None:
    assert {(sent.raw.qos, sent.raw.retain) for sent in life.of(Verb.NBIRTH)} == {(0, False)}


@pytest.mark.tck(
    "tck-id-topics-nbirth-seq-num",
    "tck-id-payloads-nbirth-seq",
    "tck-id-message-flow-edge-node-birth-publish-nbirth-payload-seq",
)
def test_its_sequence_number_is_zero(life: EdgeLife) -> None:
    assert {(sent.payload.HasField("seq"), sent.payload.seq) for sent in life.of(Verb.NBIRTH)} == {(True, 0)}


@pytest.mark.tck("tck-id-topics-nbirth-timestamp", "tck-id-payloads-nbirth-timestamp")
def test_it_says_when_it_was_sent(life: EdgeLife) -> None:
    assert [sent.payload.timestamp for sent in life.of(Verb.NBIRTH)] == [sent.at_ms for sent in life.of(Verb.NBIRTH)]


@pytest.mark.tck("tck-id-message-flow-edge-node-birth-publish-nbirth-payload")
def test_its_payload_is_a_sparkplug_payload(life: EdgeLife) -> None:
    for sent in life.of(Verb.NBIRTH):
        assert parse(sent.raw.payload).SerializeToString() == sent.raw.payload


@pytest.mark.tck("tck-id-topics-nbirth-metric-reqs", "tck-id-operational-behavior-data-publish-nbirth")
def test_it_declares_every_metric_that_the_node_ever_sends(life: EdgeLife) -> None:
    for number in range(len(life.connects)):
        births = [sent for sent in life.of(Verb.NBIRTH) if sent.session == number]
        for birth in births:
            assert set(birth.names) == CONTROL | {"Axis"} | {spec.name for spec in NODE_METRICS}
        declared = {metric.alias for birth in births for metric in birth.payload.metrics if metric.HasField("alias")}
        sent = {m.alias for data in life.of(Verb.NDATA) if data.session == number for m in data.payload.metrics}
        assert sent <= declared
    assert life.of(Verb.NDATA)


@pytest.mark.tck("tck-id-topics-nbirth-metric-reqs", "tck-id-operational-behavior-data-publish-nbirth")
def test_a_metric_that_it_does_not_declare_is_never_sent(edge: EdgeLife) -> None:
    with pytest.raises(UnknownMetricError):
        edge.publish(None, change("spindle_load", 1.0, edge.now_ms))


@pytest.mark.tck("tck-id-topics-nbirth-metrics")
def test_each_metric_has_name_datatype_and_value(life: EdgeLife) -> None:
    for sent in life.of(Verb.NBIRTH):
        for metric in sent.payload.metrics:
            assert metric.name
            assert metric.HasField("datatype")
            assert (metric.WhichOneof("value") is None) == metric.is_null


@pytest.mark.tck("tck-id-operational-behavior-data-publish-nbirth-values", "tck-id-topics-nbirth-metrics")
def test_each_value_is_the_current_one_or_null(edge: EdgeLife) -> None:
    edge.publish(None, change("health/lag", 17, edge.now_ms), change("health/agent", None, edge.now_ms))
    edge.publish(None, change("health/lag", 3, edge.now_ms - 90_000, is_historical=True))
    birth = edge.rebirth()[0]
    lag, agent = birth.metric("health/lag"), birth.metric("health/agent")
    assert (lag.long_value, lag.is_null) == (17, False)
    assert agent.is_null
    assert agent.WhichOneof("value") is None
    edge.lose()
    edge.publish(None, change("health/agent", "down", edge.now_ms))
    birth = edge.connect(bd_seq=4)[0]
    assert birth.metric("health/agent").string_value == "down"
    assert not birth.metric("health/agent").HasField("is_null")


@pytest.mark.tck("tck-id-operational-behavior-data-publish-nbirth-change")
def test_ndata_is_sent_for_changes_of_the_node_only(edge: EdgeLife) -> None:
    before = len(edge.of(Verb.NDATA))
    edge.publish("okuma", change("spindle_load", 1.0, edge.now_ms))
    edge.publish(None)
    for _ in range(3600):
        edge.wait(1000)
    assert len(edge.of(Verb.NDATA)) == before
    edge.publish(None, change("health/lag", 1, edge.now_ms))
    assert len(edge.of(Verb.NDATA)) == before + 1


@pytest.mark.tck("tck-id-operational-behavior-data-publish-nbirth-order")
def test_the_values_of_a_birth_stand_in_the_order_of_their_times(edge: EdgeLife) -> None:
    edge.publish(None, change("health/agent", "up", edge.now_ms))
    edge.publish(None, change("health/lag", 5, edge.now_ms + 1))
    times_ms = [metric.timestamp for metric in edge.rebirth()[0].payload.metrics]
    assert times_ms == sorted(times_ms)


def test_the_values_of_ndata_stand_in_the_order_of_their_times(edge: EdgeLife) -> None:
    now_ms = edge.now_ms
    (sent,) = edge.publish(None, change("health/lag", 5, now_ms), change("health/agent", "up", now_ms - 5))
    assert [metric.timestamp for metric in sent.payload.metrics] == [now_ms - 5, now_ms]


@pytest.mark.tck("tck-id-topics-nbirth-templates")
def test_it_defines_the_templates_that_only_a_device_uses(life: EdgeLife) -> None:
    for sent in life.of(Verb.NBIRTH):
        axis = sent.metric("Axis")
        assert axis.template_value.is_definition
    assert life.of(Verb.DBIRTH)[0].metric("x_axis").template_value.template_ref == "Axis"


@pytest.mark.tck("tck-id-message-flow-device-birth-publish-nbirth-wait")
def test_no_dbirth_goes_before_the_nbirth_of_its_session(life: EdgeLife) -> None:
    for number in range(len(life.connects)):
        verbs = [sent.verb for sent in life.sent if sent.session == number]
        assert verbs[0] is Verb.NBIRTH
        assert Verb.DBIRTH in verbs


@pytest.mark.tck("tck-id-message-flow-device-birth-publish-nbirth-wait")
def test_a_device_that_comes_before_the_nbirth_waits_for_it() -> None:
    edge = EdgeLife(EdgeNodeSession(NODE, NODE_METRICS, now_ms=EPOCH_MS, primary_host="scada"))
    assert edge.declare("early", PROBE_METRICS) == []
    edge.connect(bd_seq=0)
    assert edge.declare("probe", PROBE_METRICS) == []
    births = edge.receive("spBv1.0/STATE/scada", b'{"online":true,"timestamp":1}')
    assert [(sent.verb, sent.topic.device) for sent in births] == [
        (Verb.NBIRTH, None),
        (Verb.DBIRTH, "early"),
        (Verb.DBIRTH, "probe"),
    ]


@pytest.mark.parametrize("name", ["bdSeq", "Node Control/Rebirth", "Axis"])
def test_a_metric_with_the_name_of_what_the_birth_holds_already_is_refused(name: str) -> None:
    with pytest.raises(SparkplugError, match=name):
        EdgeNodeSession(NODE, [MetricSpec(name, DataType.INT64)], templates={"Axis": AXIS})
