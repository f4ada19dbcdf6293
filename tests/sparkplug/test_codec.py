"""Payloads to bytes and back; whatever comes in, nothing but PayloadError goes out."""

from __future__ import annotations

import contextlib
import time
from typing import Any

import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from sparkplug.codec import PAYLOAD_BYTES_MAX, TEMPLATE_DEPTH_MAX, decode, encode, parse, read_metric
from sparkplug.datatype import FIELD, PROPERTY_ONLY, DataType
from sparkplug.errors import MetricValueError, PayloadError
from sparkplug.schema import PayloadMessage
from sparkplug.values import DataSet, Metric, Payload, PropertyValue, Template
from tests.depth import examples
from tests.sparkplug.everything import (
    ALL_VALUES,
    EDGES,
    EVERYTHING,
    PAYLOADS,
    PROPERTIES,
    same,
)

HURRY_S = 2.0  # of this process's own time: others may be at work on the machine
QUICK = settings(deadline=None, suppress_health_check=[HealthCheck.too_slow])


def test_one_of_everything_holds_all_34_datatypes() -> None:
    used = {metric.datatype for metric in EVERYTHING.metrics} | {value.datatype for value in PROPERTIES.values()}
    assert used == set(DataType) - {DataType.UNKNOWN}


def test_one_of_everything_survives_the_round_trip() -> None:
    back = decode(encode(EVERYTHING))
    for sent, seen in zip(EVERYTHING.metrics, back.metrics, strict=True):
        assert same(sent, seen), sent.name
    assert same(EVERYTHING, back)


@QUICK
@given(PAYLOADS)
def test_every_payload_survives_the_round_trip(payload: Payload) -> None:
    assert same(decode(encode(payload)), payload)


@QUICK
@given(PAYLOADS)
def test_the_same_payload_gives_the_same_bytes(payload: Payload) -> None:
    assert encode(decode(encode(payload))) == encode(payload)


@pytest.mark.parametrize(
    ("payload", "data"),
    [
        (Payload(None), ""),
        (Payload(1, seq=0), "08 01 18 00"),
        (Payload(None, (Metric("a", -1, DataType.INT8),)), "12 0b 0a 01 61 20 01 50 ff ff ff ff 0f"),
        (Payload(None, (Metric("a", -1, DataType.INT64),)), "12 10 0a 01 61 20 04 58 ff ff ff ff ff ff ff ff ff 01"),
        (Payload(None, (Metric("a", None, DataType.DOUBLE),)), "12 07 0a 01 61 20 0a 38 01"),
        (Payload(None, (Metric(None, True, DataType.BOOLEAN, 5, 7),)), "12 08 10 07 18 05 20 0b 70 01"),
        (Payload(None, (Metric("a", (-23,), DataType.INT8_ARRAY),)), "12 09 0a 01 61 20 16 82 01 01 e9"),
    ],
)
def test_the_bytes_are_those_of_the_specification(payload: Payload, data: str) -> None:
    assert encode(payload) == bytes.fromhex(data)
    assert decode(bytes.fromhex(data)) == payload


@pytest.mark.parametrize("datatype", [DataType.INT8, DataType.INT16, DataType.INT32])
@pytest.mark.parametrize("width", [8, 16, 32])
def test_a_negative_number_is_read_whatever_width_the_peer_gave_it(datatype: DataType, width: int) -> None:
    message = PayloadMessage()
    message.metrics.add(name="a", datatype=datatype, int_value=-5 & (1 << width) - 1)
    expected = -5 if width >= {DataType.INT8: 8, DataType.INT16: 16, DataType.INT32: 32}[datatype] else (1 << width) - 5
    assert decode(message.SerializeToString()).metrics[0].value == expected


@pytest.mark.parametrize("field", ["int_value", "long_value"])
@pytest.mark.parametrize("datatype", [t for t in EDGES if FIELD[t] in ("int_value", "long_value")])
def test_a_whole_number_may_stand_in_either_field(datatype: DataType, field: str) -> None:
    message = PayloadMessage()
    message.metrics.add(name="a", datatype=datatype, **{field: 100})
    assert decode(message.SerializeToString()).metrics[0].value == 100


