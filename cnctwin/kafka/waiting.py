"""Messages that wait to be folded, by partition: bounded, and each partition has its share of the time.

A unit whose step takes long holds up its own partition. The others go on beside it; what there is no room for stays in the
cluster.
"""

import time
from collections import deque
from collections.abc import Iterator, Sequence

from confluent_kafka import Consumer, Message, TopicPartition

from cnctwin.kafka.assigned import Place

ROOM = 2000  # of each partition, beyond which it is read no further
ROOM_AGAIN = 500


class Waiting:
    """See the module."""

    def __init__(self) -> None:
        self._messages: dict[Place, deque[Message]] = {}
        self._paused: set[Place] = set()

    def __bool__(self) -> bool:
        return any(self._messages.values())

    def add(self, message: Message) -> None:
        """Have a message wait behind those of its partition."""
        place = message.topic() or "", message.partition() or 0
        waiting = self._messages.get(place)
        if waiting is None:
            waiting = self._messages[place] = deque()
        waiting.append(message)

    def due(self, for_s: float) -> Iterator[Message]:
        """Yield messages for so long: of each partition for its share, and one at least. Long ones have what short ones leave."""
        own = sorted((waiting for waiting in self._messages.values() if waiting), key=len)
        end_s = time.monotonic() + for_s
        for left, waiting in zip(range(len(own), 0, -1), own, strict=True):
            now_s = time.monotonic()
            until_s = now_s + max((end_s - now_s) / left, for_s / len(own))
            yield waiting.popleft()
            while waiting and time.monotonic() < until_s:
                yield waiting.popleft()

    def pace(self, consumer: Consumer) -> None:
        """Have the consumer read no partition for which there is no room, and those again for which there is."""
        full = [place for place, waiting in self._messages.items() if len(waiting) > ROOM and place not in self._paused]
        if full:
            consumer.pause(_partitions(full))
            self._paused.update(full)
        again = [place for place in self._paused if len(self._messages.get(place, ())) <= ROOM_AGAIN]
        if again:
            consumer.resume(_partitions(again))
            self._paused.difference_update(again)

    def forget(self, places: Sequence[Place]) -> None:
        """Drop what waits of partitions that have gone."""
        for place in places:
            self._messages.pop(place, None)
            self._paused.discard(place)

    def clear(self) -> None:
        """Drop all that waits; partitions that are read no further stay so until `pace`."""
        self._messages.clear()


def _partitions(places: Sequence[Place]) -> list[TopicPartition]:
    return [TopicPartition(topic, number) for topic, number in places]
