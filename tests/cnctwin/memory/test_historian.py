"""From the processor's ears into a store: batches in order, bounded, nothing silent."""

import threading
import time
from collections.abc import Callable, Iterator, Sequence
from typing import Any

import pytest

from cnctwin.memory import historian, plain_record
from cnctwin.memory.historian import StoreRecorder
from cnctwin.memory.store.contract import Appended, Message, Pinned, Snapshot, Status, StoreError, Tidied
from processors.actions import Pin
from sparkplug.host_session import EventKind, HostEvent
from sparkplug.metric import Reading
from sparkplug.quality import Quality
from sparkplug.topics import NodeId

EDGE, TWIN = NodeId("cnc", "edge-vmc"), NodeId("cnc", "twin-thermal")


class Memory:
    """A store that remembers what it was told, and can be made to fail."""

    def __init__(self) -> None:
        self.told: list[Any] = []
        self.fails = False
        self.breaks = False
        self.closed = False
        self.newest_ms: int | None = None

    def append(self, messages: Sequence[Message]) -> Appended:
        if self.breaks:
            raise ZeroDivisionError
        if self.fails:
            raise StoreError("the disk is full; make room")
        self.told += messages
        return Appended(sum(len(message.event.readings) for message in messages), 0, 0)

    def pin(self, pinned: Pinned) -> None:
        self.told.append(pinned)

    def keep_snapshot(self, *snapshots: Snapshot) -> None:
        self.told += snapshots

    def snapshot_before(self, processor: str, unit: str, at_ms: int) -> Snapshot | None:
        told = [one for one in self.told if isinstance(one, Snapshot) and (one.processor, one.unit) == (processor, unit)]
        return told[-1] if told else None

    def messages(self, machine: str, from_ms: int, to_ms: int) -> Iterator[Message]:
        return (one for one in self.told if isinstance(one, Message) and from_ms <= one.received_ms < to_ms)

    def machines(self) -> list[str]:
        return ["vmc"]

    def tidy(self, now_ms: int) -> Tidied:
        return Tidied(0, 0, 0, 0)

    def status(self) -> Status:
        return Status(0, 4096, None, self.newest_ms, 12.34, 0, "")

    def close(self) -> None:
        self.closed = True


def data(number: int, kind: EventKind = EventKind.DATA, node: NodeId = EDGE) -> HostEvent:
    reading = Reading("spindle_rpm", float(number), number, Quality.GOOD, "rev/min", None, False)
    return HostEvent(kind, node, "vmc", number, (reading,))


def snapshot(payload: bytes) -> HostEvent:
    return HostEvent(EventKind.PLAIN, NodeId("", ""), None, 0, topic="cnctwin/snapshot/thermal/vmc", payload=payload)


def until(condition: Callable[[], bool]) -> None:
    deadline_s = time.monotonic() + 60.0
    while not condition():
        assert time.monotonic() < deadline_s
        time.sleep(0.005)


@pytest.fixture
def memory() -> Memory:
    return Memory()


@pytest.fixture
def recorder(memory: Memory) -> Iterator[StoreRecorder]:
    recorder = StoreRecorder(memory)  # type: ignore[arg-type]
    recorder.start()
    yield recorder
    if not memory.closed:
        recorder.stop()


def test_what_is_heard_is_stored_in_the_order_in_which_it_came(recorder: StoreRecorder, memory: Memory) -> None:
    for number in range(100):
        recorder.keep(data(number), number)
    recorder.pin(Pin("vmc", 1, 2, "anomaly_alarm"))
    recorder.keep(data(100), 100)
    recorder.stop()
    assert [one.received_ms for one in memory.told if isinstance(one, Message)] == list(range(101))
    assert memory.told[100] == Pinned("vmc", 1, 2, "anomaly_alarm")
    assert recorder.health()["store_samples"] == 101
    assert memory.closed


def test_a_store_that_cannot_write_is_tried_again_and_says_why(recorder: StoreRecorder, memory: Memory) -> None:
    memory.fails = True
    recorder.keep(data(1), 1)
    until(lambda: recorder.health()["store_trouble"] == "the disk is full; make room")
    assert recorder.health()["store_waiting"] == 1
    memory.fails = False
    until(lambda: len(memory.told) == 1)
    until(lambda: recorder.health()["store_trouble"] == "")