@QUICK
@given(st.sampled_from(sorted(ALL_VALUES)).flatmap(lambda t: st.tuples(st.just(t), ALL_VALUES[t])))
def test_data_without_a_datatype_is_read_by_that_of_the_birth(typed: tuple[DataType, Any]) -> None:
    datatype, value = typed
    message = parse(encode(Payload(None, (Metric(None, value, datatype, alias=7),))))
    message.metrics[0].ClearField("datatype")
    metric = decode(message.SerializeToString(), lambda name, alias: datatype if (name, alias) == (None, 7) else None).metrics[0]
    assert metric.datatype is datatype and same(metric.value, value)


@pytest.mark.parametrize(
    ("metric", "says"),
    [
        (Metric("m", 128, DataType.INT8), "'m': 128 is not a INT8"),
        (Metric("m", -1, DataType.UINT64), "not a UINT64"),
        (Metric("m", 2**64, DataType.DATETIME), "not a DATETIME"),
        (Metric("m", 1.0, DataType.INT32), "not a INT32"),
        (Metric("m", True, DataType.INT32), "not a INT32"),
        (Metric("m", True, DataType.DOUBLE), "not a DOUBLE"),
        (Metric("m", 1, DataType.BOOLEAN), "not a BOOLEAN"),
        (Metric("m", "1", DataType.DOUBLE), "not a DOUBLE"),
        (Metric("m", b"a", DataType.STRING), "not a STRING"),
        (Metric("m", "a", DataType.BYTES), "not a BYTES"),
        (Metric("m", "lone \ud800", DataType.STRING), "STRING"),
        (Metric("m", 10**400, DataType.DOUBLE), "DOUBLE"),
        (Metric("m", "a", DataType.DATASET), "not a DataSet"),
        (Metric("m", "a", DataType.TEMPLATE), "not a Template"),
        (Metric("m", "a", DataType.PROPERTY_SET), "cannot be the type"),
        (Metric("m", 1, DataType.UNKNOWN), "cannot be the type"),
        (Metric("m", 1), "needs a datatype"),
        (Metric(None, 1, alias=9), "metric 9"),
        (Metric("m", (1, 2.5), DataType.INT8_ARRAY), "INT8_ARRAY"),
        (Metric("m", [1], DataType.INT8_ARRAY), "give a tuple"),  # type: ignore[arg-type]
        (Metric("m", DataSet(("a",), (DataType.INT8,), ((300,),)), DataType.DATASET), "300 is not a INT8"),
        (Metric("m", 1, DataType.INT8, properties={"p": PropertyValue(DataType.INT8, 300)}), "300 is not a INT8"),
        (Metric("m", 1, DataType.INT8, properties={"p": PropertyValue(DataType.BYTES, b"")}), "BYTES"),
        (Metric("m", 1, DataType.INT8, properties={"p": PropertyValue(DataType.PROPERTY_SET, 1)}), "PROPERTY_SET"),
        (Metric("m", 1e39, DataType.FLOAT), "FLOAT"),
        (Metric("m", ("\ud800",), DataType.STRING_ARRAY), "STRING_ARRAY"),
    ],
)
def test_a_value_that_its_type_cannot_carry_is_refused_by_name(metric: Metric, says: str) -> None:
    with pytest.raises(MetricValueError, match=says):
        encode(Payload(0, (metric,)))


@pytest.mark.parametrize(
    "payload",
    [
        Payload(-1),
        Payload(2**64),
        Payload(0, seq=-1),
        Payload(0, (Metric("m", 1, DataType.INT8, timestamp_ms=-1),)),
        Payload(0, (Metric("m", 1, DataType.INT8, alias=2**64),)),
        Payload(0, (Metric("\ud800", 1, DataType.INT8),)),
    ],
)
def test_a_number_or_name_outside_its_field_is_refused(payload: Payload) -> None:
    with pytest.raises(PayloadError):
        encode(payload)


