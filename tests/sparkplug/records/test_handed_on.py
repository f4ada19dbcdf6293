"""A message of a known layout goes into its record in pieces, and the record reads as if it had been taken apart."""

from random import Random

from sparkplug.codec import encode, parse
from sparkplug.datatype import DataType
from sparkplug.host_event import HostEvent
from sparkplug.host_session import HostSession
from sparkplug.metric import UNIT_PROPERTY, NodeId, Reading
from sparkplug.quality import Quality
from sparkplug.records.record import Origin, RecordReader, RecordWriter
from sparkplug.values import Metric, Payload, PropertyValue

NOW_MS = 1_790_000_000_000
NODE = NodeId("cnc", "mill-01")
UNIT = {UNIT_PROPERTY: PropertyValue(DataType.STRING, "100 %")}


def host(*, packs: bool) -> HostSession:
    """A host that knows the births of the machine."""
    session = HostSession("scada", chance=Random(0), packs=packs)
    session.connecting(NOW_MS)
    session.connected(NOW_MS)
    node = (Metric("bdSeq", 0, DataType.INT64, NOW_MS),)
    device = (
        Metric("load", 0.0, DataType.DOUBLE, NOW_MS, 1, properties=UNIT),
        Metric("tool", 0, DataType.INT32, NOW_MS, 2),
        Metric("program", "", DataType.STRING, NOW_MS, 3),
    )
    session.message("spBv1.0/cnc/NBIRTH/mill-01", encode(Payload(NOW_MS, node, seq=0)), NOW_MS)
    session.message("spBv1.0/cnc/DBIRTH/mill-01/mill-01", encode(Payload(NOW_MS, device, seq=1)), NOW_MS)
    return session


def heard(session: HostSession, count: int, *, types: bool) -> list[HostEvent]:
    """The events of some messages, each of which says its types where edges do."""
    events: list[HostEvent] = []
    for number in range(count):
        at_ms = NOW_MS + 100 * number
        values = (("load", 10.5 + number, DataType.DOUBLE), ("tool", number, DataType.INT32), ("program", "%b", DataType.STRING))
        metrics = tuple(Metric(None, value, told, at_ms, alias) for alias, (_, value, told) in enumerate(values, start=1))
        message = parse(encode(Payload(at_ms, metrics, seq=2 + number)))
        for metric in () if types else message.metrics:
            metric.ClearField("datatype")
        payload = message.SerializeToString()
        events += session.message("spBv1.0/cnc/DDATA/mill-01/mill-01", payload, at_ms)
    return events


def test_what_is_handed_on_reads_as_what_is_taken_apart() -> None:
    for types in (False, True):
        packed, apart = (heard(host(packs=packs), 5, types=types) for packs in (True, False))
        assert [event.packed is not None for event in packed] == [False, True, True, True, True]
        assert not any(event.readings for event in packed[1:])
        reader = RecordReader()
        for one, other in zip(packed, apart, strict=True):
            assert one.read() == other.read()
            written = [RecordWriter("b0").written(event, NOW_MS, Origin(0, NOW_MS, event.seq)) for event in (one, other)]
            told, expected = (reader.read(*record).event for record in written)
            assert told is not None and told == expected and len(told) == len(one)
            assert told.readings[0] == Reading(
                "load", other.readings[0].value, other.timestamp_ms, Quality.GOOD, "100 %", None, False
            )


def test_the_latest_readings_are_those_of_the_packed_message() -> None:
    session = host(packs=True)
    heard(session, 4, types=False)
    picture = session.picture(NODE)
    assert picture is not None
    assert {name: one.value for name, one in picture.devices["mill-01"].readings.items()} == {
        "load": 13.5,
        "tool": 3,
        "program": "%b",
    }
