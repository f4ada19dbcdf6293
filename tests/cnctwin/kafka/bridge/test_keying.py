"""The topics and keys under which an event goes out."""

import pytest

pytest.importorskip("confluent_kafka", reason="no confluent-kafka in this Python; install the extra kafka")

from cnctwin.kafka.bridge.keying import CLOCK_MS, Addressed, Keying
from cnctwin.kafka.topics import Topics
from processors.running.runtime import configured
from sparkplug.host_event import EventKind, HostEvent
from sparkplug.metric import NodeId, Reading
from sparkplug.quality import Quality

TOPICS = Topics("cnc")
EDGE, TWIN = NodeId("cnc", "edge-okuma"), NodeId("cnc", "twin-rules")
ALARM, LOAD = "twin/rule_load_over_limit", "spindle_load_pct"


@pytest.fixture
def keying() -> Keying:
    return Keying(TOPICS, configured(("thermal", "alerts"), None))


def event(at_ms: int, *names: str, node: NodeId = EDGE, kind: EventKind = EventKind.DATA, named: bool = True) -> HostEvent:
    readings = tuple(Reading(name, 1.0, at_ms, Quality.GOOD, None, None, False) for name in names)
    return HostEvent(kind, node, "okuma", at_ms, readings, names=names if named else ())


def told(addressed: Addressed) -> tuple[str, str, list[str]]:
    return addressed.topic, addressed.key, [reading.name for reading in addressed.event.readings]


def test_a_machine_goes_to_its_own_key_and_to_the_cell_of_those_who_compare(keying: Keying) -> None:
    born = event(1000, LOAD, ALARM, kind=EventKind.BIRTH)
    assert [told(one) for one in keying.addressed(born)] == [
        (TOPICS.readings, "okuma", [LOAD, ALARM]),
        (TOPICS.cells("alerts"), "all", [LOAD, ALARM]),
    ]
    assert keying.topics == [TOPICS.readings, TOPICS.cells("alerts")]


def test_a_cell_hears_of_data_what_it_asks_for(keying: Keying) -> None:
    for named in (True, False):
        found = [told(one) for one in keying.addressed(event(1000, LOAD, ALARM, node=TWIN, named=named))]
        assert found[-1] == (TOPICS.cells("alerts"), "all", [ALARM])


def test_what_a_cell_does_not_ask_for_tells_it_the_time_once_a_second(keying: Keying) -> None:
    def goes_to_cell(at_ms: int, *names: str) -> bool:
        return any(one.topic == TOPICS.cells("alerts") for one in keying.addressed(event(at_ms, *names)))

    begin_ms = 1_000_000
    assert [goes_to_cell(begin_ms + step, LOAD) for step in (0, 100, CLOCK_MS - 1, CLOCK_MS, CLOCK_MS + 100)] == [
        True,
        False,
        False,
        True,
        False,
    ]
    assert goes_to_cell(begin_ms + CLOCK_MS + 200, ALARM)


def test_names_of_one_layout_are_looked_through_once_and_mean_the_same_later(keying: Keying) -> None:
    first, second = (event(at_ms, ALARM, LOAD, node=TWIN) for at_ms in (1000, 1100))
    parts = [list(keying.addressed(one))[-1].event for one in (first, second)]
    assert [part.names for part in parts] == [(ALARM,), (ALARM,)]
    assert [part.readings[0].timestamp_ms for part in parts] == [1000, 1100]