@QUICK
@given(st.binary(max_size=200))
def test_random_bytes_raise_nothing_but_payload_error(data: bytes) -> None:
    _try_all(data)


@settings(deadline=None, max_examples=examples(200), suppress_health_check=[HealthCheck.too_slow])
@given(st.integers(0, 10_000), st.integers(0, 255), st.integers(0, 2))
def test_a_damaged_payload_raises_nothing_but_payload_error(place: int, byte: int, kind: int) -> None:
    data = bytearray(_EVERYTHING_BYTES)
    place %= len(data)
    if kind == 0:
        data[place] = byte
    elif kind == 1:
        del data[place]
    else:
        data.insert(place, byte)
    _try_all(bytes(data))


@pytest.mark.parametrize("where", ["metric", "property", "parameter", "cell"])
def test_any_type_with_any_field_raises_nothing_but_payload_error(where: str) -> None:
    for code in range(40):
        for field in set(FIELD.values()):
            message = PayloadMessage()
            target = _place(message, where, code)
            if field in target.DESCRIPTOR.fields_by_name:
                if target.DESCRIPTOR.fields_by_name[field].message_type is not None:
                    getattr(target, field).SetInParent()
                else:
                    setattr(target, field, {"string_value": "x", "bytes_value": b"x"}.get(field, 1))
                _try_all(message.SerializeToString())


def _place(message: Any, where: str, code: int) -> Any:
    """Return where a value of type `code` can stand in a payload."""
    metric = message.metrics.add(name="a", datatype=code)
    if where == "metric":
        return metric
    metric.datatype = DataType.DATASET if where == "cell" else DataType.TEMPLATE
    if where == "property":
        metric.properties.keys.append("p")
        return metric.properties.values.add(type=code)
    if where == "parameter":
        metric.template_value.template_ref = "T"
        return metric.template_value.parameters.add(name="p", type=code)
    metric.dataset_value.columns.append("c")
    metric.dataset_value.types.append(code)
    return metric.dataset_value.rows.add().elements.add()


def test_templates_may_be_nested_and_only_so_deep() -> None:
    assert decode(encode(_nested_template(TEMPLATE_DEPTH_MAX)))
    with pytest.raises(PayloadError, match="nested"):
        decode(encode(_nested_template(TEMPLATE_DEPTH_MAX + 1)))


def test_property_sets_may_be_nested_and_only_so_deep() -> None:
    def nested(depth: int) -> bytes:
        properties: dict[str, PropertyValue] = {}
        for _ in range(depth):
            properties = {"p": PropertyValue(DataType.PROPERTY_SET, properties)}
        return encode(Payload(0, (Metric("a", 1, DataType.INT8, properties=properties),)))

    assert decode(nested(TEMPLATE_DEPTH_MAX))
    with pytest.raises(PayloadError, match="nested"):
        decode(nested(TEMPLATE_DEPTH_MAX + 1))


@pytest.mark.parametrize("depth", [200, 20_000])
def test_a_bottomless_template_is_refused_quickly(depth: int) -> None:
    inner = b""
    for _ in range(depth):
        template = _field(2, inner)
        inner = _field(18, template)
        if len(inner) > 1_000_000:
            break
    _refused_quickly(_field(2, inner))


@pytest.mark.parametrize(
    "data",
    [
        bytes.fromhex("12 ff ff ff ff 0f"),
        bytes.fromhex("12 ff ff ff ff ff ff ff ff 7f"),
        bytes.fromhex("12 80 80 80 80 80 80 80 80 80 80 80"),
        b"\x12\x06\x0a\xff\xff\xff\xff\x0f",
        b"\x00" * 1000,
        b"\xff" * 1000,
    ],
)
def test_huge_lengths_are_refused_quickly(data: bytes) -> None:
    _refused_quickly(data)


