"""Transactions of one runner: results, states and offsets go out together, or none of them.

What the cluster says of a failure decides: try again, abort and begin from what was saved, or end, where another runner has taken
this one's name.
"""

import time
from collections.abc import Callable, Mapping, Sequence
from functools import partial
from typing import TYPE_CHECKING, Any, NoReturn

from confluent_kafka import Consumer, KafkaError, KafkaException, Message, Producer, TopicPartition

from cnctwin.kafka.client_log import LOG, REACH
from cnctwin.kafka.kept import WRITER
from cnctwin.kafka.request import HungError, Request
from cnctwin.kafka.settings import KafkaSettings
from processors.errors import ProcessorError

if TYPE_CHECKING:
    from sparkplug.records.record import Headers

REQUEST_S = 5.0
HUNG_S, HUNG_S_MAX = 2.0, 30.0  # for an answer of a cluster that has just taken messages; doubled each time that none comes
CLAIM_S = REQUEST_S + 2.0
CUT = (KafkaError._TRANSPORT, KafkaError._ALL_BROKERS_DOWN)
PURGED = (KafkaError._PURGE_QUEUE, KafkaError._PURGE_INFLIGHT)  # of a transaction that was given up
PAUSE_S = 0.2


class AbortedError(ProcessorError):
    """A transaction came to nothing: what was folded in it has to be folded again."""


class RefusedError(AbortedError):
    """A message is larger than the cluster takes, and would be the next time too."""


class FencedError(ProcessorError):
    """Another runner has this one's name."""


