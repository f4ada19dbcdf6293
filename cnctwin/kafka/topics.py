"""The topics of one MQTT group on Kafka: names, and their making.

All have the same number of partitions, so that a machine's readings, its results and its states stand in partitions of one
number, and one runner has them all.
"""

import time
from collections.abc import Collection, Sequence
from concurrent.futures import Future
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

from confluent_kafka import KafkaError, KafkaException
from confluent_kafka.admin import AdminClient, NewTopic

from cnctwin.kafka.settings import KafkaSettings
from processors.errors import ConfigurationError

if TYPE_CHECKING:
    from processors.running.runtime import Configured  # and with it all that folds; a runner claims its name before

ANSWER_S = 30.0
ATTEMPT_S = 1.0
MADE_S_MAX = 60.0
HOUR_MS = 3_600_000
REPLICAS_TO_LOSE_ONE = 3  # and still write to two
COMPACTED = {
    "cleanup.policy": "compact",
    "min.cleanable.dirty.ratio": "0.3",
    "segment.ms": "600000",
    "segment.bytes": "4194304",
    "max.compaction.lag.ms": "3600000",
}


@dataclass(frozen=True, slots=True)
class Topics:
    """The names. `group` is the Sparkplug group."""

    group: str

    @property
    def readings(self) -> str:
        """The topic of what machines say, by machine."""
        return f"cnctwin.{self.group}.readings"

    def cells(self, processor: str) -> str:
        """Return the topic of what a processor that compares machines reads, by cell."""
        return f"cnctwin.{self.group}.cells.{processor}"

    @property
    def results(self) -> str:
        """The topic of what processors say, by machine or cell."""
        return f"cnctwin.{self.group}.results"

    @property
    def snapshots(self) -> str:
        """The topic of the states of units."""
        return f"cnctwin.{self.group}.snapshots"

    @property
    def births(self) -> str:
        """The topic of the newest birth certificates, as they came."""
        return f"cnctwin.{self.group}.births"

    @property
    def health(self) -> str:
        """The topic of the health of runners and bridges, as JSON."""
        return f"cnctwin.{self.group}.health"

    @property
    def deadletters(self) -> str:
        """The topic of what could not be folded or read."""
        return f"cnctwin.{self.group}.deadletters"

    def runners(self, processors: Sequence[str]) -> str:
        """Return the consumer group of the runners of these processors.

        >>> Topics("cnc").runners(["thermal", "gap"])
        'cnctwin.cnc.gap+thermal'
        """
        return f"cnctwin.{self.group}.{'+'.join(sorted(set(processors)))}"

    def writer(self, processors: Sequence[str], member: str) -> str:
        """Return the transactional id of a runner: its name stands behind the last dot."""
        return f"{self.runners(processors)}.{member}"

    def bridge(self, name: str) -> str:
        """Return the consumer group of a bridge."""
        return f"cnctwin.{self.group}.bridge.{name}"

    def all(self, cell_processors: Sequence[str]) -> dict[str, dict[str, str]]:
        """Return all topics with their configuration."""
        kept: dict[str, str] = {"cleanup.policy": "delete"}
        logs = [self.readings, *map(self.cells, cell_processors), self.results, self.deadletters]
        return {**dict.fromkeys(logs, kept), **dict.fromkeys((self.snapshots, self.births, self.health), COMPACTED)}


def cell_processors(pairs: "Sequence[Configured]") -> list[str]:
    """Return the names of those that compare machines."""
    return [processor.name for processor, _ in pairs if processor.is_of_cells]


