"""Results of the log as edge nodes on the broker: births, wills and aliases as where a processor publishes them itself.

A bridge that begins has to give birth to twin devices whose values were told before it was there. What was known at the last
cut is in the saved states; what came since is read from the results, and told nobody again. From where the bridge before stopped
on, results go out as they come.
"""

import json
import logging
import time
from collections.abc import Iterator, Mapping, Sequence
from typing import Any

from confluent_kafka import Consumer, KafkaError, KafkaException, TopicPartition

from cnctwin.kafka.client_log import LOG
from cnctwin.kafka.groups import published_up_to
from cnctwin.kafka.kept import answered, read_kept
from cnctwin.kafka.request import closed
from cnctwin.kafka.settings import KafkaSettings
from cnctwin.kafka.topics import Topics
from processors.actions import Action, Declare
from processors.errors import SnapshotError
from processors.partition.partition import LIVES
from processors.partition.results import action_of
from processors.running.containment import one_line
from processors.running.counts import Counts
from processors.running.ports import EdgePort, HostPort
from processors.running.runtime import Configured
from processors.running.sender import Sender
from processors.running.snapshot import latest_of
from sparkplug.errors import PayloadError
from sparkplug.records.record import PLAIN, RecordReader

ANSWER_S = 10.0
COMMIT_S = 1.0
RESULTS_A_TURN = 1000
CUT_MS_MAX, CUTS = 60_000, 2.0  # before now, of a set of runners that has ended since; at least two cuts
READY_S_MAX = 60.0
CATCH_UP_S, CATCH_UP_S_MAX = 0.02, 60.0
_log = logging.getLogger(__name__)


class Back:
    """See the module. `nodes` are the edge nodes of the processors, by name; all belong to the bridge's own thread."""

    def __init__(
        self,
        settings: KafkaSettings,
        topics: Topics,
        name: str,
        pairs: Sequence[Configured],
        *,
        host: HostPort,
        nodes: Mapping[str, EdgePort],
    ) -> None:
        self.published = self.unreadable = 0
        self.counts = Counts()
        self._settings, self._topics = settings, topics
        self._qos = {spec.prefix: spec.qos for processor, _ in pairs for spec in processor.plain}
        self._senders = {
            processor.name: Sender(processor, host, nodes[processor.name], alarmed=lambda _: None, pin=lambda _: None)
            for processor, _ in pairs
        }
        self._records = RecordReader()
        self._committed_s = 0.0
        self._consumer = Consumer(
            settings.client()
            | {
                "group.id": topics.bridge(name),
                "enable.auto.commit": False,
                "isolation.level": "read_committed",
                "auto.offset.reset": "earliest",
                "enable.partition.eof": True,
                "fetch.wait.max.ms": 50,
            }
        )
        self._next: dict[int, int] = {}

    def begin(self) -> None:
        """Learn what is known by now, before the edge nodes are started. Raises SnapshotError where the log does not answer."""
        numbers = range(self._settings.partitions)
        cuts = _Cuts(self._settings.snapshot_s)
        kept = read_kept(self._settings.client(), self._topics.snapshots, list(numbers), timeout_s=120.0, told=cuts.note)
        for of_partition in kept.values():
            for machine, name, action in _declared(of_partition):
                if (sender := self._senders.get(name)) is not None and machine:
                    sender.apply([action], self.counts)
        own = [TopicPartition(self._topics.results, number) for number in numbers]
        at_cut = [TopicPartition(self._topics.results, number, cuts.oldest_ms(number)) for number in numbers]
        try:
            committed = answered(lambda: self._consumer.committed(own, ANSWER_S), READY_S_MAX)
            stopped = {one.partition: one.offset for one in committed if one.offset >= 0}
            if not stopped and (stopped := published_up_to(self._settings, self._topics)):
                _log.warning("this bridge is new; it publishes what no other bridge has published")
            since = answered(lambda: self._consumer.offsets_for_times(at_cut, ANSWER_S), READY_S_MAX)
        except KafkaException as error:
            raise SnapshotError(f"{self._topics.results}: {error.args[0].str()}") from error
        stopped = dict.fromkeys(numbers, -1) | stopped
        begin = [self._from(one.partition, one.offset, stopped[one.partition]) for one in since]
        self._consumer.assign(begin)
        self._catch_up({one.partition: one.offset for one in begin}, stopped)

    def _from(self, number: int, since: int, stopped: int) -> TopicPartition:
        """Return from where results are read: what came since the last cut, but at least what did not go out."""
        if stopped < 0:  # no bridge ever was: nobody was told anything
            return TopicPartition(self._topics.results, number, 0)
        offset = stopped if since < 0 else min(since, stopped)
        return TopicPartition(self._topics.results, number, offset)

    def _catch_up(self, begins: Mapping[int, int], stopped: Mapping[int, int]) -> None:
        """Take results that went out before; nothing goes out, since no node is online."""
        self._next = dict(begins)
        until_s = time.monotonic() + CATCH_UP_S_MAX
        while behind := [number for number in begins if self._next[number] < stopped[number]]:
            if time.monotonic() > until_s:
                raise SnapshotError(f"{self._topics.results}: partitions {behind} are not read within {CATCH_UP_S_MAX:g} s")
            self.turn(CATCH_UP_S, is_live=False)
        for number, stop in stopped.items():
            if 0 <= stop < self._next[number]:  # of these nobody was told: they are read again when somebody can be
                self._next[number] = stop
                self._consumer.seek(TopicPartition(self._topics.results, number, stop))

    def turn(self, timeout_s: float = 0.0, *, is_live: bool = True) -> int:
        """Publish what has come; return how many results. Where nobody can be told, only what a birth is to hold is read."""
        messages = self._consumer.consume(RESULTS_A_TURN, timeout_s)
        told: dict[Sender, list[Action]] = {}
        for message in messages:
            number, offset = message.partition() or 0, message.offset() or 0
            if (error := message.error()) is not None:
                if error.code() == KafkaError._PARTITION_EOF:  # behind the ends of transactions, which are no messages
                    self._next[number] = offset
                else:
                    LOG.warning("kafka: %s", error.str())
                continue
            self._next[number] = offset + 1
            listed: Any = message.headers()
            headers = dict(listed or ())
            if not is_live and headers.get("kind") == PLAIN:
                continue
            sender = self._senders.get(headers.get("processor", b"").decode())
            if sender is None:
                continue  # another bridge publishes it
            try:
                record = self._records.read(listed, message.value())
            except PayloadError as why:
                self.unreadable += 1
                _log.warning("a result is not published: %s", why)
                continue
            if (event := record.event) is None:
                continue
            qos = next((q for prefix, q in self._qos.items() if event.topic.startswith(prefix)), 0) if event.topic else 0
            told.setdefault(sender, []).append(action_of(event, qos, retain=record.retain))
            self.published += 1
        for sender, actions in told.items():
            sender.apply(actions, self.counts)
        return len(messages)

    def commit(self, now_s: float) -> None:
        """Say once a second what went out."""
        if now_s - self._committed_s < COMMIT_S or not self._next:
            return
        self._committed_s = now_s
        positions = [TopicPartition(self._topics.results, number, offset) for number, offset in self._next.items() if offset >= 0]
        try:
            self._consumer.commit(offsets=positions, asynchronous=True)
        except KafkaException as error:
            LOG.warning("kafka: %s", error.args[0].str())

    def reported(self) -> None:
        """Let dead letters out again."""
        for sender in self._senders.values():
            sender.reported()

    def close(self) -> None:
        """Leave."""
        self._committed_s = 0.0
        self.commit(time.monotonic())
        closed(self._consumer.close, self._topics.results)


