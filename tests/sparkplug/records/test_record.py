"""An event that goes into a log comes out of it as it was, and what is no record is refused in one way."""

import math
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from sparkplug.datatype import DataType
from sparkplug.host_event import EventKind, HostEvent
from sparkplug.metric import NodeId, Reading
from sparkplug.quality import Quality
from sparkplug.records.record import Origin, RecordError, RecordReader, RecordWriter
from sparkplug.values import DataSet

NODE = NodeId("cnc", "edge-1")
AT_MS = 1_790_000_000_000
INT64 = st.integers(-(2**63), 2**63 - 1)
VALUES: st.SearchStrategy[Any] = st.one_of(
    st.none(),
    st.booleans(),
    st.floats(),
    INT64,
    st.integers(2**63, 2**64 - 1),
    st.text(st.characters(exclude_categories=("Cs",))),
    st.binary(),
    st.lists(st.booleans(), min_size=1).map(tuple),
    st.lists(INT64, min_size=1).map(tuple),
    st.lists(st.floats(), min_size=1).map(tuple),
    st.lists(st.text("AΩ", min_size=1), min_size=1).map(tuple),
    st.just(DataSet(("x", "y"), (DataType.DOUBLE, DataType.STRING), ((1.5, "a"), (-2.5, "b")))),
)
READINGS = st.builds(
    Reading,
    name=st.text("abc/_", min_size=1),
    value=VALUES,
    timestamp_ms=st.integers(0, 2**64 - 1),
    quality=st.just(Quality.GOOD),
    unit=st.sampled_from([None, "%", "°C"]),
    reason=st.none(),
    is_historical=st.booleans(),
)


def same(one: Any, other: Any) -> bool:
    """Equal, type and NaN included."""
    if isinstance(one, tuple) and isinstance(other, tuple) and type(one) is type(other):
        return len(one) == len(other) and all(map(same, one, other))
    if isinstance(one, float) and isinstance(other, float) and math.isnan(one):
        return math.isnan(other)
    return type(one) is type(other) and bool(one == other)


@given(st.lists(READINGS, max_size=6), st.integers(0, 2**63), st.integers(-1, 255), st.booleans())
def test_readings_come_out_as_they_went_in(readings: list[Reading], received_ms: int, seq: int, is_birth: bool) -> None:
    kind = EventKind.BIRTH if is_birth else EventKind.DATA
    writer, reader = RecordWriter("bridge-0"), RecordReader()
    for _ in range(2):  # the second one is read by what was learnt of the first
        event = HostEvent(kind, NODE, "okuma", AT_MS, tuple(readings))
        record = reader.read(*writer.written(event, received_ms, Origin(7, AT_MS, seq)))
        assert record.event is not None
        assert (record.received_ms, record.writer, record.origin) == (received_ms, "bridge-0", Origin(7, AT_MS, seq))
        assert record.event[:4] == event[:4]
        assert same(record.event.readings, event.readings)


@pytest.mark.parametrize("reason", ["because", "Ω"])
def test_quality_reason_and_detail_are_kept(reason: str) -> None:
    reading = Reading("load", None, AT_MS, Quality.STALE, "%", reason, False)
    event = HostEvent(EventKind.DATA, NODE, "okuma", AT_MS, (reading,))
    told = RecordReader().read(*RecordWriter("w").written(event, AT_MS, Origin())).event
    assert told is not None and told.readings == (reading,)
    hole = HostEvent(EventKind.HOLE, NODE, "okuma", AT_MS, detail=reason)
    assert RecordReader().read(*RecordWriter("w").written(hole, AT_MS, Origin())).event == hole


def test_a_plain_message_and_a_watermark() -> None:
    event = HostEvent(EventKind.PLAIN, NodeId("", ""), None, AT_MS, topic="cnc/okuma/load", payload=b"\xff\x00")
    record = RecordReader().read(*RecordWriter("w").written(event, AT_MS, Origin(), retain=True))
    assert (record.event, record.retain) == (event, True)
    mark = RecordReader().read(RecordWriter("w").watermark(AT_MS), None)
    assert (mark.event, mark.received_ms, mark.writer) == (None, AT_MS, "w")


def test_another_version_is_named() -> None:
    headers = [("version", b"99"), ("kind", b"data"), ("at", b"1 2 3 4"), ("writer", b"w")]
    with pytest.raises(RecordError, match=r"version b'99'; this program reads 1"):
        RecordReader().read(headers, b"")


NAMES = ("version", "kind", "node", "device", "at", "writer", "detail", "topic", "retain")
CONTENTS = st.none() | st.binary(max_size=30) | st.sampled_from([b"1", b"data", b"plain", b"watermark", b"1 2 3 4", b"9" * 5000])


@given(st.dictionaries(st.sampled_from(NAMES), CONTENTS), st.none() | st.binary(max_size=60))
def test_whatever_a_stranger_writes_is_read_or_refused(told: dict[str, bytes | None], value: bytes | None) -> None:
    headers = list(({"version": b"1", "kind": b"data", "at": b"1 2 3 4", "writer": b"w"} | told).items())
    try:
        record = RecordReader().read(headers, value)
    except RecordError:
        return
    assert 0 <= record.received_ms / 1000 < 2**64
