"""Metrics written from kept parts are, byte for byte, those that protobuf writes."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import count
from typing import Any

import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from sparkplug.actions import Publish
from sparkplug.certificate import GOOD_AGAIN, Certificate
from sparkplug.codec import encode, write_properties, write_value
from sparkplug.datatype import DataType
from sparkplug.edge_session import EdgeNodeSession
from sparkplug.errors import MetricValueError, PayloadError
from sparkplug.metric import Change, MetricSpec, NodeId, quality_properties
from sparkplug.quality import Quality
from sparkplug.schema import PayloadMessage
from sparkplug.values import Metric, Payload
from tests.sparkplug.everything import ALL_VALUES, METADATA

NOW_MS = 1_790_000_000_000
QUICK = settings(deadline=None, suppress_health_check=[HealthCheck.too_slow])
TYPES = tuple(datatype for datatype in sorted(ALL_VALUES) if datatype is not DataType.TEMPLATE)
STAMPS = st.one_of(
    st.integers(NOW_MS, NOW_MS + 3),
    st.sampled_from([0, 127, 128, 16383, 16384, 2**35 - 1, 2**35, 2**42 - 1, 2**42, 2**63, 2**64 - 1]),
)


def by_protobuf(
    specs: Sequence[MetricSpec], qualities: dict[str, Quality], changes: Sequence[Change], stamp_ms: int, seq: int
) -> bytes:
    """The whole message field by field, with the qualities that were told before."""
    places = {spec.name: (alias, spec) for alias, spec in enumerate(specs, start=1)}
    message = PayloadMessage(timestamp=stamp_ms)
    for change in sorted(changes, key=lambda change: change.timestamp_ms):
        alias, spec = places[change.name]
        out = message.metrics.add(alias=alias, timestamp=change.timestamp_ms)
        if change.value is None:
            out.is_null = True
        else:
            write_value(out, spec.datatype, change.value)
        if change.quality is not Quality.GOOD or change.reason is not None:
            write_properties(out.properties, quality_properties(change.quality, change.reason))
        elif qualities[change.name] is not Quality.GOOD:
            write_properties(out.properties, GOOD_AGAIN)
        if change.is_historical:
            out.is_historical = True
        if spec.is_transient:
            out.is_transient = True
    message.seq = seq
    data: bytes = message.SerializeToString()
    return data


def session(specs: Sequence[MetricSpec]) -> EdgeNodeSession:
    edge = EdgeNodeSession(NodeId("cnc", "edge"), now_ms=NOW_MS)
    edge.declare_device("vmc", specs, NOW_MS)
    edge.connecting(0, NOW_MS)
    edge.connected(NOW_MS)
    return edge


@QUICK
@given(st.data())
def test_any_message_is_what_protobuf_writes(data: st.DataObject) -> None:
    drawn = data.draw(st.lists(st.tuples(st.sampled_from(TYPES), st.booleans(), st.booleans()), min_size=1, max_size=5), "types")
    specs = [
        MetricSpec(f"m{i}", datatype, value=data.draw(ALL_VALUES[datatype]) if is_known else None, is_transient=is_transient)
        for i, (datatype, is_known, is_transient) in enumerate(drawn)
    ]
    edge = session(specs)
    qualities = {spec.name: Quality.GOOD if spec.value is not None else Quality.BAD for spec in specs}
    for seq in range(2, 2 + data.draw(st.integers(1, 4), "messages")):
        changes = []
        for _ in range(data.draw(st.integers(1, 4), "changes")):
            spec = data.draw(st.sampled_from(specs), "metric")
            value = data.draw(ALL_VALUES[spec.datatype], "value")
            change = Change(spec.name, value, data.draw(STAMPS, "stamp"))
            if data.draw(st.integers(0, 5), "odd") == 0:
                quality, reason = data.draw(st.sampled_from(Quality)), data.draw(st.sampled_from([None, "agent gone"]))
                value = data.draw(st.sampled_from([None, value]))
                change = Change(spec.name, value, change.timestamp_ms, quality, reason, data.draw(st.booleans()))
            changes.append(change)
        stamp_ms = NOW_MS + 1000 * seq
        (sent,) = edge.publish("vmc", changes, stamp_ms)
        assert sent == Publish("spBv1.0/cnc/DDATA/edge/vmc", by_protobuf(specs, qualities, changes, stamp_ms, seq))
        for change in sorted(changes, key=lambda change: change.timestamp_ms):
            if not change.is_historical:
                qualities[change.name] = change.quality


@QUICK
@given(st.lists(st.tuples(st.integers(120, 135), st.floats(), STAMPS), min_size=1, max_size=6), st.integers(1, 2**50))
def test_plain_numbers_are_what_protobuf_writes_and_what_the_next_birth_carries(
    drawn: list[tuple[int, float, int]], later_ms: int
) -> None:
    specs = [
        MetricSpec(f"m{i}", DataType.DOUBLE, value=0.0, reason="first" if i % 2 else None) for i in range(136)
    ]  # from 128 on an alias takes two bytes
    edge = session(specs)
    changes = [Change(f"m{place}", value, at_ms) for place, value, at_ms in drawn]
    (sent,) = edge.publish("vmc", changes, NOW_MS + later_ms)
    assert isinstance(sent, Publish)
    good = dict.fromkeys((spec.name for spec in specs), Quality.GOOD)
    assert sent.payload == by_protobuf(specs, good, changes, NOW_MS + later_ms, 2)
    other = session(specs)
    other.note("vmc", changes)
    assert edge._devices["vmc"].birth() == other._devices["vmc"].birth()


PROPERTY = st.one_of(
    st.booleans(), st.integers(-(2**63), 2**63 - 1), st.floats(), st.sampled_from(["", "feed of the axis", "Größe"])
)


@QUICK
@given(st.data())
def test_a_birth_is_what_protobuf_writes(data: st.DataObject) -> None:
    """The metrics follow one another; the payload's own fields stand around them."""
    specs, expected = [], []
    for alias in range(1, 1 + data.draw(st.integers(1, 5), "metrics")):
        datatype = data.draw(st.sampled_from(TYPES), "type")
        properties = data.draw(st.dictionaries(st.sampled_from(["meaning", "axis", "reason", "Quality"]), PROPERTY), "properties")
        spec = MetricSpec(
            f"m{alias}",
            datatype,
            unit=data.draw(st.sampled_from([None, "mm"])),
            low=data.draw(st.sampled_from([None, -1.5])),
            properties=properties,
            value=data.draw(st.none() | ALL_VALUES[datatype], "value"),
            timestamp_ms=data.draw(STAMPS, "stamp"),
            quality=data.draw(st.sampled_from(Quality)),
            reason=data.draw(st.sampled_from([None, "agent gone"])),
            is_transient=data.draw(st.booleans()),
            metadata=data.draw(st.sampled_from([None, None, METADATA])),
        )
        specs.append(spec)
        _, value, stamp_ms, quality, reason, _ = spec.first(NOW_MS)
        told = {**spec.property_set(), **quality_properties(quality, reason)}
        metric = Metric(
            spec.name, value, datatype, stamp_ms, alias, is_transient=spec.is_transient, properties=told, metadata=spec.metadata
        )
        expected.append((stamp_ms, encode(Payload(None, (metric,)))))
    aliases = count(1)
    owner = Certificate("device vmc", specs, lambda _: next(aliases), NOW_MS)
    assert owner.birth() == b"".join(raw for _, raw in sorted(expected, key=lambda one: one[0]))


