"""Processors as the members of a consumer group: records in, and in one transaction results, states and positions out.

    consume ──► partition.take ──► results ┐
                partition.cut  ──► states  ├─ one transaction ──► commit
                partition.mark ──► offsets ┘

A transaction holds what was folded in one turn. States are cut every `snapshot_s` of each partition; what came between the last
cut and the last commit is folded again in silence after a restart (processors/partition/partition.py). A transaction that comes
to nothing throws away what was folded, and the partitions are restored: there is one way back, whatever failed.
"""

import logging
import time
from collections.abc import Callable, Collection, Sequence
from threading import Event
from typing import Any

from confluent_kafka import Consumer, KafkaError, KafkaException, Message, TopicPartition

from cnctwin.kafka.assigned import Assigned, Place
from cnctwin.kafka.client_log import LOG, REACH
from cnctwin.kafka.health import RunnerHealth
from cnctwin.kafka.settings import KafkaSettings
from cnctwin.kafka.sink import Sink
from cnctwin.kafka.topics import Topics
from cnctwin.kafka.transaction import AbortedError, FencedError, RefusedError, Transactions, written_by
from cnctwin.kafka.waiting import Waiting
from processors.actions import DeadLetter, Pin, PlainOutput
from processors.errors import ConfigurationError, SnapshotError
from processors.partition.partition import Partition
from processors.partition.results import Results
from processors.running.cycles import seldom_looked_for
from processors.running.runtime import Configured
from sparkplug.records.record import Origin, RecordError, RecordWriter

MESSAGES_A_TURN = 1000
POLL_S = 0.05
FOLD_S = 0.5  # of one transaction; what waits then goes into the next one
COMMIT_S = 0.1  # between two transactions, each of which has a marker of each partition
IDLE_S = 1.0  # after which positions are saved although nothing came of the records
PAUSE_S = 1.0
REFUSED_S = 5.0
FETCH_BYTES = 65_536  # for which the cluster waits 50 ms: to answer each few records costs it more than the records
_log = logging.getLogger(__name__)


