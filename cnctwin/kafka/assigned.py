"""The partitions that a runner has: restored when they come, dropped when they go."""

import logging
import time
from collections.abc import Callable, Iterator, Mapping, Sequence

from confluent_kafka import KafkaException, Message, TopicPartition
from confluent_kafka.admin import AdminClient

from cnctwin.kafka.counted import Counted
from cnctwin.kafka.homes import home_in
from cnctwin.kafka.kept import ANSWER_S, ends_of, fence_open, read_kept
from cnctwin.kafka.settings import KafkaSettings
from cnctwin.kafka.topics import Topics
from cnctwin.kafka.transaction import fence
from processors.errors import SnapshotError
from processors.partition.partition import Partition
from processors.running.runtime import Configured
from sparkplug.records.record import Record, RecordError, RecordReader

RESTORE_S_MAX = 120.0
WAY_OUT = "write a null value in that partition, and what the log holds is folded, and published, once more"
Place = tuple[str, int]
"""A topic and the number of a partition."""
_log = logging.getLogger(__name__)


class Assigned:
    """See the module."""

    def __init__(
        self,
        settings: KafkaSettings,
        topics: Topics,
        pairs: Sequence[Configured],
        begin: Callable[[Place, int], int] | None = None,
    ) -> None:
        """`begin`: takes a partition and the offset from which its folds go on; returns that from which it is read, where that is
        another one."""
        self.partitions: dict[Place, Partition] = {}
        self.restored_s = 0.0  # that the last restoration took
        self.lost = 0  # records that the log held no more when their turn came
        self.counted = Counted()
        self._settings, self._topics, self._begin = settings, topics, begin
        self._reader = topics.runners([processor.name for processor, _ in pairs])
        self._pairs = by_topic(topics, pairs)
        self._records = RecordReader()
        self._cut_s: dict[Place, float] = {}

    @property
    def topics(self) -> list[str]:
        """The topics that the processors of this runner read."""
        return list(self._pairs)

    def restore(self, places: Sequence[Place]) -> list[TopicPartition]:
        """Restore partitions that have come; return from where each is to be read. Raises SnapshotError."""
        began_s = time.monotonic()
        numbers = sorted({number for _, number in places})
        client, fence_it = self._settings.client(), self._fence_if_gone
        fence_open(client, self._topics.results, numbers, timeout_s=RESTORE_S_MAX, fence=fence_it)
        kept = read_kept(client, self._topics.snapshots, numbers, timeout_s=RESTORE_S_MAX, fence=fence_it)
        ends = ends_of(client, places, timeout_s=RESTORE_S_MAX)
        positions = []
        for place, (topic, number) in enumerate(places):
            partition = Partition(self._reader, self._pairs[topic], topic, home_in(number, self._settings.partitions))
            try:
                offset = partition.restore(kept[number])
            except SnapshotError as error:
                raise SnapshotError(f"{self._topics.snapshots}, partition {number}, key {error}; {WAY_OUT}") from error
            if offset > ends[topic, number]:
                # Whatever is written up to there would count as folded.
                found = f"{topic}, partition {number} ends at {ends[topic, number]}, and the states are of {offset}"
                way_out = f"under the key {partition.marker} of {self._topics.snapshots} {WAY_OUT}"
                raise SnapshotError(f"{found}: it has lost records or was made again; {way_out}")
            if self._begin is not None:
                offset = partition.next = self._begin((topic, number), offset)
            self._retire((topic, number))
            self.partitions[topic, number] = partition
            # Cuts of several partitions are spread over the time between two.
            self._cut_s[topic, number] = began_s + self._settings.snapshot_s * place / max(len(places), 1)
            positions.append(TopicPartition(topic, number, offset))
        self.restored_s = time.monotonic() - began_s
        _log.info("%d partitions are restored in %.2f s", len(places), self.restored_s)
        return positions

    def drop(self, places: Sequence[Place]) -> None:
        """Forget partitions that have gone."""
        for place in places:
            self._retire(place)
            self._cut_s.pop(place, None)

    def _retire(self, place: Place) -> None:
        if (partition := self.partitions.pop(place, None)) is not None:
            self.counted.retire(partition)

    def of(self, message: Message) -> tuple[Partition, int] | None:
        """Return whose a message is, and its offset; None where its partition has gone, or it was taken already."""
        partition = self.partitions.get((message.topic() or "", message.partition() or 0))
        offset = message.offset()
        if partition is None or offset is None or offset < partition.next:
            return None
        if partition.next and offset > partition.next:
            self.lost += offset - partition.next
            _log.warning("%s: offsets %d to %d are gone; retention is too short", message.topic(), partition.next, offset - 1)
        return partition, offset

    def record(self, message: Message) -> Record:
        """Return the record that a message holds. Raises RecordError."""
        headers = message.headers()
        value = message.value()
        if headers is not None and not isinstance(headers, list):
            raise RecordError("headers are no list")
        return self._records.read(headers, value if isinstance(value, bytes) else None)

    def due(self, now_s: float, *, touched: Mapping[Place, Partition]) -> Iterator[Place]:
        """Yield the partitions whose states are to be saved now."""
        for place in touched:
            if now_s >= self._cut_s.get(place, 0.0):
                self._cut_s[place] = now_s + self._settings.snapshot_s
                yield place

    def _fence_if_gone(self, writer: str) -> None:
        """End the transaction of a runner that is in the group no more. One that lives has to end it itself."""
        group, _, member = writer.rpartition(".")
        members = self._members(group)
        if members is None or member in members:
            return
        _log.warning("%s is gone; what it left open is aborted", writer)
        try:
            fence(self._settings, writer)
        except KafkaException as error:
            _log.warning("%s: its open transaction ends by its time-out: %s", writer, error.args[0].str())

    def _members(self, group: str) -> set[str] | None:
        """Return the runners of a group, this one or another; None where the cluster does not say."""
        admin = AdminClient(self._settings.client())
        try:
            described = admin.describe_consumer_groups([group])[group].result(ANSWER_S)
        except KafkaException as error:
            _log.warning("%s: the members are not known: %s", group, error.args[0].str())
            return None
        finally:
            admin.poll(0)  # tells of its troubles
        return {member.group_instance_id or "" for member in described.members}


def by_topic(topics: Topics, pairs: Sequence[Configured]) -> dict[str, list[Configured]]:
    """Return the processors by the topic that each reads."""
    found: dict[str, list[Configured]] = {}
    for processor, configuration in pairs:
        topic = topics.cells(processor.name) if processor.is_of_cells else topics.readings
        found.setdefault(topic, []).append((processor, configuration))
    return found