def configuration(settings: KafkaSettings, kept: dict[str, str]) -> dict[str, str]:
    """Return the configuration with which a topic is made. What was acknowledged outlives a broker where that is possible: two
    have it.

    >>> configuration(KafkaSettings(bootstrap="k:1", retention_hours=1), {"cleanup.policy": "delete"})
    {'cleanup.policy': 'delete', 'min.insync.replicas': '2', 'retention.ms': '3600000'}
    """
    insync = {"min.insync.replicas": "2"} if settings.replication_factor >= REPLICAS_TO_LOSE_ONE else {}
    retention = {} if kept is COMPACTED else {"retention.ms": str(round(settings.retention_hours * HOUR_MS))}
    return kept | insync | retention


def ensure(settings: KafkaSettings, topics: Topics, cell_processors: Sequence[str], without: Collection[str] = ()) -> None:
    """Make the topics that are missing, or say which are. Raises ConfigurationError: for topics that are missing where we may not
    make them, for one with another number of partitions, and for a cluster that does not let us in.

    without: those that the caller neither reads nor writes, and so may have no right to see
    """
    admin = _Asked(settings)
    wanted = {name: of for name, of in topics.all(cell_processors).items() if name not in without}
    present = admin.present()
    missing = [name for name in wanted if name not in present]
    if missing and not settings.create_topics:
        raise ConfigurationError(
            f"kafka: the topics {', '.join(missing)} are missing; make them (docs/how-to/kafka.md), or set create_topics"
        )
    made: dict[str, Future[None]] = {}
    if missing:
        made = admin.client.create_topics(
            [
                NewTopic(
                    name,
                    num_partitions=settings.partitions,
                    replication_factor=settings.replication_factor,
                    config=configuration(settings, wanted[name]),
                )
                for name in missing
            ]
        )
    for name, future in made.items():
        try:
            future.result(ANSWER_S)
        except KafkaException as error:
            if error.args[0].code() != KafkaError.TOPIC_ALREADY_EXISTS:  # another process was quicker
                raise ConfigurationError(f"kafka: topic {name} cannot be made: {error.args[0].str()}") from error
    _await_leaders(admin, wanted, settings.partitions)


class _Asked:
    """The cluster as it answers, or why it does not."""

    def __init__(self, settings: KafkaSettings) -> None:
        self._trouble: dict[int, str] = {}
        self._who = settings.username or "us"
        # Its log has a line for each attempt; what is in them comes to `_note` as well.
        conf: dict[str, Any] = {**settings.client(), "error_cb": self._note, "log_level": 0}
        self.client = AdminClient(conf)

    def _note(self, error: KafkaError) -> None:
        self._trouble[error.code()] = error.str()

    def present(self) -> dict[str, int]:
        """Return the topics that have a leader for each partition, with their number of partitions."""
        until_s = time.monotonic() + ANSWER_S
        while True:
            try:
                found = self.client.list_topics(timeout=ATTEMPT_S).topics
            except KafkaException as error:
                self.client.poll(0)
                for refusal in (KafkaError._AUTHENTICATION, KafkaError._SSL):
                    if refusal in self._trouble:
                        why = self._trouble[refusal]
                        raise ConfigurationError(f"kafka: the cluster does not let {self._who} in: {why}") from error
                if time.monotonic() > until_s:
                    why = next(reversed(self._trouble.values()), error.args[0].str())
                    raise ConfigurationError(f"kafka: no answer from the cluster: {why}") from error
            else:
                return {name: len(topic.partitions) for name, topic in found.items() if topic.error is None}


def _await_leaders(admin: _Asked, wanted: dict[str, dict[str, str]], partitions: int) -> None:
    until_s = time.monotonic() + MADE_S_MAX
    while True:
        found = admin.present()
        missing = [name for name in wanted if name not in found]
        if not missing:
            break
        if time.monotonic() > until_s:
            raise ConfigurationError(f"kafka: the topics {', '.join(missing)} have no leader after {MADE_S_MAX:g} s")
        time.sleep(0.1)
    for name in wanted:
        if found[name] != partitions:
            raise ConfigurationError(
                f"kafka: topic {name} has {found[name]} partitions, and partitions is {partitions}; set it to {found[name]}"
            )
