"""Both ends of a trial: a feed of numbered messages, and a reader of the outputs that are committed."""

import time

from confluent_kafka import OFFSET_BEGINNING, Consumer, Producer, TopicPartition
from confluent_kafka.admin import AdminClient, NewTopic

from benchmarks.stream_engines.fold import PARTITIONS, key_of, message
from benchmarks.stream_engines.ledger import Ledger


def create(admin: AdminClient, name: str, *, compacted: bool = False) -> None:
    """Create a topic and wait for it."""
    config = {"cleanup.policy": "compact"} if compacted else {}
    for done in admin.create_topics([NewTopic(name, PARTITIONS, 1, config=config)]).values():
        done.result(30.0)


class Feed:
    """The input: messages in their order, at once in one transaction or at a rate."""

    def __init__(self, kafka: str, topic: str) -> None:
        self.topic, self.sent = topic, 0
        settings = {"bootstrap.servers": kafka, "queue.buffering.max.messages": 1_000_000}
        self._paced = Producer({**settings, "enable.idempotence": True, "linger.ms": 2})
        self._at_once = Producer({**settings, "transactional.id": f"feed.{topic}", "transaction.timeout.ms": 300_000})
        self._at_once.init_transactions(30.0)

    def _produce(self, producer: Producer, until: int) -> None:
        for number in range(self.sent, until):
            key = key_of(number)
            producer.produce(self.topic, message(number), f"vmc-{key:02}".encode(), key % PARTITIONS)
        self.sent = max(self.sent, until)

    def lay(self, until: int) -> None:
        """Write messages that nobody sees before `show`."""
        self._at_once.begin_transaction()
        self._produce(self._at_once, until)
        self._at_once.flush(120.0)

    def show(self) -> None:
        """Make them visible, all at once."""
        self._at_once.commit_transaction(60.0)

    def keep_pace(self, began_s: float, per_s: float, messages: int, base: int = 0) -> None:
        """Send what is due by now."""
        self._produce(self._paced, min(messages, base + int(per_s * (time.monotonic() - began_s))))
        self._paced.poll(0)

    def flush(self) -> None:
        """Wait until all are written."""
        self._paced.flush(60.0)


class Reader:
    """A read_committed consumer of the outputs that enters them into a ledger."""

    def __init__(self, kafka: str, topic: str, ledger: Ledger) -> None:
        self.ledger = ledger
        self._consumer = Consumer({"bootstrap.servers": kafka, "group.id": "reader", "isolation.level": "read_committed"})
        self._consumer.assign([TopicPartition(topic, partition, OFFSET_BEGINNING) for partition in range(PARTITIONS)])

    def read(self, wait_s: float = 0.02) -> int:
        """Read what is there; return how many messages had their first output in it."""
        taken = self._consumer.consume(5000, wait_s)
        for one in taken:
            if one.error():
                raise RuntimeError(f"reading the outputs: {one.error()}")
        return sum(self.ledger.take(one.value()) for one in taken)

    def close(self) -> None:
        """Leave."""
        self._consumer.close()