class Runner:
    """See the module. All of it happens in the thread that calls `run`."""

    def __init__(
        self,
        settings: KafkaSettings,
        topics: Topics,
        pairs: Sequence[Configured],
        member: str,
        sink: Sink | None = None,
        *,
        hold: Callable[[Collection[Place]], None] = lambda _: None,
        transactions: Transactions | None = None,
    ) -> None:
        """`sink`: keeps what the historian hears, with the offsets. `hold`: told of all partitions that this runner has, whenever
        the group has shared them out, and before those that go are another's. `transactions`: that claim the name already."""
        names = [processor.name for processor, _ in pairs]
        self.group = topics.runners(names)
        self._settings, self._topics, self._member, self._sink = settings, topics, member, sink
        self._hold = hold
        self._name = topics.writer(names, member)
        self._claimed = transactions
        self._assigned = Assigned(settings, topics, pairs, None if sink is None else sink.begin)
        self._results = {processor.name: Results(topics.group, processor) for processor, _ in pairs}
        self._writer = RecordWriter(self._name)
        self._waiting = Waiting()
        self._touched: dict[Place, Partition] = {}
        self._folded_s = 0.0
        self._torn = ""  # why the open transaction can come to nothing, found out while partitions went
        self._beyond_help: KafkaError | None = None
        self._stop = Event()
        self._health = RunnerHealth(settings, topics, member, names)

    def run(self, stop: Event) -> None:
        """Work until `stop` is set, then save and leave. Raises FencedError where another process has this member's name."""
        self._stop = stop
        self._transactions = self._claimed or Transactions(self._settings, self._name, stop.is_set)
        self._consumer = Consumer(self._conf())
        self._consumer.subscribe(
            self._assigned.topics, on_assign=self._on_assign, on_revoke=self._on_revoke, on_lost=self._on_lost
        )
        try:
            with seldom_looked_for():
                while not stop.is_set():
                    self.turn()
        finally:
            self._consumer.close()  # partitions are revoked, and so saved
            self._hold(())  # also where it was thrown out
            self._health.close()

    def _conf(self) -> dict[str, Any]:
        session_ms = round(self._settings.session_s * 1000)
        return self._settings.client() | {
            "error_cb": self._on_error,
            "client.id": self._name,
            "group.id": self.group,
            "group.instance.id": self._member,
            "session.timeout.ms": session_ms,
            "heartbeat.interval.ms": max(session_ms // 5, 100),
            "enable.auto.commit": False,
            "isolation.level": "read_committed",
            "auto.offset.reset": "earliest",
            "partition.assignment.strategy": "cooperative-sticky",
            "fetch.wait.max.ms": 50,
            "fetch.min.bytes": FETCH_BYTES,
            "queued.max.messages.kbytes": 32_768,
        }

    # A turn.

    def turn(self) -> None:
        """Take what has come, fold for a while, commit."""
        try:
            if self._torn:
                raise AbortedError(self._torn)
            for message in self._consumer.consume(MESSAGES_A_TURN, 0.0 if self._waiting else POLL_S):
                if (error := message.error()) is None:
                    self._waiting.add(message)
                else:
                    self._complain(error)
            if self._beyond_help is not None:
                self._complain(self._beyond_help)
            for message in self._waiting.due(FOLD_S):
                self._take(message)
            self._waiting.pace(self._consumer)
            self._commit_if_due(time.monotonic())
            self._health.report(time.monotonic(), self._assigned, self._transactions, self._consumer)
        except RefusedError as error:
            self._health.failed(str(error))
            self._begin_again(str(error))
            self._stop.wait(REFUSED_S)  # somebody has to do something
        except AbortedError as error:
            self._begin_again(str(error))

    def _take(self, message: Message) -> None:
        """Fold a message; one that is no record becomes a dead letter, and the partition goes on."""
        found = self._assigned.of(message)
        if found is None:
            return
        partition, offset = found
        place = message.topic() or "", message.partition() or 0
        self._touched[place] = partition
        try:
            record = self._assigned.record(message)
        except RecordError as error:
            partition.next = offset + 1
            self._post(message, f"{place[0]}-{place[1]}@{offset}: {error}")
            return
        self._health.took(place, record)
        if self._sink is not None:
            self._sink.keep(place, offset, record)
        for result in partition.take(offset, record):
            of_processor = self._results[result.seat.name]
            for action in result.actions:
                if isinstance(action, DeadLetter):
                    self._health.dead_letters += 1
                    self._transactions.produce(self._topics.deadletters, action.machine, action.payload, place[1], [])
                elif isinstance(action, Pin):
                    if self._sink is not None:
                        self._sink.pin(action)
                elif (event := of_processor.event(action, result.at_ms)) is not None:
                    retain = isinstance(action, PlainOutput) and action.retain
                    headers, value = self._writer.written(event, record.received_ms, Origin(), retain=retain)
                    headers.append(("processor", result.seat.name.encode()))
                    self._transactions.produce(self._topics.results, event.device or result.seat.name, value, place[1], headers)

    def _post(self, message: Message, why: str) -> None:
        """Put what cannot be read aside, as it came."""
        _log.warning("%s", why)
        self._health.dead_letters += 1
        key, value = message.key(), message.value()
        name = key.decode("utf-8", "replace") if isinstance(key, bytes) else ""
        self._transactions.produce(
            self._topics.deadletters,
            name,
            value if isinstance(value, bytes) else b"",
            message.partition() or 0,
            [("error", why.encode())],
        )

    # Commits.

    def _commit_if_due(self, now_s: float) -> None:
        if self._touched and now_s - self._folded_s >= (COMMIT_S if self._transactions.is_open else IDLE_S):
            self._commit(now_s, list(self._assigned.due(now_s, touched=self._touched)))

    def _commit(self, now_s: float, cuts: Sequence[Place]) -> None:
        """Commit what was folded, with the states of some partitions."""
        if self._sink is not None:
            self._sink.write()
        for place in cuts:
            if (partition := self._assigned.partitions.get(place)) is not None:
                for key, payload in partition.cut():
                    self._transactions.produce(self._topics.snapshots, key, payload, place[1], written_by(self._name))
        positions = []
        for (topic, number), partition in self._touched.items():
            key, payload = partition.mark()
            self._transactions.produce(self._topics.snapshots, key, payload, number, written_by(self._name))
            positions.append(TopicPartition(topic, number, partition.next))
            for fault in partition.faults():
                _log.warning("%s", fault)
                self._health.failed(fault)
        self._transactions.commit(positions, self._consumer)
        self._touched.clear()
        self._folded_s = now_s

    def _begin_again(self, why: str) -> None:
        """Throw away what was folded and not committed, and restore."""
        LOG.warning("a transaction has come to nothing, what it held is folded again: %s", why)
        self._torn = ""
        self._waiting.clear()
        self._touched.clear()
        self._transactions.abort()
        try:
            self._transactions.claim()
        except AbortedError as error:  # the cluster does not answer, and we are to stop: it aborts what is open by itself
            if not self._stop.is_set():
                raise
            _log.warning("not aborted: %s", error)
            return
        places = list(self._assigned.partitions)
        while not self._stop.is_set():
            try:
                for position in self._assigned.restore(places):
                    self._consumer.seek(position)
            except (SnapshotError, KafkaException) as error:
                LOG.warning("not restored yet: %s", error)
                self._stop.wait(PAUSE_S)
            else:
                return

    def _on_error(self, error: KafkaError) -> None:
        """A consumer that is beyond help reads nothing more, and does not always say so among the messages."""
        if error.fatal() or error.code() in (KafkaError._FATAL, KafkaError.INVALID_SESSION_TIMEOUT):
            self._beyond_help = error
        else:
            REACH.failed(error)

    def _complain(self, error: KafkaError) -> None:
        if error.code() == KafkaError.FENCED_INSTANCE_ID or "fenced" in error.str().lower():
            raise FencedError(f"kafka: {self._name} is taken by another process; give each runner a --member of its own")
        if error.code() == KafkaError.INVALID_SESSION_TIMEOUT:
            limits = "between group.min.session.timeout.ms and group.max.session.timeout.ms of the cluster"
            raise ConfigurationError(f"kafka: session_s = {self._settings.session_s:g} is refused; give one {limits}")
        if error.fatal() or error.code() == KafkaError._FATAL:
            raise KafkaException(error)
        LOG.warning("kafka: %s", error.str())

    # Rebalances: called while the consumer polls, between two transactions.

    def _on_assign(self, consumer: Consumer, partitions: list[TopicPartition]) -> None:
        self._health.rebalances += 1
        if partitions:
            self._transactions.claim()  # what the one before writes late comes to nothing
            consumer.incremental_assign(self._assigned.restore([(one.topic, one.partition) for one in partitions]))
        self._hold(self._assigned.partitions.keys())

    def _on_revoke(self, consumer: Consumer, partitions: list[TopicPartition]) -> None:
        """Save the states as they are: whoever has them next folds nothing twice."""
        self._health.rebalances += 1
        places = [(one.topic, one.partition) for one in partitions]
        try:
            mine = {place: one for place in places if (one := self._assigned.partitions.get(place)) is not None and one.next}
            if mine:
                self._touched |= mine
                self._commit(time.monotonic(), list(mine))
        except (AbortedError, KafkaException) as error:
            _log.warning("the partitions are handed over as they were committed before: %s", error)
            self._torn = str(error)
        self._forget(places)
        self._hold(self._assigned.partitions.keys())
        if partitions:
            consumer.incremental_unassign(partitions)

    def _on_lost(self, consumer: Consumer, partitions: list[TopicPartition]) -> None:
        """Another runner has them by now: nothing of them is to be saved."""
        if self._transactions.is_open:
            self._torn = "partitions were lost to another runner"
        self._forget([(one.topic, one.partition) for one in partitions])
        consumer.incremental_unassign(partitions)

    def _forget(self, places: Sequence[Place]) -> None:
        self._assigned.drop(places)
        gone = set(places)
        for place in gone & self._touched.keys():
            del self._touched[place]
        self._waiting.forget(places)
