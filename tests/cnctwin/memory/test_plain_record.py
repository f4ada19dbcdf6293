"""A memory keeps some plain messages, with the time at which they were heard."""

import json

from cnctwin.memory.plain_record import PlainRecord
from cnctwin.memory.store.contract import Snapshot
from sparkplug.host_session import EventKind, HostEvent
from sparkplug.topics import NodeId

HOUR_MS = 3_600_000


def plain(topic: str, payload: bytes = b"", at_ms: int = 0) -> HostEvent:
    return HostEvent(EventKind.PLAIN, NodeId("", ""), None, at_ms, topic=f"cnctwin/{topic}", payload=payload)


def test_each_description_is_kept_that_is_another_one_its_end_too() -> None:
    record = PlainRecord()
    told = [b"1", b"1", b"2", b"", b"", b"2"]
    kept = [record.hear(plain("description/vmc/live", payload), 1000 * number) for number, payload in enumerate(told)]
    assert [one and one.payload for one in kept] == [b"1", None, b"2", b"", None, b"2"]
    assert kept[0] == Snapshot("description", "vmc/live", 0, b"1")


def test_a_fault_of_a_file_is_kept() -> None:
    assert PlainRecord().hear(plain("description/vmc/fault", b"{}"), 7) == Snapshot("description", "vmc/fault", 7, b"{}")


def test_a_description_has_a_millisecond_between_what_was_heard_before_and_after_it() -> None:
    record = PlainRecord()
    assert [record.moment(5), record.moment(7)] == [5, 7]
    described = record.hear(plain("description/vmc/live", b"1"), 7)
    assert described is not None
    assert described.received_ms == 8
    assert [record.moment(7), record.moment(7), record.moment(8), record.moment(9)] == [8, 8, 8, 9]
    again = record.hear(plain("description/vmc/live", b"2"), 9)
    assert again is not None
    assert (again.received_ms, record.moment(9)) == (10, 10)


def test_two_descriptions_in_a_millisecond_stand_in_their_order() -> None:
    record = PlainRecord()
    record.moment(7)
    first, second = (record.hear(plain(f"description/vmc/{role}", b"1"), 7) for role in ("live", "challenger"))
    assert first is not None and second is not None
    assert (first.received_ms, second.received_ms) == (8, 9)
    assert [record.moment(7), record.moment(8), record.moment(10)] == [9, 9, 10]


def test_of_the_loop_each_step_is_kept_and_the_first_of_an_hour() -> None:
    record = PlainRecord()
    told = [("watching", 0), ("watching", 1), ("diagnosing", 2), ("diagnosing", 3), ("diagnosing", HOUR_MS)]
    kept = [record.hear(plain("loop/vmc", json.dumps({"step": step, "n": at}).encode()), at) for step, at in told]
    assert [one is not None for one in kept] == [True, False, True, False, True]
    assert record.hear(plain("loop/vmc", b"{"), HOUR_MS + 1) is not None  # it is kept as it came, whatever it is


def test_states_of_processors_are_as_of_when_they_came() -> None:
    record = PlainRecord()
    kept = record.hear(plain("snapshot/thermal/vmc", b"{}", at_ms=3), 9)
    assert kept == Snapshot("thermal", "vmc", 3, b"{}")
    assert record.hear(plain("snapshot/thermal/vmc", b"{2}", at_ms=4), 10) is None
    assert record.died("thermal") == [Snapshot("thermal", "vmc", 4, b"{2}")]
