"""The whole edge, killed with -9 again and again while no broker is there: afterwards a reader has every row once, in order."""

import random
import sqlite3
import subprocess
import sys
import threading
import time
from collections.abc import Iterator, Sequence
from contextlib import closing, contextmanager
from pathlib import Path

import pytest

from cnctwin.standins.mtconnect_agent.replay_agent import ReplayAgent
from cnctwin.standins.simulated_control.state import production_moments
from cnctwin.standins.simulated_machine.description import DEVICES
from cnctwin.standins.simulated_machine.moment import Adapter
from edge.adapter import adapters
from edge.config_file import load
from edge.running.runtime import EdgeRuntime
from sparkplug.broker import BrokerAddress
from sparkplug.host import EventKind
from sparkplug.host_session import HostEvent
from sparkplug.metric import Change, MetricSpec, Reading
from tests.edge.host_watch import HostWatch, wait
from tests.wire.mosquitto import Mosquitto

pytestmark = pytest.mark.broker
PROJECT = Path(__file__).parents[3]
SECONDS = 600.0
CLOCKS = {"clock_offset_s", "clock_offset_spread_s", "stamp_clock"}
ORIGIN_MS = 1_772_438_400_000
Told = tuple[str, int, object]


class Reader(HostWatch):
    """A host that keeps each row by its number, and how old live values were when they came."""

    def __init__(self, address: BrokerAddress) -> None:
        super().__init__(address, "reader", rebirth_interval_ms_min=200)
        self.rows: dict[int, tuple[Reading, ...]] = {}
        self.history: list[int] = []
        self.live: list[int] = []
        self.history_at_birth: int | None = None

    def take(self, event: HostEvent) -> None:
        if event.kind is EventKind.DATA and event.device == "vmc":
            self._take(event.readings)
        elif event.kind is EventKind.BIRTH and event.device == "vmc" and self.history_at_birth is None:
            self.history_at_birth = len(self.history)

    def _take(self, readings: Sequence[Reading]) -> None:
        number = next(int(str(reading.value)) for reading in readings if reading.name == "edge_sequence")
        row = tuple(replace_history(reading) for reading in readings if reading.name != "edge_sequence")
        assert self.rows.setdefault(number, row) == row, "a number stands for one row"
        (self.history if readings[0].is_historical else self.live).append(number)


def replace_history(reading: Reading) -> Reading:
    return reading._replace(is_historical=False)


