"""A runner's report: the lag of the partition that is last, and counts that outlive the partitions they were made in."""

from collections.abc import Mapping
from typing import Any, cast

import pytest

pytest.importorskip("confluent_kafka", reason="no confluent-kafka in this Python; install the extra kafka")

from cnctwin.kafka import health as module
from cnctwin.kafka.assigned import Assigned, Place
from cnctwin.kafka.counted import Counted
from cnctwin.kafka.health import RunnerHealth
from cnctwin.kafka.report import RunnerReport, parsed
from cnctwin.kafka.settings import KafkaSettings
from cnctwin.kafka.topics import Topics
from cnctwin.kafka.transaction import Transactions
from processors.discovery import discover
from processors.partition.partition import Partition
from sparkplug.host_event import EventKind, HostEvent
from sparkplug.metric import NodeId, Reading
from sparkplug.quality import Quality
from sparkplug.records.record import Origin, Record, RecordReader, RecordWriter

T0_MS = 1_790_000_000_000
READINGS = "cnctwin.cnc.readings"


def records(machine: str, count: int) -> list[Record]:
    """A birth and what follows, each a second later."""
    writer, reader = RecordWriter("bridge"), RecordReader()
    node = NodeId("cnc", f"edge-{machine}")
    told = []
    for place in range(count):
        at_ms = T0_MS + 1000 * place
        kind = EventKind.DATA if place else EventKind.BIRTH
        reading = Reading("spindle_temp_c", 20.0 + place, at_ms, Quality.GOOD, "°C", None, False)
        told.append(reader.read(*writer.written(HostEvent(kind, node, machine, at_ms, (reading,)), at_ms, Origin(0, 1, place))))
    return told


def partition_of(*taken: Record) -> Partition:
    processor = discover()["thermal"]
    partition = Partition("test", [(processor, processor.configured({}))])
    for offset, record in enumerate(taken):
        list(partition.take(offset, record))
    return partition


class Plant:
    """The parts that a report asks for: partitions, how far the log is, and what was committed."""

    committed, aborted, lost, restored_s = 7, 2, 0, 0.25

    def __init__(self, monkeypatch: pytest.MonkeyPatch) -> None:
        self.partitions: dict[Place, Partition] = {}
        self.counted = Counted()
        self.ends: dict[int, int] = {}
        self.now_s = T0_MS / 1000
        self.health = RunnerHealth(KafkaSettings(bootstrap="127.0.0.1:1"), Topics("cnc"), "r0", ["thermal"])
        self.said: list[bytes | None] = []
        monkeypatch.setattr(self.health, "_say", self.said.append)
        monkeypatch.setattr(module.time, "time", lambda: self.now_s)

    def get_watermark_offsets(self, place: Any, cached: bool) -> tuple[int, int]:
        assert cached
        return 0, self.ends.get(place.partition, -1001)

    def report(self) -> RunnerReport:
        self.now_s += 1.0
        me = cast(Any, self)
        self.health.report(self.now_s, cast(Assigned, me), cast(Transactions, me), me)
        assert self.said[-1] is not None
        report = parsed(self.said[-1])
        assert isinstance(report, RunnerReport)
        return report


@pytest.fixture
def plant(monkeypatch: pytest.MonkeyPatch) -> Plant:
    return Plant(monkeypatch)


def test_the_partition_that_is_last_gives_the_lag_however_fresh_the_others_are(plant: Plant) -> None:
    first, *_, last = records("okuma", 600)
    plant.partitions = {(READINGS, 0): partition_of(first), (READINGS, 1): partition_of(last)}
    plant.ends = {0: 500, 1: 2}
    plant.now_s = last.received_ms / 1000
    plant.health.took((READINGS, 0), first)
    plant.health.took((READINGS, 1), last)
    told = plant.report()
    assert (told.lag_records, told.lag_s, told.records) == (500, pytest.approx(600.0), 2)


def test_a_partition_that_folds_nothing_grows_late_and_one_with_nothing_to_fold_does_not(plant: Plant) -> None:
    plant.partitions = {(READINGS, 0): partition_of(), (READINGS, 1): partition_of()}
    plant.ends = {0: 5}
    assert [plant.report().lag_s for _ in range(3)] == [pytest.approx(lag_s) for lag_s in (0.0, 1.0, 2.0)]
    plant.ends = {0: 0}
    assert (plant.report().lag_s, plant.report().lag_records) == (0.0, 0)


def test_silence_before_the_next_record_is_no_lag(plant: Plant) -> None:
    (first,) = records("okuma", 1)
    plant.partitions, plant.ends = {(READINGS, 0): partition_of(first)}, {0: 1}
    plant.health.took((READINGS, 0), first)
    plant.now_s += 3600.0
    plant.report()
    plant.ends = {0: 2}
    assert plant.report().lag_s == pytest.approx(1.0)


def test_counts_stay_when_a_partition_goes_and_machines_do_not(plant: Plant) -> None:
    told = records("okuma", 5)
    gone, stays = partition_of(*told, told[-1]), partition_of(*records("mazak", 3))
    plant.partitions = {(READINGS, 0): gone, (READINGS, 1): stays}
    before = plant.report()
    assert (before.ledgers["thermal"]["ledger/received"], before.ledgers["thermal"]["machines"], before.repeated) == (8, 2, 1)
    plant.counted.retire(plant.partitions.pop((READINGS, 0)))
    after = plant.report()
    assert after.ledgers["thermal"] == before.ledgers["thermal"] | {"machines": 1}
    assert (after.repeated, after.partitions) == (1, 1)


def test_messages_held_back_in_a_partition_that_goes_leave_the_ledger_balanced(plant: Plant) -> None:
    held = partition_of(*records("okuma", 3))
    ledger = held.seats[0].engine.ledger
    ledger.count(())  # as if one were held back
    plant.counted.retire(held)
    assert _balance(plant.counted.ledgers([])["thermal"]) == 0
    assert plant.counted.ledgers([])["thermal"]["ledger/received"] == 3


def test_faults_are_counted_and_the_last_one_is_told(plant: Plant) -> None:
    for text in ("thermal: no number", "x" * 5000):
        plant.health.failed(text)
    told = plant.report()
    assert (told.faults, told.fault) == (2, "x" * 1000)


def _balance(ledger: Mapping[str, int]) -> int:
    return ledger["ledger/received"] - ledger["ledger/emitted"] - ledger["ledger/buffered"] - ledger["ledger/dropped"]