class _Cuts:
    """When states were cut last, by partition and reader, by the clock of the log: each cut has a record of lives."""

    def __init__(self, snapshot_s: float) -> None:
        self._oldest_ms = max(CUT_MS_MAX, round(CUTS * snapshot_s * 1000))
        self._at_ms: dict[int, dict[str, int]] = {}

    def note(self, number: int, key: str, at_ms: int) -> None:
        """Take a message of the topic of states."""
        if key.startswith(LIVES):
            self._at_ms.setdefault(number, {})[key] = at_ms

    def oldest_ms(self, number: int) -> int:
        """Return since when there are results that are in no state of a partition."""
        earliest_ms = int(time.time() * 1000) - self._oldest_ms
        return max(min(self._at_ms.get(number, {}).values(), default=0), earliest_ms)


def _declared(kept: Mapping[str, bytes]) -> Iterator[tuple[str, str, Declare]]:
    """Yield the machines that were online when their states were cut, with what was known of them, by processor."""
    for key, payload in kept.items():
        name, _, _ = key.partition("/")
        if key.startswith("~"):
            continue
        first, _, snapshot = payload.partition(b"\n")
        try:
            moment, document = json.loads(first), json.loads(snapshot)
            known = {machine: latest_of(told) for machine, told in document["live"]["machines"].items()}
            online = {machine: moment["machines"][machine]["online"] for machine in known}
        except (ValueError, LookupError, TypeError, AttributeError, RecursionError) as error:
            _log.warning("%s: cannot read its state, so the twin is announced with its next message: %s", key, one_line(error))
            continue
        for machine, latest in known.items():
            if any("/twin-" not in node for node in online[machine]):
                yield machine, name, Declare(machine, latest)
