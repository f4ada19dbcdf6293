"""A thin runner: outputs, snapshots of the keys that changed, and offsets in one transaction.

The name of the member is static and is also the transactional id, so a restart gets its partitions back at once and ends the
transaction of the one that died. Any error of Kafka ends the process; whoever supervises it starts it again.
"""

from typing import Any

from confluent_kafka import OFFSET_BEGINNING, Consumer, KafkaError, Producer, TopicPartition

from benchmarks.stream_engines.fold import folded
from benchmarks.stream_engines.order import Order

BATCH_MAX, SESSION_MS, TRANSACTION_MS = 10_000, 10_000, 10_000


class Runner:
    """A worker of a group; the states of a partition are here from its assignment to its revocation."""

    def __init__(self, order: Order) -> None:
        self.order, self.states = order, dict[int, dict[bytes, bytearray]]()
        self.settings = {"bootstrap.servers": order.kafka, "auto.offset.reset": "earliest", "enable.auto.commit": False}
        member = {"group.id": order.group, "group.instance.id": order.member, "session.timeout.ms": SESSION_MS}
        self.consumer = Consumer({**self.settings, **member, "isolation.level": "read_committed"})
        name = {"transactional.id": f"{order.group}.{order.member}", "transaction.timeout.ms": TRANSACTION_MS}
        self.producer = Producer({"bootstrap.servers": order.kafka, **name, "queue.buffering.max.messages": 4 * BATCH_MAX})

    def restore(self, partitions: list[int]) -> dict[int, dict[bytes, bytearray]]:
        """Read the snapshots up to the high watermark: those before the last stable offset are not all of them.

        One consumer for all partitions, whose fetches wait 10 ms: the end of a partition is only reported by an empty fetch.
        """
        settings = {**self.settings, "group.id": "none", "fetch.wait.max.ms": 10, "enable.partition.eof": True}
        places = [TopicPartition(self.order.snapshots, partition, OFFSET_BEGINNING) for partition in partitions]
        looking = Consumer({**settings, "isolation.level": "read_uncommitted"})
        ends = {place.partition: looking.get_watermark_offsets(place, cached=False)[1] for place in places}
        looking.close()
        reader = Consumer({**settings, "isolation.level": "read_committed"})
        reader.assign(places)
        states = {partition: dict[bytes, bytearray]() for partition in partitions}
        left = {partition for partition, end in ends.items() if end > 0}
        while left:
            for taken in reader.consume(1000, 0.05):
                if taken.error() is None:
                    states[taken.partition()][taken.key()] = bytearray(taken.value())
                elif taken.error().code() == KafkaError._PARTITION_EOF and taken.offset() >= ends[taken.partition()]:
                    left.discard(taken.partition())
        reader.close()
        return states

    def assigned(self, consumer: Consumer, places: list[TopicPartition]) -> None:
        """Restore the partitions that come."""
        self.states = self.restore([place.partition for place in places])
        consumer.assign(places)

    def revoked(self, _consumer: Consumer, _places: list[TopicPartition]) -> None:
        """Drop all states: between two batches, so no transaction is open."""
        self.states = {}

    def run(self) -> None:
        """Fold batches until killed."""
        self.producer.init_transactions()
        self.consumer.subscribe([self.order.inputs], on_assign=self.assigned, on_revoke=self.revoked)
        while True:
            if batch := self.consumer.consume(BATCH_MAX, self.order.commit_s):
                self.fold(batch)

    def fold(self, batch: list[Any]) -> None:
        """Fold a batch in one transaction."""
        order, producer, ends = self.order, self.producer, dict[int, int]()
        dirty = set[tuple[int, bytes]]()
        producer.begin_transaction()
        for taken in batch:
            if taken.error():
                raise SystemExit(str(taken.error()))
            partition, key = taken.partition(), taken.key()
            state = self.states[partition].setdefault(key, bytearray(order.state_bytes))
            producer.produce(order.outputs, folded(state, taken.value()), key, partition)
            dirty.add((partition, key))
            ends[partition] = taken.offset() + 1
        for partition, key in dirty:
            producer.produce(order.snapshots, bytes(self.states[partition][key]), key, partition)
        offsets = [TopicPartition(order.inputs, partition, end) for partition, end in ends.items()]
        producer.send_offsets_to_transaction(offsets, self.consumer.consumer_group_metadata())
        producer.commit_transaction()


if __name__ == "__main__":
    Runner(Order.read()).run()
