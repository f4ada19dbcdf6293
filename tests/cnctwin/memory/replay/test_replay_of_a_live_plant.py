"""The proof of the whole idea: what processors published live, through kill -9, comes out of the store again bit for bit.

A real Mosquitto, two machines, six processors in two processes, the historian in another one.
"""

import math
import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest

from cnctwin.memory.replay import Replayed, replay
from cnctwin.memory.store.opening import open_store
from processors.config import read_tables
from sparkplug.broker import BrokerAddress
from sparkplug.datatype import DataType
from sparkplug.edge_node import EdgeNode
from sparkplug.host import EventKind, HostApplication
from sparkplug.metric import Change, MetricSpec, NodeId
from tests.cnctwin.program import until
from tests.wire.mosquitto import Mosquitto

pytestmark = pytest.mark.broker
FIRST, SECOND = ("thermal", "cutting_force", "rules", "joint_anomaly"), ("gap", "events")
"""The second read what the first say. They begin again later: which of two births of each other they would have heard, had they
all begun in the same instant, is not in the log."""
PROCESSORS = FIRST + SECOND
SETTINGS = """
[thermal]
ambient_temp_c = 21.0
[cutting_force]
tool_diameter_mm = 10.0
[events]
cycle_s_min = 0.5
seen_s_min = 1.0
"""
NUMBERS = ("spindle_rpm", "spindle_load_pct", "spindle_temp_c", "feed_mm_min")
TEXTS = ("exec_state", "program")
RATE_S = 0.05
SETTLE_S = 2.5  # each has heard a report of each other, and been given the birth that it asked for


