"""Rebirth: the metric that offers it, the host's request and what the edge does (4.2.1, 5.9, 5.17 and 6.4.19)."""

import pytest

from sparkplug.actions import Publish
from sparkplug.codec import parse
from sparkplug.datatype import DataType
from sparkplug.edge_session import REBIRTH
from sparkplug.host_session import EventKind
from sparkplug.topics import Verb
from sparkplug.values import Metric
from tests.sparkplug.conformance.life import EdgeLife, HostLife, change, new_host_life


@pytest.mark.tck(
    "tck-id-topics-nbirth-rebirth-metric",
    "tck-id-payloads-nbirth-rebirth-req",
    "tck-id-operational-behavior-data-commands-rebirth-name",
    "tck-id-operational-behavior-data-commands-rebirth-datatype",
    "tck-id-operational-behavior-data-commands-rebirth-value",
)
def test_every_nbirth_offers_the_rebirth_as_a_boolean_that_is_false(life: EdgeLife) -> None:
    for sent in life.of(Verb.NBIRTH):
        metric = sent.metric("Node Control/Rebirth")
        assert metric.datatype == DataType.BOOLEAN
        assert metric.WhichOneof("value") == "boolean_value"
        assert metric.boolean_value is False


@pytest.mark.tck("tck-id-operational-behavior-data-commands-rebirth-name-aliases")
def test_the_rebirth_metric_has_no_alias_although_others_have(life: EdgeLife) -> None:
    for sent in life.of(Verb.NBIRTH):
        assert not sent.metric("Node Control/Rebirth").HasField("alias")
        assert sent.metric("health/lag").HasField("alias")


def _asked(host: HostLife, edge: EdgeLife) -> list[Publish]:
    """The rebirth requests of a host that has lost a message."""
    host.connect()
    host.receive(*edge.rebirth())
    edge.publish("okuma", change("spindle_load", 1.0, edge.now_ms))
    host.now_ms = edge.now_ms
    host.receive(*edge.publish("okuma", change("spindle_load", 2.0, edge.now_ms)))
    host.wait(1999)
    assert host.take() == []
    host.wait(1)
    host.wait(1000)
    return [action for action in host.take() if isinstance(action, Publish)]


@pytest.mark.tck(
    "tck-id-operational-behavior-host-reordering-rebirth",
    "tck-id-operational-behavior-data-commands-ncmd-rebirth-verb",
    "tck-id-operational-behavior-data-commands-ncmd-rebirth-name",
    "tck-id-operational-behavior-data-commands-ncmd-rebirth-value",
)
def test_a_host_that_has_waited_in_vain_for_a_message_asks_the_node_once_for_a_rebirth(host: HostLife, edge: EdgeLife) -> None:
    (request,) = _asked(host, edge)
    assert (request.topic, request.qos, request.retain) == ("spBv1.0/cnc/NCMD/edge-okuma", 0, False)
    (metric,) = parse(request.payload).metrics
    assert (metric.name, metric.boolean_value) == ("Node Control/Rebirth", True)


@pytest.mark.tck(
    "tck-id-operational-behavior-data-commands-rebirth-action-1",
    "tck-id-operational-behavior-data-commands-rebirth-action-2",
    "tck-id-operational-behavior-data-commands-rebirth-action-3",
)
def test_the_node_answers_with_all_its_births_under_the_same_bdseq_before_any_more_data(host: HostLife, edge: EdgeLife) -> None:
    (request,) = _asked(host, edge)
    edge.wait(10_000)
    answer = edge.receive(request.topic, request.payload)
    assert [(sent.verb, sent.topic.device) for sent in answer] == [
        (Verb.NBIRTH, None),
        *((Verb.DBIRTH, device) for device in edge.session.devices()),
    ]
    assert answer[0].metric("bdSeq").long_value == parse(edge.connects[-1].will.payload).metrics[0].long_value
    assert answer[0].payload.seq == 0
    (data,) = edge.publish("okuma", change("spindle_load", 3.0, edge.now_ms))
    assert data.payload.seq == len(answer)


@pytest.mark.tck("tck-id-operational-behavior-data-commands-rebirth-action-2")
def test_after_the_rebirth_the_host_knows_all_again(host: HostLife, edge: EdgeLife) -> None:
    (request,) = _asked(host, edge)
    edge.wait(10_000)
    events = host.receive(*edge.receive(request.topic, request.payload))
    assert [event.kind for event in events] == [EventKind.BIRTH] * (1 + len(edge.session.devices()))
    host.wait(60_000)
    assert host.take() == []


def test_of_the_requests_of_many_hosts_a_few_are_answered_at_once_and_the_rest_by_one_rebirth(edge: EdgeLife) -> None:
    edge.wait(10_000)
    answers = [edge.command(Metric(REBIRTH, True, DataType.BOOLEAN)) for _ in range(9)]
    assert [bool(answer) for answer in answers] == [True] * 4 + [False] * 5
    late = edge.wait(1000)
    assert late[0].verb is Verb.NBIRTH
    assert edge.wait(10_000) == []


@pytest.mark.tck("tck-id-operational-behavior-data-commands-rebirth-action-1")
def test_no_data_goes_between_a_request_that_has_to_wait_and_its_rebirth(edge: EdgeLife) -> None:
    edge.wait(10_000)
    for _ in range(4):
        assert edge.command(Metric(REBIRTH, True, DataType.BOOLEAN)), "a few are answered at once"
    edge.command(Metric(REBIRTH, True, DataType.BOOLEAN))
    assert edge.publish("okuma", change("spindle_load", 3.0, edge.now_ms)) == []
    assert [sent.verb for sent in edge.wait(1000)][:2] == [Verb.NBIRTH, Verb.DBIRTH]


@pytest.mark.parametrize("value", [False, None])
def test_a_rebirth_command_that_is_not_true_asks_for_nothing(edge: EdgeLife, value: bool | None) -> None:
    edge.wait(10_000)
    assert edge.command(Metric(REBIRTH, value, DataType.BOOLEAN)) == []


def test_a_rebirth_is_not_asked_of_a_device(edge: EdgeLife) -> None:
    edge.wait(10_000)
    assert edge.command(Metric(REBIRTH, True, DataType.BOOLEAN), device="okuma") == []


def test_a_host_that_hears_of_an_unborn_node_asks_for_its_birth(edge: EdgeLife) -> None:
    host = new_host_life()
    host.connect()
    host.receive(*edge.publish("okuma", change("spindle_load", 3.0, edge.now_ms)))
    host.wait(1000)
    assert len(host.take()) == 1
