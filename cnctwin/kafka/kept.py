"""Compacted partitions, read from the beginning to the high watermark: the newest value of each key.

Not to the last stable offset: behind the open transaction of a writer that died, committed values may stand. Whoever reads has to
wait until that transaction has ended. It ends by its time-out, or at once where the dead writer's name is taken (`Fence`).
"""

import logging
import time
from collections.abc import Callable, Sequence
from typing import Any, TypeVar

from confluent_kafka import OFFSET_BEGINNING, Consumer, KafkaError, KafkaException, Message, TopicPartition

from cnctwin.kafka.client_log import LOG
from cnctwin.kafka.settings import Conf
from processors.errors import SnapshotError

ANSWER_S = 10.0
POLL_S = 0.2
READ_S = 0.02  # for which a thousand messages are waited for: what has come by then is taken
STUCK_S = 0.3  # behind the end without anything new: a transaction is open
WRITER = "writer"
NOT_READY = (
    KafkaError.NOT_LEADER_FOR_PARTITION,
    KafkaError.LEADER_NOT_AVAILABLE,
    KafkaError.UNKNOWN_TOPIC_OR_PART,
    KafkaError.NOT_COORDINATOR,
    KafkaError.COORDINATOR_NOT_AVAILABLE,
    KafkaError.COORDINATOR_LOAD_IN_PROGRESS,
    KafkaError._WAIT_COORD,
)
T = TypeVar("T")
Kept = dict[int, dict[str, bytes]]
Fence = Callable[[str], None]
"""Ends the transaction of a writer that is gone; does nothing for one that lives."""
_log = logging.getLogger(__name__)


def read_kept(
    client: Conf,
    topic: str,
    partitions: Sequence[int],
    *,
    timeout_s: float,
    fence: Fence = lambda _: None,
    told: Callable[[int, str, int], None] = lambda *_: None,
) -> Kept:
    """Return what is kept in some partitions of a topic. Raises SnapshotError where their end is not reached in time.

    told: hears partition, key and time stamp, ms since 1970, of each message
    """
    common = client | {"group.id": _group_of(topic), "enable.auto.commit": False, "auto.offset.reset": "earliest"}
    uncommitted = Consumer(common | {"isolation.level": "read_uncommitted"})
    consumer = Consumer(common | {"isolation.level": "read_committed", "enable.partition.eof": True, "fetch.wait.max.ms": 20})
    try:
        marks = {number: _watermarks(uncommitted, topic, number, timeout_s) for number in partitions}
        for number in partitions[:1]:  # connects: a consumer that is only told what to read waits half a second for the topic
            _watermarks(consumer, topic, number, timeout_s)
        ends = {number: high for number, (low, high) in marks.items() if high > low}
        return _read(consumer, uncommitted, _Reading(topic, ends, partitions, told), topic, timeout_s=timeout_s, fence=fence)
    except KafkaException as error:
        raise SnapshotError(f"{topic}: {error.args[0].str()}") from error
    finally:
        consumer.close()
        uncommitted.close()


def fence_open(client: Conf, topic: str, partitions: Sequence[int], *, timeout_s: float, fence: Fence) -> None:
    """Fence whoever has a transaction open in some partitions: until it ends, nobody who reads what is committed sees what comes
    behind it. Raises SnapshotError where the cluster does not answer in time."""
    common = client | {"group.id": _group_of(topic), "enable.auto.commit": False}
    uncommitted = Consumer(common | {"isolation.level": "read_uncommitted"})
    committed = Consumer(common | {"isolation.level": "read_committed"})
    try:
        ends = {number: _watermarks(uncommitted, topic, number, timeout_s)[1] for number in partitions}
        stable = {number: _watermarks(committed, topic, number, timeout_s)[1] for number in partitions}
        begins = {number: at for number, at in stable.items() if at < ends[number]}
        for writer in _writers(uncommitted, topic, begins, ends) if begins else ():
            fence(writer)
    except KafkaException as error:
        raise SnapshotError(f"{topic}: {error.args[0].str()}") from error
    finally:
        committed.close()
        uncommitted.close()


def ends_of(client: Conf, places: Sequence[tuple[str, int]], *, timeout_s: float) -> dict[tuple[str, int], int]:
    """Return the offset behind the last message of each partition. Raises SnapshotError where the cluster does not answer."""
    if not places:
        return {}
    own = {"group.id": _group_of(places[0][0]), "enable.auto.commit": False, "isolation.level": "read_uncommitted"}
    consumer = Consumer(client | own)
    try:
        return {(topic, number): _watermarks(consumer, topic, number, timeout_s)[1] for topic, number in places}
    except KafkaException as error:
        raise SnapshotError(f"{places[0][0]}: {error.args[0].str()}") from error
    finally:
        consumer.close()