class Machine:
    """An edge of one machine that works and rests."""

    def __init__(self, broker: BrokerAddress, name: str, phase: float) -> None:
        self.name, self._phase = name, phase
        self._edge = EdgeNode(broker, NodeId("cnc", f"edge-{name}"))
        specs = [MetricSpec(one, DataType.DOUBLE) for one in NUMBERS] + [MetricSpec(one, DataType.STRING) for one in TEXTS]
        self._edge.declare_device(name, [*specs, MetricSpec("tool_number", DataType.INT64)])
        self._edge.start()
        self.stop = self._edge.stop

    def work(self, at_s: float) -> None:
        """Two seconds of a cut, one of silence, and so on."""
        at_ms, turn = time.time_ns() // 1_000_000, (at_s + self._phase) % 3.0
        if turn < 2.0:
            rpm = 3000.0 + 50.0 * math.sin(at_s * 3.1 + self._phase)
            values = {"spindle_rpm": rpm, "spindle_load_pct": 40.0 + 9.0 * math.sin(at_s), "spindle_temp_c": 24.0 + at_s / 50}
            values |= {"feed_mm_min": 800.0, "exec_state": "ACTIVE", "program": "O1", "tool_number": 1 + int(at_s) // 6}
        elif turn < 2.2:
            values = {"feed_mm_min": 0.0, "exec_state": "PROGRAM_COMPLETED"}
        else:
            return
        self._edge.publish(self.name, [Change(name, value, at_ms) for name, value in values.items()])


class Plant:
    """The processes, and what a viewer sees of them."""

    def __init__(self, folder: Path, broker: tuple[str, int]) -> None:
        self._folder, self._broker = folder, broker
        (folder / "processors.toml").write_text(SETTINGS + f'[historian]\nstore = "{folder / "store"}"\n')
        self.processes: dict[str, subprocess.Popen[bytes]] = {}
        self.viewer = HostApplication(BrokerAddress(*broker), "trial", ("spBv1.0/cnc/#",), publish_state=False)
        self.viewer.start()
        self.machines: list[Machine] = []
        self._began_s = time.monotonic()
        self.published = 0

    def start(self, name: str, processors: tuple[str, ...]) -> None:
        host, port = self._broker
        command = [sys.executable, "-m", "cnctwin", "process", *processors, "--config", str(self._folder / "processors.toml")]
        command += ["--broker", f"mqtt://{host}:{port}", "--state-dir", str(self._folder)]
        with (self._folder / f"{name}.log").open("ab") as log:
            self.processes[name] = subprocess.Popen(command, stdout=log, stderr=log, stdin=subprocess.DEVNULL)

    def wait_for_nodes(self, processors: tuple[str, ...], seconds_max: float = 120.0) -> None:
        until_s, wanted = time.monotonic() + seconds_max, {NodeId("cnc", f"twin-{name}") for name in processors}
        while missing := {node for node in wanted if (seen := self.viewer.picture(node)) is None or not seen.online}:
            assert time.monotonic() < until_s, f"{missing} are not there; {self.logs()}"
            self._look(RATE_S)
        self._look(SETTLE_S)

    def begin(self) -> None:
        broker = BrokerAddress(*self._broker)
        self.machines = [Machine(broker, "vmc", 0.0), Machine(broker, "lathe", 1.3)]

    def work(self, seconds: float) -> None:
        until_s = time.monotonic() + seconds
        while (now_s := time.monotonic()) < until_s:
            for machine in self.machines:
                machine.work(now_s - self._began_s)
            self._look(RATE_S)

    def work_until(self, wanted: set[tuple[str, str]], seconds_max: float = 120.0) -> None:
        until_s, seen = time.monotonic() + seconds_max, set[tuple[str, str]]()
        while not wanted <= seen:
            assert time.monotonic() < until_s, f"{wanted - seen} do not publish; {self.logs()}"
            for machine in self.machines:
                machine.work(time.monotonic() - self._began_s)
            seen |= self._look(RATE_S)

    def _look(self, seconds: float) -> set[tuple[str, str]]:
        until_s, seen = time.monotonic() + seconds, set[tuple[str, str]]()
        while (left_s := until_s - time.monotonic()) > 0.0:
            for event in self.viewer.poll(left_s):
                if event.kind in (EventKind.DATA, EventKind.BIRTH) and event.device and event.node.node.startswith("twin-"):
                    seen.add((event.node.node, event.device))
                    self.published += len(event.readings) if event.kind is EventKind.DATA else 0
        return seen

    def end(self, name: str, number: int) -> None:
        process = self.processes.pop(name)
        os.kill(process.pid, number)
        process.wait(60)

    def close(self) -> None:
        for name in list(self.processes):
            self.end(name, signal.SIGKILL)
        for machine in self.machines:
            machine.stop()
        self.viewer.stop()

    def logs(self) -> str:
        return "\n".join(file.read_text()[-2000:] for file in self._folder.glob("*.log"))


def of(processors: tuple[str, ...]) -> set[tuple[str, str]]:
    """The twin devices of these processors."""
    return {(f"twin-{name}", machine) for name in processors for machine in ("vmc", "lathe")}


@pytest.fixture(scope="module")
def kept(tmp_path_factory: pytest.TempPathFactory, mosquitto_program: str) -> Path:
    """The store of a plant whose processors were killed with -9 in the middle, and stopped at the end."""
    folder = tmp_path_factory.mktemp("plant")
    with Mosquitto() as mosquitto:
        plant = Plant(folder, mosquitto.address)
        try:
            plant.start("historian", ("historian",))
            plant.start("first", FIRST)
            plant.start("second", SECOND)
            plant.wait_for_nodes(("historian", *PROCESSORS))
            plant.begin()
            plant.work_until(of(PROCESSORS))
            plant.work(3.0)
            plant.end("first", signal.SIGKILL)
            plant.end("second", signal.SIGKILL)
            plant.start("first", FIRST)
            plant.work_until(of(FIRST))
            plant.start("second", SECOND)
            plant.work_until(of(SECOND))
            plant.work(2.0)
            until(lambda: plant.work(0.2) or plant.published > 200, "two hundred values")
            plant.end("first", signal.SIGTERM)
            plant.end("second", signal.SIGTERM)
            plant.end("historian", signal.SIGTERM)
        finally:
            plant.close()
    return folder


@pytest.mark.parametrize("machine", ["vmc", "lathe"])
def test_a_replay_gives_what_was_published_live_bit_for_bit(kept: Path, machine: str) -> None:
    replayed = replayed_of(kept, machine)
    assert [one.name for one in replayed.processors] == sorted(PROCESSORS)
    assert replayed.compared > 100
    assert all(one.restarts >= 1 for one in replayed.processors), [(one.name, one.restarts) for one in replayed.processors]
    assert replayed.is_equal, [
        (one.name, one.totals, one.notes, [metric.first for metric in one.metrics if metric.first]) for one in replayed.processors
    ]


def test_the_second_replay_is_the_first_and_a_chain_gives_the_same(kept: Path) -> None:
    assert replayed_of(kept, "vmc").sha256 == replayed_of(kept, "vmc").sha256


def replayed_of(folder: Path, machine: str, **options: bool) -> Replayed:
    store = open_store(folder / "store")
    try:
        tables = {name: table for name, table in read_tables(folder / "processors.toml").items() if name in PROCESSORS}
        return replay(store, machine, 0 + 1, time.time_ns() // 1_000_000 + 60_000, tables=tables, **options)
    finally:
        store.close()
