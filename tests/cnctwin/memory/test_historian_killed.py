"""The historian is killed with -9 again and again, and the broker once: the store has every row of the machine, once."""

import random
import threading
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import pytest

from cnctwin.memory.store.contract import Query, StoreError
from cnctwin.memory.store.opening import open_store
from edge.config import StoreSection
from edge.running.forwarder import Forwarder
from edge.running.receipts import RECEIPT
from edge.running.ring import Ring
from edge.sample import EdgeSample
from sparkplug.actions import HostState
from sparkplug.broker import BrokerAddress
from sparkplug.datatype import DataType
from sparkplug.edge_node import EdgeNode
from sparkplug.edge_session import Command
from sparkplug.metric import Change, MetricSpec, NodeId
from tests.cnctwin.program import Program, until
from tests.wire.mosquitto import Mosquitto
from twin.vocabulary.nodes import HISTORIAN_NODE

pytestmark = pytest.mark.broker
LIMITS = StoreSection(free_bytes_min=0, history_rows_per_s=5_000, await_receipt=True)
ROWS_A_S = 100
KILLS = 3


class NumberedEdge:
    """An edge whose row n says n, as quickly as a fast machine; it forgets what a memory has given a receipt for."""

    def __init__(
        self, folder: Path, *brokers: BrokerAddress, limits: StoreSection = LIMITS, primary_host: str | None = None
    ) -> None:
        self.rows = 0
        self._node = EdgeNode(
            brokers,
            NodeId("cnc", "edge-vmc"),
            [MetricSpec("health/rows", DataType.INT64)],
            primary_host=primary_host,
            session_file=folder / "session",
            barrier_topic="cnctwin/barrier/cnc/edge-vmc",
            on_confirmed=self._confirmed,
            on_command=self._commanded,
            watched_hosts=[HISTORIAN_NODE],
            on_host_state=self._host_state,
        )
        ring = Ring(folder / "ring", limits, wall_ms=lambda: time.time_ns() // 1_000_000, clock=time.monotonic)
        self.forwarder = Forwarder(ring, self._node, "vmc", limits, time.monotonic)
        metrics = [MetricSpec("row", DataType.INT64), *self.forwarder.metrics()]
        self._node.declare_device("vmc", metrics)
        self.forwarder.declare(metric.name for metric in metrics)
        self._ends, self._is_told = threading.Event(), threading.Event()
        self._thread = threading.Thread(target=self._run)

    def _confirmed(self, token: int) -> None:
        self.forwarder.confirmed(token)

    def _host_state(self, host: str, state: HostState | None) -> None:
        self.forwarder.host_state(host, state)

    def _commanded(self, command: Command) -> None:
        if command.name == RECEIPT and isinstance(command.value, str):
            self.forwarder.receipt(command.value)

    def _run(self) -> None:
        due_s = told_s = time.monotonic()
        while not self._ends.is_set():
            due_s += 1.0 / ROWS_A_S
            if not self._is_told.is_set():
                self.rows += 1
                # As of its own millisecond, so that each is a sample of its own.
                self.forwarder.put([[EdgeSample("row", self.rows, 1_772_438_400_000 + self.rows)]], None)
            self.forwarder.pump()
            if due_s - told_s >= 1.0:  # as edges do; who comes later hears of the node, and asks for its birth
                told_s = due_s
                self._node.publish(None, [Change("health/rows", self.rows, time.time_ns() // 1_000_000)])
            self._ends.wait(max(due_s - time.monotonic(), 0.0))

    @contextmanager
    def running(self) -> Iterator["NumberedEdge"]:
        self._node.start()
        self._thread.start()
        try:
            yield self
        finally:
            self._ends.set()
            self._thread.join()
            self._node.stop()
            self.forwarder.close()

    def enough(self) -> None:
        """No further row."""
        self._is_told.set()


def test_every_row_is_in_the_store_once(tmp_path: Path, mosquitto: Mosquitto) -> None:
    chance = random.Random(7)
    settings = tmp_path / "processors.toml"
    settings.write_text(f'[historian]\nstore = "{tmp_path / "store"}"\nraw_days = 36500.0\n')
    broker = f"mqtt://127.0.0.1:{mosquitto.port}"
    command = ["process", "historian", "--config", str(settings), "--broker", broker, "--state-dir", str(tmp_path / "state")]
    (tmp_path / "log").mkdir()
    with NumberedEdge(tmp_path, BrokerAddress(*mosquitto.address)).running() as edge:
        for kill in range(KILLS):
            with Program(tmp_path / "log", *command) as historian:
                until(lambda: stored(tmp_path) > 0, "the first rows in the store", 120.0)
                time.sleep(1.5 + chance.random())
                if kill == 1:
                    mosquitto.kill()
                    mosquitto.restart()
                    time.sleep(1.0)
                assert historian.process.poll() is None, historian.err
                historian.process.kill()
        edge.enough()
        with Program(tmp_path / "log", *command):
            until(lambda: edge.forwarder.observations == 0, "a receipt for every row", 180.0)
        rows = edge.rows
    assert rows > KILLS * ROWS_A_S
    assert values(tmp_path) == list(range(1, rows + 1))


def stored(folder: Path) -> int:
    """Return how many rows; none while the historian is still making its tables."""
    try:
        return len(values(folder))
    except StoreError:
        return 0


def values(folder: Path) -> list[object]:
    """Return what the store has of the rows, in the order of their stamps."""
    if not (folder / "store").exists():
        return []
    store = open_store(folder / "store")
    try:
        (column,) = store.query(Query("vmc", ("row",), 1_772_438_400_000, 1_772_438_400_000 + 10_000_000))
    finally:
        store.close()
    return [value for value in column.value if value is not None]
