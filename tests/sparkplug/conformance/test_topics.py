"""Topic namespace and ids (chapter 1.4 and 4.1)."""

import pytest

from sparkplug.actions import Publish, Subscribe
from sparkplug.datatype import DataType
from sparkplug.edge_session import EdgeNodeSession
from sparkplug.errors import SparkplugError, TopicError
from sparkplug.metric import MetricSpec, NodeId
from sparkplug.topics import Topic, Verb, check_id, state_topic
from tests.sparkplug.conformance.life import EPOCH_MS, NODE, PROBE_METRICS, EdgeLife, HostLife, change

FORBIDDEN = ["", "a+b", "a/b", "a#b", "+", "#", "/", "a\0b"]
ALLOWED = ["cnc", "Müller GmbH", "機械", "a b", "a.b-c_d", "Größe 2 €", "$x"]


@pytest.mark.tck(
    "tck-id-intro-group-id-string",
    "tck-id-intro-group-id-chars",
    "tck-id-topic-structure-namespace-valid-group-id",
    "tck-id-intro-edge-node-id-string",
    "tck-id-intro-edge-node-id-chars",
    "tck-id-topic-structure-namespace-valid-edge-node-id",
)
@pytest.mark.parametrize("text", FORBIDDEN)
def test_a_group_or_node_id_with_a_reserved_character_is_refused(text: str) -> None:
    with pytest.raises(TopicError):
        EdgeNodeSession(NodeId(text, "edge"))
    with pytest.raises(TopicError):
        EdgeNodeSession(NodeId("cnc", text))
    with pytest.raises(TopicError):
        check_id(text, "group id")


@pytest.mark.tck(
    "tck-id-intro-group-id-string",
    "tck-id-intro-edge-node-id-string",
    "tck-id-intro-device-id-string",
)
@pytest.mark.parametrize("text", ALLOWED)
def test_any_other_utf_8_string_is_used_in_the_topics_as_it_is(text: str) -> None:
    edge = EdgeLife(EdgeNodeSession(NodeId(text, text)))
    edge.session.declare_device(text, PROBE_METRICS, EPOCH_MS)
    topics = [sent.raw.topic for sent in edge.connect(bd_seq=0)]
    assert topics == [f"spBv1.0/{text}/NBIRTH/{text}", f"spBv1.0/{text}/DBIRTH/{text}/{text}"]
    assert [topic.encode().decode() for topic in topics] == topics
    assert Topic.parse(topics[1]) == Topic(Verb.DBIRTH, NodeId(text, text), text)


@pytest.mark.parametrize("what", ["group id", "edge node id", "device id"])
def test_an_id_that_utf_8_cannot_write_is_refused(what: str) -> None:
    with pytest.raises(TopicError):
        check_id("a\ud800", what)


@pytest.mark.tck(
    "tck-id-intro-device-id-string",
    "tck-id-intro-device-id-chars",
    "tck-id-topic-structure-namespace-valid-device-id",
)
@pytest.mark.parametrize("text", FORBIDDEN)
def test_a_device_id_with_a_reserved_character_is_refused(edge: EdgeLife, text: str) -> None:
    with pytest.raises(TopicError):
        edge.session.declare_device(text, PROBE_METRICS, EPOCH_MS)


@pytest.mark.tck("tck-id-topic-structure", "tck-id-topic-structure-namespace-a")
def test_every_topic_of_an_edge_node_has_the_structure_of_the_namespace(life: EdgeLife) -> None:
    topics = [action.topic for _, action in life.log if isinstance(action, Publish)]
    topics += [action.topic_filter for _, action in life.log if isinstance(action, Subscribe)]
    topics += [connect.will.topic for connect in life.connects]
    for topic in topics:
        namespace, group, verb, node, *device = topic.split("/")
        assert (namespace, group, node) == ("spBv1.0", "cnc", "edge-okuma")
        assert verb in set(Verb)
        assert len(device) <= 1


@pytest.mark.tck("tck-id-topic-structure", "tck-id-topic-structure-namespace-a")
@pytest.mark.parametrize(
    "topic",
    [
        "spAv1.0/cnc/NBIRTH/edge",
        "spBv2.0/cnc/NBIRTH/edge",
        "spbv1.0/cnc/NBIRTH/edge",
        "spBv1.0/cnc/NBIRTH",
        "spBv1.0/cnc/DDATA/edge/device/more",
        "spBv1.0/cnc/nbirth/edge",
        "spBv1.0/cnc/OTHER/edge",
        "cnc/NBIRTH/edge",
    ],
)
def test_a_topic_of_another_structure_is_not_taken(host: HostLife, topic: str) -> None:
    with pytest.raises(TopicError):
        Topic.parse(topic)
    host.connect()
    assert host.session.message(topic, b"", EPOCH_MS) == []
    assert host.session.nodes() == ()


