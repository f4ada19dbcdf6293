"""Measure what an edge costs: the store, a day without a broker, and a gateway of many machines.

    .venv/bin/python benchmarks/edges/cost.py store            # append and drain, beside what SQLite can do at most
    .venv/bin/python benchmarks/edges/cost.py gateway          # 50 machines at 10 Hz in one process, share of a core
    .venv/bin/python benchmarks/edges/cost.py outage --hours 24 --kills 10

Figures of one run belong together; on a busy computer only their ratios mean something.
"""

import argparse
import os
import random
import sqlite3
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from xml.etree import ElementTree as ET

from benchmarks.edges.load import observations
from edge.config import StoreSection
from edge.place import Place
from edge.running.ring import Ring
from sparkplug.broker import BrokerAddress
from sparkplug.host import EventKind
from sparkplug.host_session import HostEvent
from tests.edge.controls.mtconnect.agent_documents import streams
from tests.edge.host_watch import HostWatch
from tests.wire.mosquitto import Mosquitto

PROJECT = Path(__file__).parents[2]
ROW = "x" * 600
TICKS = os.sysconf("SC_CLK_TCK")


def timed(work: Callable[[], object]) -> float:
    """Seconds of the process's own time, user and system."""
    began = time.process_time()
    work()
    return time.process_time() - began


def cpu_s(pid: int) -> float:
    """Seconds of processor time that a process has used, user and system."""
    fields = Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()
    return (int(fields[11]) + int(fields[12])) / TICKS


# The store.


def store(rows: int) -> None:
    """Rows of 600 B: a row a commit (a look of a slow machine), ten, and a hundred; each beside the bare database."""
    with tempfile.TemporaryDirectory() as folder:
        for batch in (1, 10, 100):
            count = rows if batch > 1 else rows // 5
            ring = Ring(
                Path(folder) / f"ring{batch}",
                StoreSection(free_bytes_min=0, bytes_max=10**10),
                wall_ms=lambda: time.time_ns() // 10**6,
                clock=time.monotonic,
            )
            append_s = timed(lambda ring=ring, count=count, batch=batch: append(ring, count, batch))  # type: ignore[misc]
            limit_s = timed(lambda count=count, batch=batch: bare(Path(folder) / f"bare{batch}", count, batch))  # type: ignore[misc]
            drain_s = timed(lambda ring=ring: drain(ring))  # type: ignore[misc]
            ring.close()
            print(
                f"{batch:3d} rows a commit: append {count / append_s:8.0f} rows/s, {append_s / limit_s:4.2f} x bare SQLite; "
                f"read and delete {count / drain_s:8.0f} rows/s"
            )


def append(ring: Ring, count: int, batch: int) -> None:
    """As the edge does."""
    for number in range(0, count, batch):
        ring.append([(8, ROW)] * batch, Place("control", number))


def drain(ring: Ring) -> None:
    """As the forwarder does."""
    for first in range(1, ring.last + 1, 100):
        ring.read(first, first + 99)
        ring.delete(first, first + 99, 800)


def bare(file: Path, count: int, batch: int) -> None:
    """The least that SQLite needs for it."""
    db = sqlite3.connect(file, isolation_level=None)
    db.execute("PRAGMA journal_mode = WAL")
    db.execute("PRAGMA synchronous = NORMAL")
    db.execute("CREATE TABLE rows(id INTEGER PRIMARY KEY, t INTEGER, n INTEGER, body TEXT)")
    for _ in range(0, count, batch):
        db.execute("BEGIN")
        db.executemany("INSERT INTO rows(t, n, body) VALUES (?, ?, ?)", [(0, 8, ROW)] * batch)
        db.execute("COMMIT")
    db.close()


# The gateway.


@contextmanager
def child(*command: str) -> Iterator[subprocess.Popen[str]]:
    process = subprocess.Popen([sys.executable, *command], cwd=PROJECT, stdout=subprocess.PIPE, text=True)
    assert process.stdout is not None
    try:
        yield process
    finally:
        process.kill()
        process.wait(10)
        process.stdout.close()


class Reader(HostWatch):
    """A host that counts what arrives of each machine, and how old it is."""

    def __init__(self, address: BrokerAddress) -> None:
        super().__init__(address, "reader")
        self.messages: dict[str, int] = {}
        self.numbers: dict[str, set[int]] = {}
        self.repeated = 0
        self.ages_s: list[float] = []
        self.births: dict[str, float] = {}

    def take(self, event: HostEvent) -> None:
        if event.device is None:
            return
        if event.kind is EventKind.BIRTH:
            self.births.setdefault(event.device, time.monotonic())
        elif event.kind is EventKind.DATA:
            self._take(event.device, event.readings)

    def _take(self, device: str, readings: object) -> None:
        told = {reading.name: reading for reading in readings}  # type: ignore[attr-defined]
        self.messages[device] = self.messages.get(device, 0) + 1
        number = int(told["edge_sequence"].value)
        numbers = self.numbers.setdefault(device, set())
        self.repeated += number in numbers
        numbers.add(number)
        if not told["edge_sequence"].is_historical:
            self.ages_s.append(time.time() - told["edge_sequence"].timestamp_ms / 1000)