class Transactions:
    """See the module. `is_stopping` ends waiting for a cluster that does not answer.

    The name is claimed in the background, since the cluster takes half a second to end what the one before has left open. A
    producer that has lost a broker is replaced by another that claims the name: librdkafka goes on to ask the coordinator of
    offsets by a connection that is gone for good, and never returns.
    """

    def __init__(self, settings: KafkaSettings, name: str, is_stopping: Callable[[], bool]) -> None:
        self.name = name
        self.committed = self.aborted = 0
        self.is_open = False
        self._settings, self._is_stopping = settings, is_stopping
        self._patience_s = HUNG_S
        self._undelivered = ""
        self._refused, self._refused_bytes = "", 0  # what the cluster would not take of the open transaction
        self._begin()

    def _begin(self) -> None:
        """Have another producer claim the name."""
        self._is_spoilt = False
        self._claimant: Producer | None = None
        self._claim = Request(self._claimed)

    @property
    def _producer(self) -> Producer:
        if self._claimant is None:
            self._claimant = self._claim.answer()
            self._claimant.poll(0.0)  # that the cluster was away while it tried is no news
            self._is_spoilt = False
        return self._claimant

    def claim(self) -> None:
        """Wait until the name is ours: nobody else writes under it from now on. Raises AbortedError when we stop."""
        _ = self._producer

    def _claimed(self) -> Producer:
        """Return a producer that has the name to itself, however long the cluster is away. Raises AbortedError when we stop."""
        producer = self._made()
        while True:
            try:
                Request(partial(producer.init_transactions, REQUEST_S)).answer(CLAIM_S)
            except HungError as error:
                self._not_claimed(error)
                producer = self._made()
            except KafkaException as error:
                reason = error.args[0]
                self._not_claimed(reason.str())
                if not reason.retriable():
                    raise AbortedError(f"{self.name}: {reason.str()}") from error
            else:
                return producer

    def _made(self) -> Producer:
        told = {"error_cb": self._on_error, "on_delivery": self._not_delivered, "delivery.report.only.error": True}
        return producer_of(self._settings, self.name, told)

    def _not_claimed(self, why: object) -> None:
        if self._is_stopping():
            raise AbortedError(f"{self.name} is not claimed: {why}")
        LOG.warning("%s is not claimed yet: %s", self.name, why)
        time.sleep(PAUSE_S)

    def _on_error(self, error: KafkaError) -> None:
        self._is_spoilt = self._is_spoilt or error.code() in CUT
        REACH.failed(error)

    def produce(self, topic: str, key: str, value: bytes | None, partition: int, headers: "Headers") -> None:
        """Have a message go out with the transaction, which begins with its first."""
        self.open()
        while True:
            try:
                self._producer.produce(topic, value, key.encode(), partition, headers=headers)
            except BufferError:
                self._producer.poll(PAUSE_S)
                self._raise_if_lost()
                continue
            except KafkaException as error:
                if error.args[0].code() == KafkaError.MSG_SIZE_TOO_LARGE:
                    self._refused = f"{key} has {len(value or b''):,} bytes on {topic}; raise buffer_mb, half of which it exceeds"
                self._failed(error.args[0])
            return

    def _not_delivered(self, error: KafkaError, message: Message) -> None:
        """Note that a message does not go out, and with it the whole transaction; of those that are too large, the largest."""
        if error.code() in PURGED:
            return
        self._undelivered = error.str()
        value = message.value()
        if error.code() == KafkaError.MSG_SIZE_TOO_LARGE and isinstance(value, bytes) and len(value) > self._refused_bytes:
            topic, key = message.topic(), message.key()
            name = key.decode("utf-8", "replace") if isinstance(key, bytes) else ""
            self._refused_bytes = len(value)
            self._refused = f"{name} has {len(value):,} bytes; raise max.message.bytes of {topic}, which takes no more"

    def open(self) -> None:
        """Begin a transaction where none is open."""
        if not self.is_open:
            self._undelivered = ""
            try:
                self._producer.begin_transaction()
            except KafkaException as error:
                self._failed(error.args[0])
            self.is_open = True

    def commit(self, positions: Sequence[TopicPartition], consumer: Consumer) -> None:
        """Commit what was produced, with the consumer's positions. Raises AbortedError, FencedError."""
        self.open()
        producer = self._producer
        self._flush(producer)
        member = consumer.consumer_group_metadata()
        self._ask(lambda: producer.send_offsets_to_transaction(list(positions), member, REQUEST_S))
        self._ask(lambda: producer.commit_transaction(REQUEST_S))
        producer.poll(0)  # tells of its troubles
        REACH.answered()
        self.is_open = False
        self.committed += 1
        self._patience_s = HUNG_S

    def _flush(self, producer: Producer) -> None:
        """Wait until the cluster has all messages, but no longer than it keeps a transaction: one that is slow is not gone."""
        until_s = time.monotonic() + self._settings.transaction_s
        try:
            while producer.flush(PAUSE_S) and not self._is_stopping() and time.monotonic() < until_s:
                self._raise_if_lost()
        except KafkaException as error:
            self._failed(error.args[0])
        self._raise_if_lost()

    def _ask(self, request: Callable[[], object]) -> None:
        """Ask once. If the transaction went through without an answer, the states that are restored say so. Raises AbortedError,
        FencedError."""
        try:
            Request(request).answer(self._patience_s)
        except KafkaException as error:
            self._failed(error.args[0])
        except HungError as error:
            self._is_spoilt, self._patience_s = True, min(2.0 * self._patience_s, HUNG_S_MAX)
            raise AbortedError(str(error)) from error

    def _raise_if_lost(self) -> None:
        if self._refused:
            raise RefusedError(self._refused)
        if self._undelivered:
            raise AbortedError(self._undelivered)
        if self._is_spoilt:
            raise AbortedError("the connection to a broker is lost")

    def abort(self) -> None:
        """Give up what is open."""
        self.aborted += 1
        self.is_open, self._refused, self._refused_bytes = False, "", 0
        if not self._is_spoilt:
            producer = self._producer
            try:
                self._ask(lambda: producer.abort_transaction(REQUEST_S))
            except AbortedError:
                pass
            else:
                return
        self._begin()

    def _failed(self, reason: KafkaError) -> NoReturn:
        """A transaction that took too long is fenced too: whether another runner has the name, the consumer group knows."""
        if reason.code() == KafkaError.FENCED_INSTANCE_ID:
            raise FencedError(f"kafka: {self.name} is taken by another process; give each runner a --member of its own")
        if self._refused:
            raise RefusedError(self._refused)
        self._is_spoilt = True
        raise AbortedError(reason.str())


def producer_of(settings: KafkaSettings, transactional_id: str, more: Mapping[str, Any] | None = None) -> Producer:
    """Return a transactional producer. Of how large a message may be the cluster decides, as long as there is room for it."""
    return Producer(
        settings.client()
        | dict(more or {})
        | {
            "client.id": transactional_id,
            "message.max.bytes": settings.message_bytes_max,
            "transactional.id": transactional_id,
            "transaction.timeout.ms": round(settings.transaction_s * 1000),
            "message.timeout.ms": round(settings.transaction_s * 1000),
            "compression.type": "lz4",
            "linger.ms": 2,
            "partitioner": "murmur2_random",
            "queue.buffering.max.kbytes": round(settings.buffer_mb * 1024),
        }
    )


def fence(settings: KafkaSettings, transactional_id: str) -> None:
    """Take the name of a writer that is gone, for a moment: the cluster aborts what it left open."""
    producer_of(settings, transactional_id).init_transactions(REQUEST_S)


def written_by(name: str) -> "Headers":
    """Return the header that says who wrote a state."""
    return [(WRITER, name.encode())]