def test_a_name_that_utf_8_cannot_write_is_refused_by_the_birth() -> None:
    with pytest.raises(PayloadError, match="name, alias, time or metadata"):
        session([MetricSpec("\ud800", DataType.DOUBLE, value=1.0)])


def test_the_sequence_number_counts_over_255() -> None:
    edge = session([MetricSpec("m", DataType.DOUBLE, value=0.0)])
    for number in range(2, 600):
        (sent,) = edge.publish("vmc", [Change("m", float(number), NOW_MS)], NOW_MS)
        assert isinstance(sent, Publish)
        assert PayloadMessage.FromString(sent.payload).seq == number % 256


@pytest.mark.parametrize(
    ("datatype", "wrong"),
    [(DataType.DOUBLE, "1"), (DataType.DOUBLE, True), (DataType.FLOAT, 1e39), (DataType.INT8, 128), (DataType.STRING, "\ud800")],
)
def test_a_wrong_value_is_refused_and_nothing_of_its_message_is_kept(datatype: DataType, wrong: Any) -> None:
    edge = session([MetricSpec("good", DataType.DOUBLE, value=1.0), MetricSpec("m", datatype)])
    before = edge._devices["vmc"].birth()
    with pytest.raises(MetricValueError, match="device vmc of cnc/edge: metric 'm'"):
        edge.publish("vmc", [Change("good", 2.0, NOW_MS), Change("m", wrong, NOW_MS)], NOW_MS)
    assert edge._devices["vmc"].birth() == before


def test_a_time_stamp_that_protobuf_cannot_carry_is_refused() -> None:
    edge = session([MetricSpec("m", DataType.DOUBLE, value=1.0)])
    for wrong in (-1, 2**64):
        with pytest.raises(ValueError, match=r"out of range|can't convert|negative|too big"):
            edge.publish("vmc", [Change("m", 2.0, wrong)], NOW_MS)
