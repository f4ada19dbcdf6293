"""Measure what the page's server costs: machines on a real broker, `cnctwin serve`, and readers of its streams.

    .venv/bin/python benchmarks/page/load.py [--machines 50] [--hz 10] [--signals 20] [--readers 4] [--seconds 20]

    .venv/bin/python benchmarks/page/load.py --fill      (no broker: memory when all traces are full, and what a value costs)
    .venv/bin/python benchmarks/page/load.py --births --machines 1000 --signals 80

Prints processor time and memory of the server, how late rows reach a reader, and how long /machines and /state take.
"""

import argparse
import json
import os
import statistics
import subprocess
import sys
import threading
import time
from pathlib import Path
from tempfile import TemporaryDirectory

import httpx

from cnctwin.api.live.plant import LivePlant
from cnctwin.api.live.trace import SAMPLES_MAX
from cnctwin.processes.private_broker import PrivateBroker
from sparkplug.broker import BrokerAddress
from sparkplug.datatype import DataType
from sparkplug.edge_node import EdgeNode
from sparkplug.host_session import EventKind, HostEvent
from sparkplug.metric import Change, MetricSpec, NodeId, Reading
from sparkplug.quality import Quality

TEXTS = ("exec_state", "program")


def main() -> None:
    """Run it."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--machines", type=int, default=50)
    parser.add_argument("--hz", type=float, default=10.0)
    parser.add_argument("--signals", type=int, default=20)
    parser.add_argument("--readers", type=int, default=4, help="of machines; one of the fleet comes on top")
    parser.add_argument("--seconds", type=float, default=20.0)
    parser.add_argument("--publish", metavar="PORT", type=int, help=argparse.SUPPRESS)
    parser.add_argument("--fill", action="store_true", help="fill the traces of a live plant in this process")
    parser.add_argument("--births", action="store_true", help="give a live plant in this process the births of all machines")
    given = parser.parse_args()
    if given.births:
        births(given)
        return
    if given.fill:
        fill(given)
        return
    if given.publish:
        publish(given)
        return
    with TemporaryDirectory(prefix="page-load-") as folder:
        measure(given, Path(folder))


def births(given: argparse.Namespace) -> None:
    """Measure what a server spends when all machines are born as it starts, without a broker and a decoder."""
    live, names = LivePlant(), [f"signal_{number}" for number in range(given.signals)]
    nodes = [(NodeId("cnc", f"edge-m{number:03}"), f"m{number:03}") for number in range(given.machines)]
    events, begun_s = [_event(EventKind.BIRTH, *node, names, 1) for node in nodes], time.process_time()
    live.take(events, 1)
    print(f"{given.machines} births of {given.signals} signals: {time.process_time() - begun_s:.2f} s of CPU")


def fill(given: argparse.Namespace) -> None:
    """Measure what the cache takes when every trace holds as much as it may, without a broker and a decoder."""
    live, names, before_mb = LivePlant(), [f"signal_{number}" for number in range(given.signals)], memory_mb(os.getpid())
    nodes = [(NodeId("cnc", f"edge-m{number:02}"), f"m{number:02}") for number in range(given.machines)]
    live.take([_event(EventKind.BIRTH, *node, names, 0) for node in nodes], 0)
    begun_s, count = time.process_time(), 0
    for t_ms in range(100, 100 * 2 * SAMPLES_MAX, 100):
        events = [_event(EventKind.DATA, *node, names, t_ms) for node in nodes]
        count += len(events) * len(names)
        live.take(events, t_ms)
    took_us = 1e6 * (time.process_time() - begun_s) / count
    grown_mb = memory_mb(os.getpid()) - before_mb
    print(f"{given.machines} machines x {given.signals} signals, all traces full: {grown_mb:.0f} MB; {took_us:.2f} us a value")


def _event(kind: EventKind, node: NodeId, machine: str, names: list[str], t_ms: int) -> HostEvent:
    readings = tuple(Reading(name, t_ms * 0.001, t_ms, Quality.GOOD, "%", None, False) for name in names)
    return HostEvent(kind, node, machine, t_ms, readings)


def publish(given: argparse.Namespace) -> None:
    """The machines: all values change with every message."""
    names = ["spindle_load_pct", "spindle_rpm", *(f"signal_{number}" for number in range(given.signals - 2))]
    broker = BrokerAddress("127.0.0.1", given.publish)
    edges = []
    for number in range(given.machines):
        edge = EdgeNode(broker, NodeId("cnc", f"edge-m{number:02}"))
        specs = [MetricSpec(name, DataType.DOUBLE, "%") for name in names]
        edge.declare_device(f"m{number:02}", [*specs, *(MetricSpec(name, DataType.STRING, value="ACTIVE") for name in TEXTS)])
        edge.start()
        edges.append(edge)
    begun_s, count = time.monotonic(), 0
    while True:
        for number, edge in enumerate(edges):
            now_ms = time.time_ns() // 1_000_000
            edge.publish(f"m{number:02}", [Change(name, 0.1 * ((count + len(name)) % 977), now_ms) for name in names])
            count += 1
            due_s = begun_s + count / (given.machines * given.hz)
            if (wait_s := due_s - time.monotonic()) > 0:
                time.sleep(wait_s)


def measure(given: argparse.Namespace, folder: Path) -> None:
    """Start all, listen, and say what it took."""
    broker = PrivateBroker(folder)
    broker.start()
    state = folder / "state.json"
    serve = ["-m", "cnctwin", "serve", "--broker", broker.address.url, "--port", "0", "--no-open", "--state-file", str(state)]
    options = [f"--{name}={getattr(given, name)}" for name in ("machines", "hz", "signals")]
    children = [
        subprocess.Popen([sys.executable, *serve], stdout=subprocess.DEVNULL),
        subprocess.Popen([sys.executable, __file__, f"--publish={broker.port}", *options]),
    ]
    try:
        url, pid = wait_until_seen(state, given.machines)
        lags_ms: list[float] = []
        names: list[str | None] = [None, *(f"m{number:02}" for number in range(given.readers))]
        stop = threading.Event()
        threads = [threading.Thread(target=read, args=(url, name, lags_ms, stop), daemon=True) for name in names]
        for thread in threads:
            thread.start()
        time.sleep(3.0)
        lags_ms.clear()
        messages, before_s, begun_s = counted(url, "messages"), cpu_s(pid), time.monotonic()
        asked_ms = ask(url, given.seconds)
        used_s, messages = cpu_s(pid) - before_s, counted(url, "messages") - messages
        share = 100.0 * used_s / (time.monotonic() - begun_s)
        stop.set()
        taken = list(lags_ms)
        dropped = counted(url, "dropped")
        print(f"{given.machines} machines x {given.hz:g} Hz x {given.signals} signals, {len(names)} streams, {given.seconds:g} s")
        print(f"server: {share:.1f} % of a core, {1e6 * used_s / messages:.0f} us a message, with all that is asked")
        print(f"{memory_mb(pid):.0f} MB resident, {dropped:.0f} messages dropped")
        cuts = statistics.quantiles(taken, n=100)
        print(f"event to reader: median {cuts[49]:.0f} ms, 95 % {cuts[94]:.0f} ms, {len(taken)} rows")
        for path, times_ms in asked_ms.items():
            print(f"GET {path}: median {statistics.median(times_ms):.1f} ms of {len(times_ms)}")
    finally:
        for child in children:
            child.terminate()
            child.wait(10)
        broker.stop()


def counted(url: str, what: str) -> float:
    """Return a count of the server."""
    metrics = httpx.get(f"{url}/metrics").text.splitlines()
    return sum(float(line.split()[-1]) for line in metrics if line.startswith(f"twin_page_{what}_total"))


def ask(url: str, seconds: float) -> dict[str, list[float]]:
    """Ask now and then, as a page does."""
    asked_ms: dict[str, list[float]] = {"/machines": [], "/state/m00": [], "/metrics": [], "/health": []}
    until_s = time.monotonic() + seconds
    with httpx.Client(base_url=url) as client:
        while time.monotonic() < until_s:
            for path, times_ms in asked_ms.items():
                begun_s = time.perf_counter()
                client.get(path).raise_for_status()
                times_ms.append(1000.0 * (time.perf_counter() - begun_s))
            time.sleep(1.0)
    return asked_ms


def read(url: str, machine: str | None, lags_ms: list[float], stop: threading.Event) -> None:
    """One stream, as long as the measurement runs."""
    with httpx.stream("GET", f"{url}/stream", params={} if machine is None else {"machine": machine}, timeout=30.0) as answer:
        for line in answer.iter_lines():
            if stop.is_set():
                return
            if line.startswith("data: ") and '"rows"' in line[:40]:
                now_ms = time.time() * 1000.0
                at = 1 if machine is None else 0
                lags_ms += [now_ms - row[at] for row in json.loads(line[6:])["rows"]]


def wait_until_seen(state: Path, machines: int) -> tuple[str, int]:
    """The server's address and process, once it knows all machines."""
    deadline_s = time.monotonic() + 60.0
    while time.monotonic() < deadline_s:
        if state.exists():
            told = json.loads(state.read_text())
            if told["machines"] >= machines:
                return told["url"], told["pid"]
        time.sleep(0.1)
    raise SystemExit("the server did not hear of all machines within 60 s")


def cpu_s(pid: int) -> float:
    """Processor time of a process so far."""
    fields = Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()
    return (int(fields[11]) + int(fields[12])) / os.sysconf("SC_CLK_TCK")


def memory_mb(pid: int) -> float:
    """Its resident memory."""
    return int(Path(f"/proc/{pid}/statm").read_text().split()[1]) * os.sysconf("SC_PAGE_SIZE") / 1e6


if __name__ == "__main__":
    main()
