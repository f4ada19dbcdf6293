"""Records to the log: bounded, in order, and counted where there is no room.

While the cluster is away, records wait in memory, as many as there is room for. Then they are dropped, and a hole is told of each
machine before the next record that goes out. Once there is room again, what holds of such a machine by then is told again: values
that changed in the hole may not change for long.
"""

import logging
from collections import Counter, deque
from collections.abc import Sequence

from confluent_kafka import KafkaError, KafkaException, Message, Producer

from cnctwin.kafka.client_log import REACH
from cnctwin.kafka.settings import KafkaSettings
from processors.errors import ProcessorError
from sparkplug.host import Held
from sparkplug.host_event import EventKind, HostEvent
from sparkplug.metric import NodeId
from sparkplug.records.record import Headers, Origin, RecordWriter

RECORD_BYTES = 1500  # that a record of 500 bytes takes in memory
VALUES_SHARE = 2 / 3
UNSAID_MAX = 10_000
FLUSH_S = 10.0
_HOLE = EventKind.HOLE
_log = logging.getLogger(__name__)
FORBIDDEN = (
    KafkaError.TOPIC_AUTHORIZATION_FAILED,
    KafkaError.CLUSTER_AUTHORIZATION_FAILED,
    KafkaError.OUT_OF_ORDER_SEQUENCE_NUMBER,
    KafkaError.UNKNOWN_PRODUCER_ID,
)  # no record that follows fares better
Source = tuple[str, str, NodeId, str]
"""Topic, key, node and device of a record."""
Unsaid = tuple[str, str, int, str]
"""Topic, key and partition of a plain message's record, and the topic of the message."""


class BridgeError(ProcessorError):
    """The bridge can write nothing more, and has to be started again."""


class Lot:
    """The records of one turn, and what is owed to the broker once the cluster has acknowledged all of them."""

    __slots__ = ("held", "outward", "waiting")

    def __init__(self, outward: "Outward") -> None:
        self.outward = outward
        self.waiting = 0
        self.held: Sequence[Held] = ()

    def delivered(self, error: KafkaError | None, message: Message) -> None:
        """Take the report of one record."""
        self.waiting -= 1
        self.outward.delivered_one(error, message)