@pytest.fixture(scope="module")
def recorded(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Ten minutes of a machine as an adapter tells them."""
    file = tmp_path_factory.mktemp("recorded") / "vmc.txt"
    adapter = Adapter(ORIGIN_MS / 1000)
    lines = (adapter.line(moment) for moment in production_moments(SECONDS))
    file.write_text("\n".join(line for line in lines if line is not None) + "\n", encoding="utf-8")
    return file


class Notebook:
    """A publisher that writes down what it is told, and is never offline."""

    reconnects = unsent = 0
    session, online = 1, True

    def __init__(self) -> None:
        self.told: list[Told] = []

    def start(self) -> None:
        """Nothing to connect to."""

    def stop(self, timeout_s: float = 5.0) -> None:
        """Nothing to end."""

    def declare_device(self, device: str, metrics: Sequence[MetricSpec]) -> None:
        """Births are not looked at."""

    def remove_device(self, device: str) -> None:
        raise AssertionError("the control is there all the time")

    def barrier(self, token: int, session: int) -> bool:
        raise AssertionError("there is no store")

    def publish(self, device: str | None, changes: Sequence[Change]) -> bool:
        if device is not None:
            self.told += [(c.name, c.timestamp_ms, c.value) for c in changes]
        return True


def written(agent: ReplayAgent, mosquitto: Mosquitto, folder: Path) -> Path:
    host, port = mosquitto.address
    folder.mkdir(exist_ok=True)
    file = folder / "vmc.toml"
    file.write_text(
        f'[machine]\nname = "vmc"\n[broker]\nurl = "mqtt://{host}:{port}"\nsession_file = "{folder / "session"}"\n'
        'primary_host = "reader"\n'
        f'[store]\nhistory_rows_per_s = 5000\nfree_bytes_min = 0\n[mtconnect]\nurl = "{agent.url}"\ninterval_ms = 20\n',
        encoding="utf-8",
    )
    return file


def uninterrupted(recorded: Path, mosquitto: Mosquitto, folder: Path) -> list[Told]:
    """Return what an edge tells to which nothing happens."""
    notebook = Notebook()
    with ReplayAgent(recorded, DEVICES, speed=0) as agent:
        agent.step(1)
        config = load(written(agent, mosquitto, folder))
        runtime = EdgeRuntime(config, adapters()["mtconnect"], notebook)
        thread = threading.Thread(target=runtime.run)
        thread.start()
        wait(lambda: bool(notebook.told), "the first row")
        while not agent.finished:
            agent.step(200)
        wait(lambda: runtime.health.backlog == 0 and caught_up(runtime, agent), "the end of the recording")
        runtime.stop.set()
        thread.join(60)
    return notebook.told


def caught_up(runtime: EdgeRuntime, agent: ReplayAgent) -> bool:
    """All that the agent has was read, and nothing has come for a while."""
    before = runtime.ledger.snapshot()["ledger/received"]
    time.sleep(0.3)
    all_read = runtime._connection._cursor.next_sequence == agent.agent.buffer.next_sequence
    return agent.finished and all_read and runtime.ledger.snapshot()["ledger/received"] == before


@contextmanager
def edge_process(file: Path) -> Iterator[subprocess.Popen[bytes]]:
    process = subprocess.Popen([sys.executable, "-m", "cnctwin", "edge", "run", str(file)], cwd=PROJECT)
    try:
        yield process
    finally:
        process.kill()
        process.wait(10)


def each_once(rows: dict[int, tuple[Reading, ...]]) -> list[Told]:
    """In the order of the numbers; what an edge found again when it was started again is left out."""
    seen: set[Told] = set()
    told: list[Told] = []
    for number in sorted(rows):
        for reading in rows[number]:
            one = reading.name, reading.timestamp_ms, reading.value
            if one not in seen:
                seen.add(one)
                told.append(one)
    return told


def by_signal(told: Sequence[Told]) -> dict[str, list[Told]]:
    """Return what the machine told; what its agent says before has the stamp of the test's own day.

    How the clocks compare is the edge's own finding, which takes it some seconds of ours.
    """
    machine = [one for one in dict.fromkeys(told) if ORIGIN_MS <= one[1] <= ORIGIN_MS + SECONDS * 1000 and one[0] not in CLOCKS]
    return {name: [one for one in machine if one[0] == name] for name in sorted({one[0] for one in machine})}


def test_no_broker_and_an_edge_that_is_killed_lose_nothing_and_tell_nothing_twice(
    recorded: Path, mosquitto: Mosquitto, tmp_path: Path
) -> None:
    chance = random.Random(6)
    expected = uninterrupted(recorded, mosquitto, tmp_path / "quiet")
    folder = tmp_path / "killed"
    mosquitto.kill()
    with ReplayAgent(recorded, DEVICES, speed=0) as agent:
        agent.step(1)
        file = written(agent, mosquitto, folder)
        for _ in range(5):
            with edge_process(file):
                wait(lambda: stored_rows(folder) > 0, "the first row in the store")
                until_s = time.monotonic() + chance.uniform(0.5, 1.5)
                while time.monotonic() < until_s:
                    agent.step(chance.randint(1, 60))
                    time.sleep(0.01)
            agent.step(chance.randint(0, 100))  # and while nobody is there
        with Reader(BrokerAddress(*mosquitto.address)) as reader, edge_process(file) as last:
            wait(lambda: agent.step(2) >= 0 and stored_rows(folder) > len(expected) / 20, "a good part of it in the store")
            mosquitto.restart()
            while not agent.finished:
                agent.step(50)
                time.sleep(0.01)
            final = by_signal(expected)["spindle_load_pct"][-1]
            wait(lambda: final in each_once(reader.rows), "the last value")
            wait(lambda: not stored_rows(folder), "the end of the history")
            time.sleep(0.5)
            last.terminate()
            assert last.wait(60) == 0
        assert reader.history_at_birth == 0, "the birth with the present values does not wait for the history"
    assert sorted(reader.rows) == list(range(1, max(reader.rows) + 1)), "no row is missing"
    assert reader.live == sorted(set(reader.live))
    assert len(reader.history) > len(expected) / 20
    assert by_signal(each_once(reader.rows)) == by_signal(expected)


def stored_rows(folder: Path) -> int:
    """Rows that are stored, as another process sees them."""
    try:
        with closing(sqlite3.connect(f"file:{folder / 'session.store'}?mode=ro", uri=True)) as db:
            return int(db.execute("SELECT count(*) FROM rows").fetchone()[0])
    except sqlite3.OperationalError:
        return 0  # it is not there yet
