"""Property sets and the quality in them (6.4.8 and 6.4.9)."""

from typing import Any

import pytest

from sparkplug.codec import decode, encode, parse
from sparkplug.datatype import DataType
from sparkplug.errors import PayloadError
from sparkplug.quality import Quality
from sparkplug.schema import PayloadMessage
from sparkplug.topics import Verb
from sparkplug.values import Metric, Payload, PropertyValue
from tests.sparkplug.conformance.life import EPOCH_MS, EdgeLife, HostLife, change

UINT32 = 13
_SET = PayloadMessage.DESCRIPTOR.fields_by_name["metrics"].message_type.fields_by_name["properties"].message_type
ALLOWED = [*range(DataType.INT8, DataType.TEXT + 1), DataType.PROPERTY_SET, DataType.PROPERTY_SET_LIST]


def _sets(life: EdgeLife) -> list[Any]:
    return [metric.properties for sent in life.sent for metric in sent.payload.metrics if metric.HasField("properties")]


@pytest.mark.tck("tck-id-payloads-propertyset-keys-array-size", "tck-id-payloads-propertyset-values-array-size")
def test_there_are_as_many_keys_as_values(life: EdgeLife) -> None:
    assert len(_sets(life)) > 10
    for properties in _sets(life):
        assert len(properties.keys) == len(properties.values) > 0


@pytest.mark.tck("tck-id-payloads-propertyset-keys-array-size", "tck-id-payloads-propertyset-values-array-size")
@pytest.mark.parametrize(("keys", "values"), [(1, 2), (2, 1), (0, 1), (1, 0)])
def test_a_set_with_more_keys_than_values_or_fewer_is_not_read(host: HostLife, keys: int, values: int) -> None:
    message = PayloadMessage(timestamp=EPOCH_MS, seq=0)
    metric = message.metrics.add(name="x", datatype=DataType.INT32, int_value=1)
    metric.properties.keys.extend(f"k{number}" for number in range(keys))
    for _ in range(values):
        metric.properties.values.add(type=DataType.INT32, int_value=1)
    with pytest.raises(PayloadError):
        decode(message.SerializeToString())
    host.connect()
    assert host.session.message("spBv1.0/cnc/NBIRTH/edge", message.SerializeToString(), EPOCH_MS) == []


@pytest.mark.tck("tck-id-payloads-metric-propertyvalue-type-req", "tck-id-payloads-metric-propertyvalue-type-value")
def test_every_property_has_its_type(life: EdgeLife) -> None:
    for properties in _sets(life):
        for value in properties.values:
            assert value.HasField("type")
            assert value.type in ALLOWED


@pytest.mark.tck("tck-id-payloads-metric-propertyvalue-type-type")
def test_the_type_of_a_property_is_an_unsigned_32_bit_number() -> None:
    assert _SET.fields_by_name["values"].message_type.fields_by_name["type"].type == UINT32


@pytest.mark.tck("tck-id-payloads-metric-propertyvalue-type-value")
@pytest.mark.parametrize(("datatype", "value"), [(DataType.BYTES, b"x"), (DataType.INT8_ARRAY, (1,)), (DataType.FILE, b"x")])
def test_a_property_of_a_type_that_no_property_can_have_is_refused(datatype: DataType, value: Any) -> None:
    with pytest.raises(PayloadError):
        encode(Payload(EPOCH_MS, (Metric("x", 1, DataType.INT8, properties={"p": PropertyValue(datatype, value)}),)))


@pytest.mark.tck("tck-id-payloads-propertyset-quality-value-type", "tck-id-payloads-propertyset-quality-value-value")
@pytest.mark.parametrize("quality", list(Quality))
def test_a_quality_is_an_int32_in_the_field_int_value_and_one_of_the_three_codes(
    edge: EdgeLife, host: HostLife, quality: Quality
) -> None:
    edge.publish("okuma", change("spindle_load", 1.0, edge.now_ms, quality=Quality.BAD))
    host.connect()
    host.receive(*edge.rebirth())
    (data,) = edge.publish("okuma", change("spindle_load", 2.0, edge.now_ms, quality=quality))
    birth = next(sent for sent in edge.rebirth() if sent.topic.device == "okuma")
    found = [data.payload.metrics[0].properties]
    if quality is not Quality.GOOD:
        found.append(birth.metric("spindle_load").properties)
    for properties in found:
        value = properties.values[list(properties.keys).index("Quality")]
        assert value.type == 3
        assert value.WhichOneof("value") == "int_value"
        assert value.int_value == quality
        assert value.int_value in (0, 192, 500)
    assert host.receive(data)[0].readings[0].quality is quality


@pytest.mark.tck("tck-id-payloads-propertyset-quality-value-value")
def test_every_quality_of_a_whole_life_is_one_of_the_three_codes(life: EdgeLife) -> None:
    codes = [
        value.int_value
        for properties in _sets(life)
        for key, value in zip(properties.keys, properties.values, strict=True)
        if key == "Quality"
    ]
    assert set(codes) == {0, 192}
    assert life.of(Verb.DDATA)


def test_nested_property_sets_come_back_as_they_were() -> None:
    inner = {"a": PropertyValue(DataType.INT32, -1), "n": PropertyValue(DataType.STRING, None)}
    properties = {
        "set": PropertyValue(DataType.PROPERTY_SET, inner),
        "list": PropertyValue(DataType.PROPERTY_SET_LIST, (inner, inner)),
    }
    payload = Payload(EPOCH_MS, (Metric("x", 1, DataType.INT8, EPOCH_MS, properties=properties),))
    assert decode(encode(payload)) == payload
    assert len(parse(encode(payload)).metrics[0].properties.keys) == 2