@pytest.mark.tck("tck-id-topic-structure-namespace-device-id-associated-message-types")
@pytest.mark.parametrize("verb", [Verb.DBIRTH, Verb.DDEATH, Verb.DDATA, Verb.DCMD])
def test_messages_of_a_device_name_the_device(life: EdgeLife, verb: Verb) -> None:
    with pytest.raises(TopicError):
        Topic.parse(f"spBv1.0/cnc/{verb.value}/edge")
    sent = life.of(verb)
    assert sent or verb is Verb.DCMD
    assert all(message.raw.topic.count("/") == 4 for message in sent)


@pytest.mark.tck("tck-id-topic-structure-namespace-device-id-associated-message-types")
def test_a_command_for_a_device_names_the_device(host: HostLife, edge: EdgeLife) -> None:
    host.connect()
    host.receive(*edge.rebirth())
    command = host.session.command(NODE, "okuma", [], EPOCH_MS)
    assert command.topic == "spBv1.0/cnc/DCMD/edge-okuma/okuma"


@pytest.mark.tck("tck-id-topic-structure-namespace-device-id-non-associated-message-types")
@pytest.mark.parametrize("verb", [Verb.NBIRTH, Verb.NDEATH, Verb.NDATA, Verb.NCMD])
def test_messages_of_a_node_name_no_device(life: EdgeLife, verb: Verb) -> None:
    with pytest.raises(TopicError):
        Topic.parse(f"spBv1.0/cnc/{verb.value}/edge/device")
    sent = life.of(verb)
    assert sent or verb is Verb.NCMD
    assert all(message.raw.topic.count("/") == 3 for message in sent)
    assert all(connect.will.topic.count("/") == 3 for connect in life.connects)


@pytest.mark.tck("tck-id-topic-structure-namespace-device-id-non-associated-message-types")
def test_a_state_topic_names_no_device(host: HostLife) -> None:
    host.connect()
    topics = [action.topic for action in [*host.actions, *host.close()] if isinstance(action, Publish)]
    assert set(topics) == {"spBv1.0/STATE/scada"}
    with pytest.raises(TopicError):
        state_topic("scada/device")


@pytest.mark.tck("tck-id-topic-structure-namespace-unique-device-id")
def test_a_device_id_stands_for_one_device_of_a_node(edge: EdgeLife) -> None:
    before = edge.session.devices()
    edge.declare("okuma", PROBE_METRICS)
    assert edge.session.devices() == before
    assert [sent.topic.device for sent in edge.rebirth()[1:]] == list(before)
    assert len(set(before)) == len(before)


@pytest.mark.tck("tck-id-topic-structure-namespace-duplicate-device-id-across-edge-node")
def test_two_nodes_may_have_a_device_of_the_same_id(host: HostLife) -> None:
    host.connect()
    for name, value in (("edge-1", 1.0), ("edge-2", 2.0)):
        edge = EdgeLife(EdgeNodeSession(NodeId("cnc", name)))
        edge.session.declare_device("probe", PROBE_METRICS, EPOCH_MS)
        host.receive(*edge.connect(bd_seq=0), *edge.publish("probe", change("temperature", value, EPOCH_MS)))
    for name, value in (("edge-1", 1.0), ("edge-2", 2.0)):
        picture = host.session.picture(NodeId("cnc", name))
        assert picture is not None
        assert picture.devices["probe"].readings["temperature"].value == value


@pytest.mark.tck("tck-id-case-sensitivity-metric-names")
def test_metric_names_that_differ_only_in_case_are_refused() -> None:
    specs = [MetricSpec("Load", DataType.DOUBLE), MetricSpec("load", DataType.DOUBLE)]
    with pytest.raises(SparkplugError):
        EdgeNodeSession(NODE, specs)


@pytest.mark.tck("tck-id-case-sensitivity-sparkplug-ids")
def test_device_ids_that_differ_only_in_case_are_refused() -> None:
    session = EdgeNodeSession(NODE)
    session.declare_device("Probe", PROBE_METRICS, EPOCH_MS)
    with pytest.raises(SparkplugError):
        session.declare_device("probe", PROBE_METRICS, EPOCH_MS)