def gateway(machines: int, rate_hz: float, seconds: float, pin: bool) -> None:
    """Machines at 10 Hz behind MTConnect agents, in one process of `cnctwin edge run FOLDER`; `pin`: on one processor."""
    with (
        tempfile.TemporaryDirectory() as temporary,
        Mosquitto() as mosquitto,
        child("-m", "benchmarks.edges.load", str(rate_hz)) as load,
    ):
        assert load.stdout is not None
        port, folder = load.stdout.readline().strip(), Path(temporary)
        for number in range(machines):
            (folder / f"m{number:02d}.toml").write_text(
                f'[machine]\nname = "m{number:02d}"\n[broker]\nurl = "mqtt://127.0.0.1:{mosquitto.port}"\n'
                f'session_file = "{folder}/state/m{number:02d}"\n[store]\nfree_bytes_min = 0\n'
                f'[mtconnect]\nurl = "http://127.0.0.1:{port}/m{number:02d}"\n'
            )
        with Reader(BrokerAddress(*mosquitto.address)) as reader, child("-m", "cnctwin", "edge", "run", str(folder)) as edge:
            if pin:  # before it has threads, which inherit it
                os.sched_setaffinity(edge.pid, {max(os.sched_getaffinity(0))})
            deadline_s = time.monotonic() + 120
            while len(reader.messages) < machines and time.monotonic() < deadline_s:
                time.sleep(0.2)
            time.sleep(3.0)
            before, used_s, began_s = sum(reader.messages.values()), cpu_s(edge.pid), time.monotonic()
            reader.ages_s.clear()
            time.sleep(seconds)
            wall_s = time.monotonic() - began_s
            messages, used_s = sum(reader.messages.values()) - before, cpu_s(edge.pid) - used_s
            memory = next(line for line in Path(f"/proc/{edge.pid}/status").read_text().splitlines() if "VmRSS" in line)
            ages = sorted(reader.ages_s)
    floor_us = xml_floor_us()
    print(f"{len(reader.messages)} of {machines} machines, {messages / wall_s:.0f} messages/s of 8 values for {wall_s:.0f} s")
    where, message_us = " on one processor" if pin else "", 1e6 * used_s / messages
    print(f"gateway{where}: {used_s / wall_s:.2f} of a core, {message_us:.0f} us a message, {memory.split()[1]} kB")
    print(f"of it reading the XML with the C parser alone: {floor_us:.0f} us a document")
    print(f"age at the reader: median {1000 * ages[len(ages) // 2]:.0f} ms, 99 % {1000 * ages[len(ages) * 99 // 100]:.0f} ms")


def xml_floor_us() -> float:
    """Return what nobody can do without, in the same run."""
    document = streams(100, observations(1, 92, time.time()))
    return 1e6 * timed(lambda: [ET.fromstring(document) for _ in range(2_000)]) / 2_000


# A day without a broker.


def outage(hours: float, kills: int, rows_per_s: int, seed: int) -> None:
    """An edge at 10 Hz, its day sped up; the broker comes back at its end. The control is `benchmarks.edges.outage`."""
    chance = random.Random(seed)
    looks = round(hours * 36_000)
    with tempfile.TemporaryDirectory() as temporary, Mosquitto() as mosquitto:
        mosquitto.kill()
        folder, began_s = Path(temporary), time.monotonic()
        command = ["-m", "benchmarks.edges.outage", str(folder), str(mosquitto.port), str(looks), str(rows_per_s)]
        died = 0
        for kill in range(kills):
            upto = round(looks * (kill + chance.random()) / kills)
            with child(*command) as edge:
                while stored(folder) < upto and edge.poll() is None:
                    time.sleep(0.01)
                died += edge.poll() is None
        with Reader(BrokerAddress(*mosquitto.address)) as reader, child(*command) as edge:
            while stored(folder) < looks:
                time.sleep(0.1)
            filled_s, size = time.monotonic() - began_s, sum(f.stat().st_size for f in folder.glob("session.store*"))
            mosquitto.restart()
            back_s = time.monotonic()
            while "vmc" not in reader.births:
                time.sleep(0.01)
            live_s = reader.births["vmc"] - back_s
            wanted = set(range(1, looks + 1))
            while not wanted <= reader.numbers.get("vmc", set()) and time.monotonic() < back_s + 3600:
                time.sleep(0.5)
            drained_s = time.monotonic() - back_s
            numbers = reader.numbers["vmc"]
    print(f"{hours:g} h at 10 Hz = {looks} rows, edge killed {died} times; {size / 1e6:.0f} MB, written in {filled_s:.0f} s")
    print(f"present values {live_s:.2f} s after the broker's return; {len(numbers)} different rows in {drained_s:.0f} s")
    print(f"every row arrived: {wanted <= numbers}; came again and were told apart by their number: {reader.repeated}")


def stored(folder: Path) -> int:
    """The last number that was given, as another process sees it."""
    with suppress(sqlite3.Error):
        db = sqlite3.connect(f"file:{folder}/session.store?mode=ro", uri=True, timeout=1.0)
        try:
            return int((db.execute("SELECT seq FROM sqlite_sequence").fetchone() or (0,))[0])
        finally:
            db.close()
    return 0


def main() -> None:
    """Run what is asked for."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("what", choices=("store", "gateway", "outage"))
    parser.add_argument("--rows", type=int, default=100_000)
    parser.add_argument("--machines", type=int, default=50)
    parser.add_argument("--rate-hz", type=float, default=10.0)
    parser.add_argument("--pin", action="store_true", help="the gateway on one processor, as CPUAffinity of systemd does")
    parser.add_argument("--seconds", type=float, default=20.0)
    parser.add_argument("--hours", type=float, default=24.0)
    parser.add_argument("--kills", type=int, default=10)
    parser.add_argument("--rows-per-s", type=int, default=5_000)
    parser.add_argument("--seed", type=int, default=1)
    chosen = parser.parse_args()
    if chosen.what == "store":
        store(chosen.rows)
    elif chosen.what == "gateway":
        gateway(chosen.machines, chosen.rate_hz, chosen.seconds, chosen.pin)
    else:
        outage(chosen.hours, chosen.kills, chosen.rows_per_s, chosen.seed)


if __name__ == "__main__":
    main()
