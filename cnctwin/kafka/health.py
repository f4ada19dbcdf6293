"""The health of a runner: once a second, as JSON, on a compacted topic. Bridges make metrics of it."""

import json
import time
from collections import Counter
from collections.abc import Sequence
from contextlib import suppress

from confluent_kafka import Consumer, Producer, TopicPartition

from cnctwin.kafka.assigned import Assigned
from cnctwin.kafka.settings import KafkaSettings
from cnctwin.kafka.topics import Topics
from cnctwin.kafka.transaction import Transactions
from sparkplug.records.record import Record

REPORT_S = 1.0
FORMAT = 1


class RunnerHealth:
    """See the module."""

    def __init__(self, settings: KafkaSettings, topics: Topics, member: str, names: Sequence[str]) -> None:
        self.rebalances = self.dead_letters = self.records = 0
        self.fault = ""
        self._topics, self._names = topics, sorted(names)
        self._member = f"{'+'.join(self._names)}.{member}"
        self._producer = Producer(settings.client() | {"compression.type": "lz4", "queue.buffering.max.messages": 100})
        self._reported_s = self._cpu_s = 0.0
        self._newest_ms = 0

    def took(self, record: Record) -> None:
        """Note a record that is folded."""
        self.records += 1
        self._newest_ms = record.received_ms

    def report(self, now_s: float, assigned: Assigned, transactions: Transactions, consumer: Consumer) -> None:
        """Publish how it stands, once a second."""
        if now_s - self._reported_s < REPORT_S:
            return
        cpu_s = time.process_time()
        busy_pct = 100.0 * (cpu_s - self._cpu_s) / (now_s - self._reported_s) if self._reported_s else 0.0
        self._reported_s, self._cpu_s = now_s, cpu_s
        behind = self._behind(assigned, consumer)
        document = {
            "format": FORMAT,
            "t": time.time_ns() // 1_000_000,
            "processors": self._names,
            "partitions": len(assigned.partitions),
            "records": self.records,
            "lag_records": behind,
            "lag_s": max(time.time() - self._newest_ms / 1000, 0.0) if behind and self._newest_ms else 0.0,
            "busy_pct": round(busy_pct, 1),
            "transactions": transactions.committed,
            "transactions_aborted": transactions.aborted,
            "rebalances": self.rebalances,
            "restored_s": round(assigned.restored_s, 3),
            "lost_by_retention": assigned.lost,
            "repeated": sum(partition.repeated for partition in assigned.partitions.values()),
            "dead_letters": self.dead_letters,
            "fault": self.fault,
            "ledgers": self._ledgers(assigned),
        }
        self._say(json.dumps(document, separators=(",", ":")).encode())

    def close(self) -> None:
        """Take the report back: this runner is gone."""
        self._say(None)
        self._producer.flush(2.0)

    def _say(self, payload: bytes | None) -> None:
        with suppress(BufferError):  # the cluster is away, and what waits says the same
            self._producer.produce(self._topics.health, payload, self._member.encode())
        self._producer.poll(0)

    @staticmethod
    def _behind(assigned: Assigned, consumer: Consumer) -> int:
        """Return the number of records that wait, by what the consumer knows of the ends."""
        waiting = 0
        for (topic, number), partition in assigned.partitions.items():
            _, high = consumer.get_watermark_offsets(TopicPartition(topic, number), cached=True)
            waiting += max(high - partition.next, 0) if high >= 0 else 0
        return waiting

    @staticmethod
    def _ledgers(assigned: Assigned) -> dict[str, dict[str, int]]:
        """Return the ledger of each processor, with its machines and what else it counts, over all partitions."""
        totals: dict[str, Counter[str]] = {}
        for partition in assigned.partitions.values():
            for seat in partition.seats:
                total = totals.setdefault(seat.name, Counter())
                counts = seat.engine.counts
                total.update(seat.engine.ledger.metrics())
                total.update(machines=len(seat.engine.machines), holes=counts.holes, late=counts.late, ticks=counts.ticks)
                total.update(snapshots_rejected=counts.snapshots_rejected, ignored=counts.ignored)
        return {name: dict(total) for name, total in totals.items()}
