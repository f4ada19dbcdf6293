"""The health of runners and bridges as metrics of the processors' nodes, so that doctor, page and Prometheus see them as ever.

Each bridge reports on the topic `health`, as runners do, so that the one that publishes tells of those that have no node.
"""

import time
from collections.abc import Mapping

from confluent_kafka import OFFSET_BEGINNING, Consumer, TopicPartition

from cnctwin.kafka.bridge.members import Members
from cnctwin.kafka.bridge.outward import Outward
from cnctwin.kafka.report import BRIDGE_PREFIX, BridgeReport, payload_of
from cnctwin.kafka.request import closed
from cnctwin.kafka.settings import KafkaSettings
from cnctwin.kafka.topics import Topics
from processors.lag_report import SPOKEN_OF_S, LagReport, topic_of
from processors.running.health import node_metrics
from processors.running.ports import EdgePort, HostPort
from processors.running.quarantine import quarantine_health
from sparkplug.metric import Change
from twin.vocabulary.node_ledger import LEDGER_PREFIX

REPORT_S = 1.0
BATCH, BATCHES_MAX = 1000, 20
HEALTH_PREFIX = "health/"


class Reports:
    """See the module. `nodes` are those of the processors whose results this bridge publishes."""

    def __init__(self, settings: KafkaSettings, topics: Topics, name: str, nodes: Mapping[str, EdgePort]) -> None:
        self._topics, self._name, self._nodes = topics, name, nodes
        self._member = BRIDGE_PREFIX + name
        self._members = Members(spec.name.removeprefix(HEALTH_PREFIX) for spec in node_metrics(on_log=True))
        self._reported_s = 0.0
        self._cpu_s = 0.0
        self._lagging: set[str] = set()
        self._consumer = Consumer(settings.client() | {"group.id": topics.bridge(name), "enable.auto.commit": False})
        self._consumer.assign([TopicPartition(topics.health, number, OFFSET_BEGINNING) for number in range(settings.partitions)])

    def is_due(self, now_s: float) -> bool:
        """Return True once a second."""
        return now_s - self._reported_s >= REPORT_S

    def report(self, now_s: float, host: HostPort, outward: Outward, events: int) -> None:
        """Publish how runners and bridges stand."""
        cpu_s = time.process_time()
        busy_pct = 100.0 * (cpu_s - self._cpu_s) / (now_s - self._reported_s) if self._reported_s else 0.0
        self._reported_s, self._cpu_s = now_s, cpu_s
        at_ms = time.time_ns() // 1_000_000
        self._hear(at_ms)
        report = BridgeReport(
            t=at_ms,
            bridge=self._name,
            events=events,
            delivered=outward.delivered,
            waiting=outward.waiting,
            dropped=outward.dropped + outward.failed,
            busy_pct=round(busy_pct, 1),
        )
        outward.keep(self._topics.health, self._member, payload_of(report))
        self._members.hear(self._member, payload_of(report), at_ms)  # by itself, since the cluster may be away
        own = {
            "queue_depth": host.queue_depth,
            "reconnects": host.reconnects,
            **self._members.of_bridges(at_ms),
            **quarantine_health(host.quarantine),
        }
        for name, node in self._nodes.items():
            told = own | self._members.of_processor(name, at_ms)
            named = {key if key.startswith(LEDGER_PREFIX) else HEALTH_PREFIX + key: value for key, value in told.items()}
            node.publish(None, [Change(key, value, at_ms) for key, value in named.items()])
            self._speak_of_lag(host, name, told, at_ms)

    def _speak_of_lag(self, host: HostPort, name: str, told: Mapping[str, int | float | str], at_ms: int) -> None:
        """Say on the plain topic that a processor is behind, as one without a log does, and once more when it has caught up: the
        alerts hear of it there."""
        lag_s = float(told["lag_s"])
        if lag_s < SPOKEN_OF_S and name not in self._lagging:
            return
        report = LagReport((name,), str(told["process"]), at_ms, lag_s, int(told["machines"]), float(told["busy_pct"]))
        host.publish_plain(topic_of(name), report.payload())
        (self._lagging.add if lag_s >= SPOKEN_OF_S else self._lagging.discard)(name)

    def _hear(self, at_ms: int) -> None:
        """Take the newest report of each member; the topic may hold an hour of them that is not compacted yet."""
        newest: dict[str, bytes | None] = {}
        for _ in range(BATCHES_MAX):
            messages = self._consumer.consume(BATCH, 0.0)
            for message in messages:
                key, value = message.key(), message.value()
                if message.error() is None and isinstance(key, bytes):
                    newest[key.decode("utf-8", "replace")] = value if isinstance(value, bytes) else None
            if len(messages) < BATCH:
                break
        for name, payload in newest.items():
            if name != self._member:
                self._members.hear(name, payload, at_ms)

    def leave(self, outward: Outward) -> None:
        """Take the report back: this bridge ends by intent."""
        outward.keep(self._topics.health, self._member, None)

    def close(self) -> None:
        """Leave the log."""
        closed(self._consumer.close, self._topics.health)
