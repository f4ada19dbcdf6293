"""The health of runners as metrics of the processors' nodes, so that doctor, page and Prometheus see them as ever; and the
bridge's own."""

import json
import logging
import time
from collections import Counter
from collections.abc import Mapping
from typing import Any

from confluent_kafka import OFFSET_BEGINNING, Consumer, TopicPartition

from cnctwin.kafka.bridge.outward import Outward
from cnctwin.kafka.settings import KafkaSettings
from cnctwin.kafka.topics import Topics
from processors.running.ports import EdgePort, HostPort
from processors.running.quarantine import quarantine_health
from sparkplug.metric import Change
from twin.vocabulary.node_ledger import LEDGER_PREFIX

REPORT_S = 1.0
GONE_S = 10.0  # a runner that says nothing for so long is left out
RUNNERS_MAX = 1000
_log = logging.getLogger(__name__)


class Reports:
    """See the module. `nodes` are those of the processors whose results this bridge publishes."""

    def __init__(self, settings: KafkaSettings, topics: Topics, name: str, nodes: Mapping[str, EdgePort]) -> None:
        self._topics, self._name, self._nodes = topics, name, nodes
        self._runners: dict[str, dict[str, Any]] = {}
        self._reported_s = 0.0
        self._cpu_s = 0.0
        self._consumer = Consumer(settings.client() | {"group.id": topics.bridge(name), "enable.auto.commit": False})
        self._consumer.assign([TopicPartition(topics.health, number, OFFSET_BEGINNING) for number in range(settings.partitions)])

    def is_due(self, now_s: float) -> bool:
        """Return True once a second."""
        return now_s - self._reported_s >= REPORT_S

    def report(self, now_s: float, host: HostPort, outward: Outward, back: Any, events: int) -> None:
        """Publish how runners and bridge stand."""
        cpu_s = time.process_time()
        busy_pct = 100.0 * (cpu_s - self._cpu_s) / (now_s - self._reported_s) if self._reported_s else 0.0
        self._reported_s, self._cpu_s = now_s, cpu_s
        self._hear()
        at_ms = time.time_ns() // 1_000_000
        alive = [one for one in self._runners.values() if at_ms - one["t"] < GONE_S * 1000]
        own: dict[str, int | float | str] = {
            "queue_depth": host.queue_depth,
            "reconnects": host.reconnects,
            "process": f"kafka bridge {self._name}",
            "bridge_events": events,
            "bridge_delivered": outward.delivered,
            "bridge_waiting": outward.waiting,
            "bridge_dropped": outward.dropped + outward.failed,
            "bridge_busy_pct": round(busy_pct, 1),
            **quarantine_health(host.quarantine),
        }
        for name, node in self._nodes.items():
            told = own | self._of_processor(name, [one for one in alive if name in one["processors"]])
            named = {key if key.startswith(LEDGER_PREFIX) else f"health/{key}": value for key, value in told.items()}
            node.publish(None, [Change(key, value, at_ms) for key, value in named.items()])

    def _of_processor(self, name: str, runners: list[dict[str, Any]]) -> dict[str, Any]:
        total: Counter[str] = Counter()
        for one in runners:
            total.update(one["ledgers"].get(name, {}))
        return {
            **total,
            "machines": total["machines"],
            "processors": max((len(one["processors"]) for one in runners), default=0),
            "lag_s": round(max((one["lag_s"] for one in runners), default=0.0), 3),
            "published_lag_s": round(max((one["lag_s"] for one in runners), default=0.0), 3),
            "busy_pct": max((one["busy_pct"] for one in runners), default=0.0),
            "runners": len(runners),
            "partitions": sum(one["partitions"] for one in runners),
            "lag_records": sum(one["lag_records"] for one in runners),
            "transactions": sum(one["transactions"] for one in runners),
            "transactions_aborted": sum(one["transactions_aborted"] for one in runners),
            "rebalances": sum(one["rebalances"] for one in runners),
            "restored_s": max((one["restored_s"] for one in runners), default=0.0),
            "lost_by_retention": sum(one["lost_by_retention"] for one in runners),
            "repeated": sum(one["repeated"] for one in runners),
            "dead_letters": sum(one["dead_letters"] for one in runners),
            "fault": next((one["fault"] for one in runners if one["fault"]), ""),
        }

    def _hear(self) -> None:
        for message in self._consumer.consume(1000, 0.0):
            if message.error() is not None:
                continue
            key, value = message.key(), message.value()
            name = key.decode("utf-8", "replace") if isinstance(key, bytes) else ""
            if not isinstance(value, bytes):
                self._runners.pop(name, None)
                continue
            try:
                told = json.loads(value)
                if isinstance(told, dict) and told["format"] == 1 and isinstance(told["ledgers"], dict):
                    if len(self._runners) >= RUNNERS_MAX:
                        self._runners.clear()
                    self._runners[name] = told
            except (ValueError, KeyError, RecursionError) as error:
                _log.warning("the health of %.60s cannot be read: %s", name, error)

    def close(self) -> None:
        """Leave."""
        self._consumer.close()