def test_a_payload_above_the_limit_is_refused_unread() -> None:
    with pytest.raises(PayloadError, match="above the limit of 4194304"):
        parse(bytes(PAYLOAD_BYTES_MAX + 1))


def test_a_payload_of_many_empty_metrics_takes_bounded_time() -> None:
    began_s = time.process_time()
    assert len(decode(b"\x12\x00" * 50_000).metrics) == 50_000
    assert time.process_time() - began_s < HURRY_S


@pytest.mark.parametrize(
    ("build", "says"),
    [
        (lambda m: m.properties.keys.append("p"), "1 keys and 0 values"),
        (lambda m: m.properties.values.add(type=1), "0 keys and 1 values"),
        (lambda m: setattr(m, "datatype", 35), "datatype 35"),
        (lambda m: setattr(m, "string_value", "x"), "a INT8 came in the field string_value"),
        (lambda m: m.dataset_value.columns.append("c"), "1 columns and 0 types"),
        (lambda m: m.dataset_value.rows.add().elements.add(int_value=1), "1 cells for 0 columns"),
        (lambda m: setattr(m.template_value, "is_definition", False), "names no definition"),
        (lambda m: m.template_value.MergeFrom(_definition_with_ref()), "refers to none"),
    ],
)
def test_what_breaks_a_rule_is_refused_with_the_rule(build: Any, says: str) -> None:
    message = PayloadMessage()
    metric = message.metrics.add(name="a", datatype=1)
    build(metric)
    if metric.HasField("dataset_value"):
        metric.datatype = DataType.DATASET
    if metric.HasField("template_value"):
        metric.datatype = DataType.TEMPLATE
    with pytest.raises(PayloadError, match=says):
        decode(message.SerializeToString())


def test_unknown_fields_are_tolerated() -> None:
    extra = _field(1000, b"extension") + bytes.fromhex("f0 07 01")
    metric = _field(2, _field(1, b"a") + b"\x20\x01\x50\x05" + extra)
    payload = decode(metric + extra)
    assert payload.metrics == (Metric("a", 5, DataType.INT8),)
    assert extra in parse(metric + extra).SerializeToString()


def test_the_codes_and_fields_are_those_of_the_specification() -> None:
    assert [t.value for t in DataType] == list(range(35))
    assert FIELD.keys() == set(DataType) - {DataType.UNKNOWN}
    assert EDGES.keys() == FIELD.keys() - PROPERTY_ONLY


def _try_all(data: bytes) -> None:
    """Decode in every way; PayloadError is the only way out."""
    with contextlib.suppress(PayloadError):
        decode(data)
    try:
        message = parse(data)
    except PayloadError:
        return
    for metric in message.metrics:
        for datatype in (None, DataType.INT8, DataType.BOOLEAN_ARRAY, DataType.TEMPLATE):
            try:
                read_metric(metric, lambda *_, t=datatype: t)  # type: ignore[misc]
            except PayloadError:
                continue


def _refused_quickly(data: bytes) -> None:
    began_s = time.process_time()
    with pytest.raises(PayloadError):
        decode(data)
    assert time.process_time() - began_s < HURRY_S


def _nested_template(depth: int) -> Payload:
    template = Template("T", ())
    for _ in range(depth - 1):
        template = Template("T", (Metric("inner", template, DataType.TEMPLATE),))
    return Payload(0, (Metric("outer", template, DataType.TEMPLATE),))


def _definition_with_ref() -> Any:
    message = PayloadMessage()
    template = message.metrics.add().template_value
    template.is_definition, template.template_ref = True, "T"
    return template


def _field(number: int, data: bytes) -> bytes:
    return _varint(number << 3 | 2) + _varint(len(data)) + data


def _varint(number: int) -> bytes:
    out = bytearray()
    while number > 0x7F:
        out.append(number & 0x7F | 0x80)
        number >>= 7
    return bytes((*out, number))


_EVERYTHING_BYTES = encode(EVERYTHING)
