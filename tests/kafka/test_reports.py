"""Reports over a real Kafka: a bridge that publishes tells of runners, and of another bridge that has no node."""

import time
from collections.abc import Callable, Sequence
from types import SimpleNamespace
from typing import Any, cast

import pytest

from cnctwin.kafka.report import RunnerReport, payload_of
from sparkplug.metric import Change
from tests.kafka.conftest import NEEDED
from tests.kafka.kafka_server import KafkaServer

pytest.importorskip("confluent_kafka", reason=NEEDED)

from cnctwin.kafka.bridge.outward import Outward
from cnctwin.kafka.bridge.reports import Reports
from cnctwin.kafka.settings import KafkaSettings
from cnctwin.kafka.topics import Topics, ensure
from processors.running.ports import EdgePort, HostPort

WAIT_S_MAX = 30.0
HOST = cast(HostPort, SimpleNamespace(queue_depth=0, reconnects=0, quarantine=()))


class Node:
    """A node that keeps what was published."""

    def __init__(self) -> None:
        self.told: dict[str, Any] = {}

    def publish(self, device: str | None, changes: Sequence[Change]) -> bool:
        assert device is None
        self.told |= {change.name.removeprefix("health/"): change.value for change in changes}
        return True


class Bridge:
    """The part of a bridge that reports."""

    def __init__(self, settings: KafkaSettings, topics: Topics, name: str, node: Node | None = None) -> None:
        self.outward = Outward(settings, name)
        nodes = {} if node is None else {"gap": cast(EdgePort, node)}
        self.reports = Reports(settings, topics, name, nodes)

    def report(self) -> None:
        self.reports.report(time.monotonic(), HOST, self.outward, events=5)
        self.outward.poll()

    def close(self, *, goodbye: bool) -> None:
        if goodbye:
            self.reports.leave(self.outward)
        assert self.outward.close() == 0
        self.reports.close()


def until(publisher: Bridge, condition: Callable[[], bool], what: str) -> None:
    deadline_s = time.monotonic() + WAIT_S_MAX
    while not condition():
        assert time.monotonic() < deadline_s, f"not seen: {what}"
        publisher.report()
        time.sleep(0.05)


def runner_report(records: int) -> bytes:
    return payload_of(
        RunnerReport(
            t=time.time_ns() // 1_000_000, processors=("gap",), partitions=2, records=records, lag_records=0, lag_s=0.0,
            busy_pct=1.0, transactions=3, transactions_aborted=0, rebalances=1, restored_s=0.1, lost_by_retention=0, repeated=0,
            dead_letters=0, ledgers={"gap": {"machines": 4, "ledger/received": records, "ledger/emitted": records}},
        )
    )  # fmt: skip


def test_who_publishes_hears_runners_and_bridges_come_and_leave(kafka: KafkaServer) -> None:
    settings = KafkaSettings(bootstrap=kafka.bootstrap, partitions=2, replication_factor=1)
    topics = Topics("reports")
    ensure(settings, topics, [])
    node = Node()
    publisher, other = Bridge(settings, topics, "b0", node), Bridge(settings, topics, "b1")
    runner = Outward(settings, "runner")
    try:
        publisher.report()
        assert (node.told["bridges"], node.told["runners"], node.told["bridge_events"]) == (1, 0, 5)
        other.report()
        for records in range(1, 2501):  # more than are read at once; the newest counts
            assert runner.keep(topics.health, "gap.r0", runner_report(records))
        assert runner.keep(topics.health, "gap.r9", b"no report")
        assert runner.close() == 0
        until(publisher, lambda: node.told.get("records") == 2500, "the newest report of the runner")
        until(publisher, lambda: bool(node.told["bridges"] == 2), "the bridge that has no node")
        assert (node.told["runners"], node.told["machines"], node.told["bridge_events"]) == (1, 4, 10)
        assert node.told["ledger/received"] == 2500
        other.close(goodbye=True)
        until(publisher, lambda: bool(node.told["bridges"] == 1), "the goodbye")
        assert (node.told["bridges_silent"], node.told["bridge_events"], node.told["silent"]) == (0, 10, "")
    finally:
        publisher.close(goodbye=False)
