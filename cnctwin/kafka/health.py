"""The health of a runner: once a second, as JSON, on a compacted topic. Bridges make metrics of it."""

import time
from collections.abc import Sequence
from contextlib import suppress

from confluent_kafka import Consumer, Producer, TopicPartition

from cnctwin.kafka.assigned import Assigned, Place
from cnctwin.kafka.report import RunnerReport, payload_of
from cnctwin.kafka.settings import KafkaSettings
from cnctwin.kafka.topics import Topics
from cnctwin.kafka.transaction import Transactions
from sparkplug.records.record import Record

REPORT_S = 1.0
FAULT_MAX = 1000


class RunnerHealth:
    """See the module."""

    def __init__(self, settings: KafkaSettings, topics: Topics, member: str, names: Sequence[str]) -> None:
        self.rebalances = self.dead_letters = self.records = self.faults = 0
        self.fault = ""
        self._topics, self._names = topics, sorted(names)
        self._member = f"{'+'.join(self._names)}.{member}"
        self._producer = Producer(settings.client() | {"compression.type": "lz4", "queue.buffering.max.messages": 100})
        self._reported_s = self._cpu_s = 0.0
        self._up_to_s: dict[Place, float] = {}  # the time on the wall that each partition is folded up to

    def took(self, place: Place, record: Record) -> None:
        """Note a record that is folded."""
        self.records += 1
        self._up_to_s[place] = record.received_ms / 1000

    def failed(self, fault: str) -> None:
        """Note a fault that was contained."""
        self.faults += 1
        self.fault = fault[:FAULT_MAX]

    def report(self, now_s: float, assigned: Assigned, transactions: Transactions, consumer: Consumer) -> None:
        """Publish how it stands, once a second."""
        if now_s - self._reported_s < REPORT_S:
            return
        cpu_s = time.process_time()
        busy_pct = 100.0 * (cpu_s - self._cpu_s) / (now_s - self._reported_s) if self._reported_s else 0.0
        self._reported_s, self._cpu_s = now_s, cpu_s
        waiting, lag_s = self._behind(assigned, consumer)
        partitions = assigned.partitions.values()
        report = RunnerReport(
            t=time.time_ns() // 1_000_000,
            processors=tuple(self._names),
            partitions=len(partitions),
            records=self.records,
            lag_records=waiting,
            lag_s=round(lag_s, 3),
            busy_pct=round(busy_pct, 1),
            transactions=transactions.committed,
            transactions_aborted=transactions.aborted,
            rebalances=self.rebalances,
            restored_s=round(assigned.restored_s, 3),
            lost_by_retention=assigned.lost,
            repeated=assigned.counted.repeated(partitions),
            dead_letters=self.dead_letters,
            faults=self.faults,
            fault=self.fault,
            ledgers=assigned.counted.ledgers(partitions),
        )
        self._say(payload_of(report))

    def close(self) -> None:
        """Take the report back: this runner is gone."""
        self._say(None)
        self._producer.flush(2.0)

    def _say(self, payload: bytes | None) -> None:
        with suppress(BufferError):  # the cluster is away, and what waits says the same
            self._producer.produce(self._topics.health, payload, self._member.encode())
        self._producer.poll(0)

    def _behind(self, assigned: Assigned, consumer: Consumer) -> tuple[int, float]:
        """Return how many records wait, by what the consumer knows of the ends, and how late the partition is that is last.

        One of which nothing was folded yet is as late as it is here: at least that.
        """
        waiting, up_to_s, now_s = 0, self._up_to_s, time.time()
        lag_s = 0.0
        self._up_to_s = {place: up_to_s.get(place, now_s) for place in assigned.partitions}
        for place, partition in assigned.partitions.items():
            _, high = consumer.get_watermark_offsets(TopicPartition(*place), cached=True)
            if behind := max(high - partition.next, 0):
                waiting += behind
                lag_s = max(lag_s, now_s - self._up_to_s[place])
            else:
                self._up_to_s[place] = now_s  # silence before the next record is no lag
        return waiting, lag_s
