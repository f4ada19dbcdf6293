"""What every payload and every metric carries (6.4.5 and 6.4.6)."""

from typing import Any

import pytest

from sparkplug.codec import decode, encode, parse
from sparkplug.datatype import DataType
from sparkplug.edge_session import EdgeNodeSession
from sparkplug.errors import PayloadError, SparkplugError
from sparkplug.metric import MetricSpec
from sparkplug.schema import PayloadMessage
from sparkplug.topics import Verb
from sparkplug.values import Metric, Payload
from tests.sparkplug.conformance.life import EPOCH_MS, NODE, EdgeLife, HostLife, change

UINT32, UINT64 = 13, 4


def _field(path: str) -> Any:
    """The descriptor of a field of the payload schema, by the names on the way to it."""
    message = PayloadMessage.DESCRIPTOR
    *parents, last = path.split(".")
    for name in parents:
        message = message.fields_by_name[name].message_type
    return message.fields_by_name[last]


@pytest.mark.tck("tck-id-payloads-timestamp-in-UTC")
def test_payload_times_are_the_milliseconds_since_1970_utc_that_the_session_was_given(life: EdgeLife) -> None:
    assert [sent.payload.timestamp for sent in life.sent] == [sent.at_ms for sent in life.sent]
    assert _field("timestamp").type == UINT64


@pytest.mark.tck("tck-id-payloads-metric-timestamp-in-UTC")
def test_metric_times_are_the_ones_of_the_changes(edge: EdgeLife) -> None:
    (sent,) = edge.publish("okuma", change("tool_number", 1, 1_700_000_000_123))
    assert [metric.timestamp for metric in sent.payload.metrics] == [1_700_000_000_123]
    birth = next(sent for sent in edge.rebirth() if sent.topic.device == "okuma")
    assert birth.metric("tool_number").timestamp == 1_700_000_000_123


@pytest.mark.tck("tck-id-payloads-name-requirement")
def test_every_metric_has_its_name_where_it_has_no_alias(life: EdgeLife) -> None:
    for sent in life.sent:
        for metric in sent.payload.metrics:
            assert metric.name or metric.HasField("alias")


@pytest.mark.tck("tck-id-payloads-name-birth-data-requirement")
def test_every_metric_of_births_and_data_has_its_time(life: EdgeLife) -> None:
    for sent in life.of(Verb.NBIRTH, Verb.DBIRTH, Verb.NDATA, Verb.DDATA):
        for metric in sent.payload.metrics:
            assert metric.HasField("timestamp")
            assert EPOCH_MS - 60_000 <= metric.timestamp <= sent.at_ms


@pytest.mark.tck("tck-id-payloads-name-cmd-requirement")
@pytest.mark.parametrize("timestamp_ms", [None, EPOCH_MS])
def test_a_command_may_carry_the_time_of_its_metric(edge: EdgeLife, timestamp_ms: int | None) -> None:
    edge.session.commands.clear()
    edge.command(Metric("health/lag", 5, DataType.INT64, timestamp_ms))
    assert [(c.name, c.value, c.timestamp_ms) for c in edge.session.commands] == [("health/lag", 5, timestamp_ms)]


@pytest.mark.tck("tck-id-payloads-metric-datatype-req", "tck-id-payloads-metric-datatype-value")
def test_every_metric_of_a_birth_has_one_of_the_datatypes(life: EdgeLife) -> None:
    for sent in life.of(Verb.NBIRTH, Verb.DBIRTH):
        for metric in sent.payload.metrics:
            assert metric.HasField("datatype")
            assert DataType.INT8 <= metric.datatype <= DataType.DATETIME_ARRAY


@pytest.mark.tck("tck-id-payloads-metric-datatype-value-type")
def test_the_datatype_is_an_unsigned_32_bit_number() -> None:
    assert _field("metrics.datatype").type == UINT32
    assert _field("metrics.datatype").number == 4


@pytest.mark.tck("tck-id-payloads-metric-datatype-value")
@pytest.mark.parametrize("code", [35, 255, 2**32 - 1])
def test_a_datatype_that_the_specification_does_not_know_is_refused(host: HostLife, code: int) -> None:
    message = PayloadMessage(timestamp=1, seq=0)
    message.metrics.add(name="x", datatype=code, int_value=1)
    with pytest.raises(PayloadError):
        decode(message.SerializeToString())
    host.connect()
    assert host.session.message("spBv1.0/cnc/NBIRTH/edge", message.SerializeToString(), EPOCH_MS) == []
    assert host.session.counts["malformed"] == 1


@pytest.mark.parametrize("datatype", [DataType.UNKNOWN, DataType.PROPERTY_SET, DataType.PROPERTY_SET_LIST])
def test_a_metric_of_a_type_that_no_metric_can_have_is_not_declared(datatype: DataType) -> None:
    with pytest.raises(SparkplugError):
        EdgeNodeSession(NODE, [MetricSpec("x", datatype)])


@pytest.mark.tck("tck-id-payloads-metric-datatype-not-req")
def test_data_carries_no_datatype(life: EdgeLife) -> None:
    for sent in life.of(Verb.NDATA, Verb.DDATA):
        assert not any(metric.HasField("datatype") for metric in sent.payload.metrics)


@pytest.mark.xfail(strict=True, reason="on purpose: peers on sparkplug-payload read a command without a datatype as null")
@pytest.mark.tck("tck-id-payloads-metric-datatype-not-req")
def test_commands_carry_no_datatype(host: HostLife, edge: EdgeLife) -> None:
    host.connect()
    host.receive(*edge.rebirth())
    command = host.session.command(NODE, None, [change("health/lag", 1, EPOCH_MS)], EPOCH_MS)
    assert not any(metric.HasField("datatype") for metric in parse(command.payload).metrics)


def test_a_name_that_is_no_utf_8_is_malformed() -> None:
    with pytest.raises(PayloadError):
        decode(b"\x12\x03\x0a\x01\xff")


@pytest.mark.parametrize(
    "payload",
    [
        Payload(EPOCH_MS, (Metric("x", "\ud800", DataType.STRING, EPOCH_MS),)),
        Payload(EPOCH_MS, (Metric("\ud800", 1, DataType.INT8, EPOCH_MS),)),
        Payload(EPOCH_MS, (Metric("x", 1, DataType.INT8, -5),)),
        Payload(-1),
    ],
)
def test_what_cannot_be_written_is_refused_in_our_own_words(payload: Payload) -> None:
    with pytest.raises(PayloadError):
        encode(payload)
