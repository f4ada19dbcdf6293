"""The log of a kill run, read completely by a reader of no group, from the first offset to the last."""

import time
from collections.abc import Iterator
from typing import Any

from confluent_kafka import OFFSET_BEGINNING, Consumer, KafkaError, KafkaException, Message, TopicPartition

READ_S_MAX = 60.0


def reader(bootstrap: str) -> Consumer:
    """Return a consumer that reads what is committed, and is told of the end of a partition."""
    return Consumer(
        {
            "bootstrap.servers": bootstrap,
            "group.id": "kill-run-reader",  # librdkafka wants one; nothing is committed under it
            "enable.auto.commit": False,
            "isolation.level": "read_committed",
            "enable.partition.eof": True,
            "queued.max.messages.kbytes": 16_384,
            "log_level": 0,
        }
    )


def messages(bootstrap: str, topic: str, number: int) -> Iterator[Message]:
    """Yield all messages of a partition. Raises SystemExit where a transaction is open at its end, or nothing comes."""
    consumer = reader(bootstrap)
    place = TopicPartition(topic, number)
    _, high = consumer.get_watermark_offsets(place, READ_S_MAX)
    consumer.assign([TopicPartition(topic, number, OFFSET_BEGINNING)])
    heard_s = time.monotonic()
    try:
        while True:
            found = consumer.consume(2000, 0.2)  # waits until there are so many
            if found:
                heard_s = time.monotonic()
            elif time.monotonic() - heard_s > READ_S_MAX:
                raise SystemExit(f"{topic}-{number}: nothing comes for {READ_S_MAX:g} s")
            for message in found:
                error = message.error()
                if error is None:
                    yield message
                elif error.code() == KafkaError._PARTITION_EOF:
                    if (message.offset() or 0) < high:
                        raise SystemExit(f"{topic}-{number}: ends at {message.offset()} of {high}: a transaction is open")
                    return
                elif not error.retriable():
                    raise KafkaException(error)
    finally:
        consumer.close()


def headers_of(message: Message) -> list[tuple[str, Any]]:
    """Return the headers of a message."""
    headers: Any = message.headers()
    return list(headers or ())


def behind(bootstrap: str, group: str, names: list[str], partitions: int) -> int:
    """Return how many records a consumer group has not committed yet. Ends the program where the cluster does not say."""
    consumer = Consumer({"bootstrap.servers": bootstrap, "group.id": group, "enable.auto.commit": False, "log_level": 0})
    try:
        places = [TopicPartition(name, number) for name in names for number in range(partitions)]
        waiting = 0
        for one in consumer.committed(places, READ_S_MAX):
            _, high = consumer.get_watermark_offsets(TopicPartition(one.topic, one.partition), READ_S_MAX)
            waiting += high - max(one.offset, 0)
    except KafkaException as error:
        raise SystemExit(f"the cluster does not say what {group} has committed: {error.args[0].str()}") from error
    else:
        return waiting
    finally:
        consumer.close()
