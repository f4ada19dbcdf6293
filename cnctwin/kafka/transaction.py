"""Transactions of one runner: results, states and offsets go out together, or none of them.

What the cluster says of a failure decides: try again, abort and begin from what was saved, or end, where another runner has taken
this one's name.
"""

import threading
import time
from collections.abc import Callable, Sequence
from functools import partial

from confluent_kafka import Consumer, KafkaError, KafkaException, Message, Producer, TopicPartition

from cnctwin.kafka.client_log import LOG, REACH
from cnctwin.kafka.kept import WRITER
from cnctwin.kafka.settings import Conf, KafkaSettings
from processors.errors import ProcessorError
from sparkplug.records.record import Headers

REQUEST_S = 5.0
HUNG_S = REQUEST_S + 2.0
PAUSE_S = 0.2
MESSAGE_BYTES_MAX = 64 * 1024 * 1024
BUFFER_SHARE = 2  # of the buffer is what one message may fill


class AbortedError(ProcessorError):
    """A transaction came to nothing: what was folded in it has to be folded again."""


class RefusedError(AbortedError):
    """A message is larger than the cluster takes, and would be the next time too."""


class FencedError(ProcessorError):
    """Another runner has this one's name."""


class Transactions:
    """See the module. `is_stopping` ends waiting for a cluster that does not answer."""

    def __init__(self, settings: KafkaSettings, name: str, is_stopping: Callable[[], bool]) -> None:
        self.name = name
        self.committed = self.aborted = 0
        self.is_open = self._is_hung = False
        self._settings, self._is_stopping = settings, is_stopping
        self._refused, self._refused_bytes = "", 0  # what the cluster would not take of the open transaction
        self._producer = self._begun()

    def _begun(self) -> Producer:
        while True:
            self._is_hung = False
            producer = producer_of(
                self._settings, self.name, {"on_delivery": self._not_delivered, "delivery.report.only.error": True}
            )
            try:
                self._insist(partial(producer.init_transactions, REQUEST_S))
            except AbortedError:
                if not self._is_hung or self._is_stopping():
                    raise
            else:
                return producer

    def produce(self, topic: str, key: str, value: bytes | None, partition: int, headers: Headers) -> None:
        """Have a message go out with the transaction, which begins with its first."""
        self.open()
        while True:
            try:
                self._producer.produce(topic, value, key.encode(), partition, headers=headers)
            except BufferError:
                self._producer.poll(PAUSE_S)
                continue
            except KafkaException as error:
                if error.args[0].code() == KafkaError.MSG_SIZE_TOO_LARGE:
                    self._refused = f"{key} has {len(value or b''):,} bytes on {topic}; raise buffer_mb, half of which it exceeds"
                self._failed(error.args[0])
            return

    def _not_delivered(self, error: KafkaError, message: Message) -> None:
        """Note a message that the cluster refuses for its size, of one batch the largest; with it the whole transaction fails."""
        value = message.value()
        if error.code() == KafkaError.MSG_SIZE_TOO_LARGE and isinstance(value, bytes) and len(value) > self._refused_bytes:
            topic, key = message.topic(), message.key()
            name = key.decode("utf-8", "replace") if isinstance(key, bytes) else ""
            self._refused_bytes = len(value)
            self._refused = f"{name} has {len(value):,} bytes; raise max.message.bytes of {topic}, which takes no more"

    def open(self) -> None:
        """Begin a transaction where none is open."""
        if not self.is_open:
            try:
                self._producer.begin_transaction()
            except KafkaException as error:
                self._failed(error.args[0])
            self.is_open = True

    def commit(self, positions: Sequence[TopicPartition], consumer: Consumer) -> None:
        """Commit what was produced, with the consumer's positions. Raises AbortedError, FencedError."""
        self.open()
        member = consumer.consumer_group_metadata()
        self._insist(lambda: self._producer.send_offsets_to_transaction(list(positions), member, REQUEST_S))
        self._insist(lambda: self._producer.commit_transaction(REQUEST_S))
        self._producer.poll(0)  # tells of its troubles
        REACH.answered()
        self.is_open = False
        self.committed += 1

    def abort(self) -> None:
        """Give up what is open. A producer that cannot any more is replaced by another of its name."""
        self.aborted += 1
        self.is_open, self._refused, self._refused_bytes = False, "", 0
        if not self._is_hung:
            try:
                self._answered(lambda: self._producer.abort_transaction(REQUEST_S))
            except (KafkaException, AbortedError):
                pass
            else:
                return
        self._producer = self._begun()

    def _insist(self, ask: Callable[[], object]) -> None:
        """Ask until there is an answer, but no longer than the cluster keeps a transaction."""
        until_s = time.monotonic() + self._settings.transaction_s
        while True:
            try:
                self._answered(ask)
            except KafkaException as error:
                reason = error.args[0]
                LOG.warning("%s: %s", self.name, reason.str())
                is_late = time.monotonic() > until_s
                if not reason.retriable() or reason.txn_requires_abort() or self._is_stopping() or is_late:
                    self._failed(reason)
                time.sleep(PAUSE_S)
            else:
                return

    def _answered(self, ask: Callable[[], object]) -> None:
        """Ask in a thread that may be left behind: where the broker ended in the middle of it, librdkafka may never return."""
        errors: list[BaseException] = []

        def run() -> None:
            try:
                ask()
            except BaseException as error:
                errors.append(error)

        thread = threading.Thread(target=run, daemon=True)
        thread.start()
        thread.join(HUNG_S)
        if thread.is_alive():
            self._is_hung = True
            raise AbortedError(f"no answer, not even a refusal, within {HUNG_S:g} s")
        if errors:
            raise errors[0]

    def _failed(self, reason: KafkaError) -> None:
        """A transaction that took too long is fenced too: whether another runner has the name, the consumer group knows."""
        if reason.code() == KafkaError.FENCED_INSTANCE_ID:
            raise FencedError(f"kafka: {self.name} is taken by another process; give each runner a --member of its own")
        if self._refused:
            raise RefusedError(self._refused)
        raise AbortedError(reason.str())


def producer_of(settings: KafkaSettings, transactional_id: str, more: Conf | None = None) -> Producer:
    """Return a transactional producer. Of how large a message may be the cluster decides, as long as there is room for it."""
    buffer_bytes = round(settings.buffer_mb * 1024 * 1024)
    return Producer(
        settings.client()
        | {"message.max.bytes": min(buffer_bytes // BUFFER_SHARE, MESSAGE_BYTES_MAX)}
        | (more or {})
        | {
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


def written_by(name: str) -> Headers:
    """Return the header that says who wrote a state."""
    return [(WRITER, name.encode())]
