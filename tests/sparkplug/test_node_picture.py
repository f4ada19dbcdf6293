"""The hot path of a host says the same as the codec."""

from __future__ import annotations

from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from sparkplug.codec import decode, encode, parse
from sparkplug.datatype import DataType
from sparkplug.node_picture import NodePicture, quality_of, tells_quality
from sparkplug.topics import NodeId
from sparkplug.values import Metric, Payload, PropertyValue
from tests.sparkplug.everything import ALL_VALUES, PROPERTY_SETS, same

QUICK = settings(deadline=None, suppress_health_check=[HealthCheck.too_slow])


@QUICK
@given(st.data())
def test_the_hot_path_reads_what_the_codec_reads(data: st.DataObject) -> None:
    types = data.draw(st.lists(st.sampled_from(sorted(ALL_VALUES)), min_size=1, max_size=5), "types")
    picture = NodePicture(NodeId("cnc", "edge"))
    aliases = data.draw(st.permutations([None, *range(4)]), "aliases")[: len(types)]
    birth = tuple(Metric(f"m{i}", None, t, 1, aliases[i]) for i, t in enumerate(types))
    picture.own.bear(parse(encode(Payload(1, birth))), 1, picture.holders)
    sent = []
    for _ in range(data.draw(st.integers(0, 6), "count")):
        i = data.draw(st.integers(0, len(types) - 1), "metric")
        value = data.draw(st.none() | ALL_VALUES[types[i]], "value")
        named = aliases[i] is None or data.draw(st.booleans(), "named")
        sent.append(
            Metric(
                f"m{i}" if named else None,
                value,
                types[i],
                data.draw(st.none() | st.integers(1, 2**63), "time"),
                None if named else aliases[i],
                is_historical=data.draw(st.booleans(), "history"),
                properties=data.draw(PROPERTY_SETS | st.just({"Quality": PropertyValue(DataType.INT32, 0)}), "properties"),
            )
        )
    message = parse(encode(Payload(9, tuple(sent))))
    for metric in message.metrics:
        if data.draw(st.booleans(), "untyped"):
            metric.ClearField("datatype")
    payload = message.SerializeToString()
    readings, complete = picture.read_data(picture.own, parse(payload), 9, may_tell_quality=tells_quality(payload))
    known = {m.name: m for m in birth} | {m.alias: m for m in birth if m.alias is not None}
    slow = decode(payload, lambda name, alias: known[name if name else alias].datatype).metrics
    assert complete
    for reading, metric in zip(readings, slow, strict=True):
        assert reading.name == known[metric.name or metric.alias].name
        assert same(reading.value, metric.value)
        assert reading.timestamp_ms == (metric.timestamp_ms or 9)
        assert reading.is_historical == metric.is_historical
        assert (reading.quality, reading.reason) == quality_of(metric.properties)


def test_alias_0_is_not_the_alias_of_metrics_without_one() -> None:
    picture = NodePicture(NodeId("cnc", "edge"))
    birth = (Metric("zero", 1.0, DataType.DOUBLE, 1, alias=0), Metric("named", 2.0, DataType.DOUBLE, 1))
    picture.own.bear(parse(encode(Payload(1, birth))), 1, picture.holders)
    data = parse(encode(Payload(2, (Metric("named", 3.0, DataType.DOUBLE, 2), Metric(None, 4.0, DataType.DOUBLE, 2, alias=0)))))
    readings, complete = picture.read_data(picture.own, data, 2)
    assert complete and [(r.name, r.value) for r in readings] == [("named", 3.0), ("zero", 4.0)]