def test_what_does_not_fit_is_counted(recorder: StoreRecorder, memory: Memory, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(historian, "QUEUE_MAX", 10)
    memory.fails = True
    for number in range(30):
        recorder.keep(data(number), number)
    health = recorder.health()
    assert health["store_dropped"] in (19, 20)  # one may be in the hands of the thread already
    assert int(health["store_waiting"]) + int(health["store_dropped"]) == 30


def test_what_takes_too_much_memory_is_counted(memory: Memory, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(historian, "QUEUE_BYTES_MAX", 100_000)
    recorder = StoreRecorder(memory)  # type: ignore[arg-type]
    block = Reading("vibration", (0.5,) * 1000, 0, Quality.GOOD, "g", None, False)
    for number in range(5):
        recorder.keep(HostEvent(EventKind.DATA, EDGE, "vmc", number, (block,)), number)
        recorder.keep(data(number), number)
    assert recorder.health()["store_dropped"] == 2, "three blocks of 32 kB are all that fit; small ones still do"
    recorder.start()
    recorder.stop()
    assert len(memory.told) == 8


def test_what_waits_for_long_is_a_trouble(recorder: StoreRecorder, memory: Memory, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(historian, "LATE_S", 0.3)
    monkeypatch.setattr(recorder, "_queue", historian._Queue())
    monkeypatch.setattr(recorder._queue, "take", lambda: time.sleep(0.01) or historian._Batch([], [], None, 0))
    recorder.keep(data(1), 1)
    until(lambda: str(recorder.health()["store_trouble"]).startswith("what was heard waits for"))
    assert float(recorder.health()["store_behind_s"]) >= 0.3
    monkeypatch.undo()


def test_snapshots_do_not_break_a_batch(memory: Memory) -> None:
    recorder = StoreRecorder(memory)  # type: ignore[arg-type]
    for number in range(20):
        recorder.keep(data(number), number)
        topic = f"cnctwin/snapshot/thermal/vmc-{number}"
        recorder.keep(HostEvent(EventKind.PLAIN, NodeId("", ""), None, 0, topic=topic, payload=b"state"), number)
    recorder.start()
    recorder.stop()
    assert [type(one) for one in memory.told] == [Message] * 20 + [Snapshot] * 20


def test_last_snapshots_are_bounded_and_the_latest_stay(memory: Memory, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(plain_record, "SNAPSHOT_BYTES_MAX", 1000)
    recorder = StoreRecorder(memory)  # type: ignore[arg-type]
    for time_ms in (1, 2):
        for number in range(20):
            topic = f"cnctwin/snapshot/thermal/vmc-{number}"
            recorder.keep(HostEvent(EventKind.PLAIN, NodeId("", ""), None, 0, topic=topic, payload=b"x" * 100), time_ms)
    recorder.keep(data(9, EventKind.DEATH, TWIN), 9)
    recorder.start()
    recorder.stop()
    last = [one.unit for one in memory.told if isinstance(one, Snapshot)][20:]
    assert sorted(last) == sorted(f"vmc-{number}" for number in range(10, 20))


def test_our_own_bug_ends_the_processor(memory: Memory, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(threading, "excepthook", lambda _: None)
    recorder = StoreRecorder(memory)  # type: ignore[arg-type]
    recorder.start()
    memory.breaks = True
    with pytest.raises(ZeroDivisionError):
        for number in range(1000):
            recorder.keep(data(number), number)
            time.sleep(0.01)
    recorder.stop()


def test_the_first_snapshot_of_an_hour_is_kept_and_the_last_one_before_a_death(recorder: StoreRecorder, memory: Memory) -> None:
    for number, payload in enumerate([b"first", b"second", b"third"]):
        recorder.keep(snapshot(payload), number)
    recorder.keep(data(9, EventKind.DEATH, TWIN), 9)
    recorder.keep(data(9, EventKind.DEATH, TWIN), 9)
    recorder.stop()
    assert [one.payload for one in memory.told if isinstance(one, Snapshot)] == [b"first", b"third"]


def test_a_memory_with_a_hole_says_so_at_the_start(memory: Memory) -> None:
    memory.newest_ms = 1000
    recorder = StoreRecorder(memory)  # type: ignore[arg-type]
    recorder.start()
    recorder.stop()
    (hole,) = memory.told
    assert (hole.event.kind, hole.event.device) == (EventKind.HOLE, "vmc")
    assert "the newest sample before it is" in hole.event.detail


def row_of(number: int, kind: EventKind = EventKind.DATA) -> HostEvent:
    """Return what an edge that waits for receipts says."""
    names: dict[str, Any] = {"Device Control/Receipt": ""} if kind is EventKind.BIRTH else {"edge_sequence": number}
    readings = tuple(Reading(name, value, number, Quality.GOOD, None, None, False) for name, value in names.items())
    return HostEvent(kind, EDGE, "vmc", number, readings)


def test_while_the_store_is_stuck_no_edge_is_told_that_we_are_here(
    recorder: StoreRecorder, memory: Memory, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(historian, "BEHIND_S", 0.2)
    monkeypatch.setattr(historian, "BEHIND_S_MAX", 0.3)
    recorder.keep(row_of(0, EventKind.BIRTH), 0)
    recorder.keep(row_of(1), 1)
    until(lambda: [receipt.value for receipt in recorder.receipts()] == ["1-1"])
    assert [receipt.value for receipt in recorder.receipts()] == [""], "nothing new, but somebody is here"
    memory.fails = True
    recorder.keep(row_of(2), 2)
    until(lambda: not recorder.receipts())
    time.sleep(0.3)
    assert recorder.receipts() == [], "or the edge would tell again and again what waits here"
    memory.fails = False
    until(lambda: [receipt.value for receipt in recorder.receipts()] == ["2-2"])


def test_a_store_that_cannot_say_how_it_is_ends_nothing(
    recorder: StoreRecorder, memory: Memory, monkeypatch: pytest.MonkeyPatch
) -> None:
    def locked() -> Status:
        raise StoreError("database is locked")

    monkeypatch.setattr(memory, "status", locked)
    monkeypatch.setattr(historian, "STATUS_S", 0.0)
    until(lambda: recorder.health()["store_trouble"] == "database is locked")
    recorder.keep(data(1), 1)
    until(lambda: bool(memory.told))