def _group_of(topic: str) -> str:
    """Return a consumer group that nobody joins, of a name that both bridges and runners may use (deploy/kafka/acls).

    >>> _group_of("cnctwin.cnc.snapshots"), _group_of("cnctwin.hall.2.cells.alerts")
    ('cnctwin.cnc.bridge.read', 'cnctwin.hall.2.bridge.read')
    """
    plant = topic.partition(".cells.")[0] if ".cells." in topic else topic.rpartition(".")[0]
    return f"{plant}.bridge.read"


def answered(ask: Callable[[], T | None], timeout_s: float) -> T:
    """Ask until the cluster answers: one that has just started, or changed, is not ready for a moment. Raises KafkaException."""
    until_s = time.monotonic() + timeout_s
    while True:
        try:
            found = ask()
        except KafkaException as error:
            reason = error.args[0]
            if not (reason.retriable() or reason.code() in NOT_READY) or time.monotonic() > until_s:
                raise
            LOG.warning("kafka: %s", reason.str())
        else:
            if found is not None:
                return found
            if time.monotonic() > until_s:
                raise KafkaException(KafkaError(KafkaError._TIMED_OUT))
        time.sleep(POLL_S)


def _watermarks(consumer: Consumer, topic: str, number: int, timeout_s: float) -> tuple[int, int]:
    """Return the first offset of a partition and the one behind its last; waits while it has no leader."""
    return answered(lambda: consumer.get_watermark_offsets(TopicPartition(topic, number), ANSWER_S), timeout_s)


class _Reading:
    """The reading of some partitions, as far as it has come."""

    def __init__(
        self, topic: str, ends: dict[int, int], partitions: Sequence[int], told: Callable[[int, str, int], None]
    ) -> None:
        self.kept: Kept = {number: {} for number in partitions}
        self.reached = dict.fromkeys(ends, 0)
        self.news_s = time.monotonic()
        self._topic, self.ends, self._told = topic, ends, told

    @property
    def behind(self) -> dict[int, int]:
        """Return the partitions whose end is not reached, and how far they have come."""
        return {number: at for number, at in self.reached.items() if at < self.ends[number]}

    def take(self, message: Message) -> None:
        """Take a message, or the news that there are no more for now."""
        number, error = message.partition() or 0, message.error()
        if error is None:
            self.news_s = time.monotonic()
            raw, value = message.key(), message.value()
            key = raw.decode("utf-8", "replace") if isinstance(raw, bytes) else ""
            self._told(number, key, message.timestamp()[1])
            if isinstance(value, bytes):
                self.kept[number][key] = value
            else:
                self.kept[number].pop(key, None)
        elif error.code() == KafkaError._PARTITION_EOF:
            self.reached[number] = max(self.reached[number], message.offset() or 0)
        elif not error.retriable():
            raise KafkaException(error)


def _read(consumer: Consumer, uncommitted: Consumer, reading: _Reading, topic: str, *, timeout_s: float, fence: Fence) -> Kept:
    consumer.assign([TopicPartition(topic, number, OFFSET_BEGINNING) for number in reading.ends])
    began_s = time.monotonic()
    is_fenced = False
    while behind := reading.behind:
        if time.monotonic() - began_s > timeout_s:
            raise SnapshotError(f"{topic}: the end of partitions {list(behind)} is not reached within {timeout_s:g} s")
        for message in consumer.consume(1000, READ_S):
            reading.take(message)
        if not is_fenced and any(behind.values()) and time.monotonic() - reading.news_s > STUCK_S:
            is_fenced = True
            stuck = {number: at for number, at in reading.behind.items() if at}
            for writer in _writers(uncommitted, topic, stuck, reading.ends):
                _log.warning("%s: a transaction of %s is open", topic, writer)
                fence(writer)
    return reading.kept


def _writers(consumer: Consumer, topic: str, begins: dict[int, int], ends: dict[int, int]) -> set[str]:
    """Return who wrote what stands behind the last stable offset."""
    writers: set[str] = set()
    consumer.assign([TopicPartition(topic, number, begin) for number, begin in begins.items()])
    until_s = time.monotonic() + ANSWER_S
    left = set(begins)
    while left and time.monotonic() < until_s:
        messages = consumer.consume(1000, POLL_S)
        for message in messages:
            if (error := message.error()) is None:
                told: dict[str, Any] = dict(message.headers() or ())
                writers.add(told.get(WRITER, b"").decode())
                if (message.offset() or 0) >= ends[message.partition() or 0] - 1:
                    left.discard(message.partition() or 0)
            elif error.code() == KafkaError.TOPIC_AUTHORIZATION_FAILED:
                raise KafkaException(error)
        if not messages:
            break
    writers.discard("")
    return writers