class Outward:
    """See the module.

    owes: messages are kept by the broker until `take_safe` returns them; else the cluster's reports of what went well, which
        cost as much as the records, are left out
    delivered: the number of records that the cluster had acknowledged at the last `poll`; it never falls
    """

    def __init__(self, settings: KafkaSettings, name: str, *, owes: bool = False) -> None:
        self.dropped = self.failed = self.delivered = 0
        self._sent = self._given_up = 0
        self._name, self._fatal = name, ""
        self._writer = RecordWriter(name)
        self._lost: Counter[Source] = Counter()
        self._untold: dict[tuple[NodeId, str], None] = {}
        self._unsaid: dict[Unsaid, tuple[Headers, bytes]] = {}
        self._full = 0  # records that waited when there was no room
        self._lot = Lot(self)
        self._lots: deque[Lot] = deque()
        self._producer = Producer(
            settings.client()
            | {
                "error_cb": self._on_error,
                "client.id": name,
                "message.max.bytes": settings.message_bytes_max,
                "enable.idempotence": True,
                "acks": "all",
                "delivery.report.only.error": not owes,
                "compression.type": "lz4",
                "linger.ms": 20,
                "partitioner": "murmur2_random",
                "message.timeout.ms": 0,  # a record waits for as long as it takes
                # librdkafka counts values only; headers and its own book-keeping take some 950 bytes a record.
                "queue.buffering.max.messages": round(settings.buffer_mb * 1024 * 1024 / RECORD_BYTES),
                "queue.buffering.max.kbytes": round(settings.buffer_mb * 1024 * VALUES_SHARE),
            }
        )

    @property
    def waiting(self) -> int:
        """The number of records that the cluster has not acknowledged, and of the client's errors that nobody has taken yet."""
        return len(self._producer)

    def put(self, topic: str, key: str, event: HostEvent, received_ms: int, origin: Origin) -> bool:
        """Have an event go out; False where there was no room."""
        device = event.device or ""
        source = topic, key, event.node, device
        if self._lost and (lost := self._lost.get(source)):
            if not self._has_room:  # what is small might find some, and fill it with holes
                return self._drop(source)
            detail = f"{lost} messages of {device} found no room on the way to the log"
            hole = HostEvent(_HOLE, event.node, device, event.timestamp_ms, detail=detail)
            if not self._send(topic, key, *self._writer.written(hole, received_ms, origin._replace(seq=-1))):
                return self._drop(source)
            del self._lost[source]
        failed = self.failed
        if not self._send(topic, key, *self._writer.written(event, received_ms, origin)):
            return self._drop(source)
        if self.failed > failed:  # whoever tells it again fares no better
            self._lost[source] += 1
        return True

    def _drop(self, source: Source) -> bool:
        self.dropped += 1
        self._lost[source] += 1
        self._untold[source[2], source[3]] = None
        return False

    def put_plain(self, topic: str, key: str, partition: int, event: HostEvent, received_ms: int) -> bool:
        """Have a plain message go out to one partition. Of those that find no room the newest of each topic goes out later."""
        headers, value = self._writer.written(event, received_ms, Origin())
        place = topic, key, partition, event.topic
        if self._send(topic, key, headers, value, partition):
            self._unsaid.pop(place, None)
            return True
        self.dropped += place in self._unsaid or len(self._unsaid) >= UNSAID_MAX
        if place in self._unsaid or len(self._unsaid) < UNSAID_MAX:
            self._unsaid[place] = headers, value
        return False

    def watermark(self, topic: str, partition: int, at_ms: int) -> None:
        """Have a watermark go out; one that finds no room is no loss, since the next one says more."""
        self._send(topic, "", self._writer.watermark(at_ms), b"", partition)

    def keep(self, topic: str, key: str, value: bytes | None) -> bool:
        """Have a value kept on a compacted topic."""
        return self._send(topic, key, [], value)

    @property
    def _has_room(self) -> bool:
        """True once half of what waited is gone: room for one record is none."""
        return len(self._producer) <= self._full // 2

    def take_untold(self) -> list[tuple[NodeId, str]]:
        """Return the devices of which something found no room, once there is room again."""
        if not self._untold or not self._has_room:
            return []
        untold, self._untold = list(self._untold), {}
        return untold

    def poll(self) -> None:
        """Have delivery reports come in. Raises BridgeError if nothing can go out any more; the broker then delivers the messages
        that were not acknowledged to the next bridge."""
        self._producer.poll(0)
        if self._fatal:
            raise BridgeError(f"kafka: {self._name} cannot go on: {self._fatal}")
        if (delivered := self._sent - self._given_up - self.waiting) > self.delivered:  # errors that wait must not make it fall
            self.delivered = delivered
            REACH.answered()
        if self._unsaid and self._has_room:
            for place, (headers, value) in list(self._unsaid.items()):
                topic, key, partition, _ = place
                if not self._send(topic, key, headers, value, partition):
                    break
                del self._unsaid[place]

    def close(self) -> int:
        """Wait for what is on its way; return the number of records that were not acknowledged."""
        return int(self._producer.flush(FLUSH_S))

    def _send(self, topic: str, key: str, headers: Headers, value: bytes | None, partition: int = -1) -> bool:
        try:
            self._producer.produce(topic, value, key.encode(), partition, self._lot.delivered, headers=headers)
        except BufferError:
            self._full = len(self._producer)
            self._producer.poll(0)
            return False
        except KafkaException as error:
            if error.args[0].code() == KafkaError._FATAL:
                raise BridgeError(f"kafka: {self._name} cannot go on: {error.args[0].str()}") from error
            self._refused(topic, error.args[0])  # too large, whenever it is tried
            return True
        self._lot.waiting += 1
        self._sent += 1
        return True

    def owe(self, held: Sequence[Held]) -> None:
        """Note that the records since this was last called are of these messages; the broker keeps them until they are safe."""
        if held:
            self._lot.held = held
            self._lots.append(self._lot)
            self._lot = Lot(self)

    def take_safe(self) -> list[Held]:
        """Return the messages whose records the cluster has acknowledged, in the order in which they came."""
        safe: list[Held] = []
        while self._lots and self._lots[0].waiting == 0:
            safe += self._lots.popleft().held
        return safe

    def _on_error(self, error: KafkaError) -> None:
        """Note an error that the producer cannot recover from; it takes no more records after one."""
        if error.fatal():
            self._fatal = error.str()
        else:
            REACH.failed(error)

    def delivered_one(self, error: KafkaError | None, message: Message) -> None:
        """Count a record that the cluster has refused."""
        if error is not None:
            self._given_up += 1
            if error.code() in FORBIDDEN:
                self._fatal = f"{message.topic()}: {error.str()}"
            self._refused(message.topic() or "", error)

    def _refused(self, topic: str, error: KafkaError) -> None:
        self.failed += 1
        _log.warning("kafka: a record on %s is lost: %s", topic, error.str())
