"""The whole stack for an hour: broker, an edge of four machines at 10 Hz, all processors, the store and the page.

    .venv/bin/python -m benchmarks.stack                     # an hour
    .venv/bin/python -m benchmarks.stack --seconds 300

The machines are simulated ones behind MTConnect agents, as in the demo; what they and the reader of the page cost is told apart.
Memory is the proportional set size (pages that processes share are counted once); processor time is what the kernel counts. The
aims: 1.5 GB, and a third of two cores.
"""

import argparse
import json
import sys
import tempfile
import threading
import time
from collections.abc import Mapping
from contextlib import ExitStack
from pathlib import Path

import httpx

from benchmarks.edges.cost import cpu_s
from cnctwin.plant.view import ledgers
from cnctwin.plant.watch import viewer
from cnctwin.processes.child import Child
from cnctwin.processes.private_broker import PrivateBroker
from cnctwin.standins.simulated_machine import description
from cnctwin.standins.simulated_machine.anomaly_model import place_model
from cnctwin.standins.simulated_machine.expectation import place_expectation
from processors.discovery import discover
from sparkplug.host import EventKind, HostApplication

MACHINES = ("vmc1", "vmc2", "vmc3", "vmc4")
MEMORY_AIM_GB, CORES_AIM = 1.5, 2.0 / 3.0
LOOK_S = 5.0
CNCTWIN = [sys.executable, "-m", "cnctwin"]


class Stack:
    """The parts, each a process; those whose name begins with `machine` stand in for the controls."""

    def __init__(self, folder: Path) -> None:
        self.folder, self.parts = folder, dict[str, Child]()
        self.broker = PrivateBroker(folder / "broker")
        self.page_url = ""

    def start(self) -> None:
        """All of it, until the page answers."""
        self.broker.start()
        self.parts["broker"] = self.broker.child
        edges = self.folder / "edges"
        edges.mkdir()
        for machine in MACHINES:
            state = self.folder / f"{machine}.json"
            self._begin(f"machine {machine}", "simulate-control", "machine", "--state-file", str(state))
            (edges / f"{machine}.toml").write_text(
                f'[machine]\nname = "{machine}"\n[broker]\nurl = "{self.broker.address.url}"\n'
                f'session_file = "{self.folder}/edge-{machine}.json"\n[mtconnect]\nurl = "{said(state, "url")}"\n'
            )
        settings = self.folder / "processors.toml"
        expectations = self.folder / "expectations"
        expected = [place_expectation(expectations, machine) for machine in MACHINES]
        models = [place_model(self.folder / "models", machine, expectations) for machine in MACHINES]
        store = self.folder / "store"
        settings.write_text(
            f"{description.PROCESSORS.read_text()}{expected[0]}{models[0]}\n[historian]\nstore = {json.dumps(str(store))}\n"
        )
        broker = ["--broker", self.broker.address.url]
        self._begin("processors", "process", *discover(), "--config", str(settings), *broker, "--state-dir", str(self.folder))
        self._begin("edge", "edge", "run", str(edges))
        page = self.folder / "page.json"
        given = ["--config", str(settings), "--store", str(store), "--port", "0", "--state-file", str(page), "--no-open"]
        self._begin("page", "serve", *given, *broker)
        self.page_url = said(page, "url")

    def _begin(self, name: str, *arguments: str) -> None:
        child = Child(name, [*CNCTWIN, *arguments], self.folder / f"{name.replace(' ', '-')}.log")
        self.parts[name] = child
        child.start()

    def stop(self) -> None:
        """The last one first."""
        for child in reversed(self.parts.values()):
            child.stop()
        self.broker.stop()


def said(state_file: Path, key: str) -> str:
    """Return what a child says of itself, once it does."""
    deadline_s = time.monotonic() + 120.0
    while time.monotonic() < deadline_s:
        try:
            return str(json.loads(state_file.read_text())[key])
        except (OSError, ValueError, KeyError):
            time.sleep(0.1)
    raise SystemExit(f"{state_file.stem} does not start; its log lies beside {state_file}")


def pss_mb(pid: int) -> float:
    """The proportional set size of a process."""
    for line in Path(f"/proc/{pid}/smaps_rollup").read_text().splitlines():
        if line.startswith("Pss:"):
            return int(line.split()[1]) / 1000
    return 0.0


class PageReader(threading.Thread):
    """A reader like a browser: the stream of the fleet and of one machine."""

    def __init__(self, url: str) -> None:
        super().__init__(daemon=True)
        self.url, self.bytes, self.rows = url, 0, 0

    def run(self) -> None:
        with (
            httpx.Client(timeout=30.0) as client,
            client.stream("GET", f"{self.url.rstrip('/')}/stream?machine={MACHINES[0]}") as answer,
        ):
            for line in answer.iter_lines():
                self.bytes += len(line)
                self.rows += line.startswith("event: rows")


def watch(host: HostApplication, seconds: float, stack: Stack) -> tuple[dict[str, float], dict[str, float], list[float]]:
    """Seconds of processor time and peak memory of each part, and the ages of the samples at a reader of the broker."""
    pids = {name: child.pid for name, child in stack.parts.items() if child.pid is not None}
    before = {name: cpu_s(pid) for name, pid in pids.items()}
    memory = dict.fromkeys(pids, 0.0)
    ages: list[float] = []
    began_s = looked_s = time.monotonic()
    while (now_s := time.monotonic()) < began_s + seconds:
        for event in host.poll(0.2):
            if event.kind is EventKind.DATA and event.device and event.node.node.startswith("edge") and len(ages) < 1_000_000:
                ages.append(time.time() - event.timestamp_ms / 1000)
        if now_s - looked_s >= LOOK_S:
            looked_s = now_s
            for name, pid in pids.items():
                memory[name] = max(memory[name], pss_mb(pid))
            if sys.stderr.isatty():
                print(f"\r{now_s - began_s:.0f} of {seconds:.0f} s", end="", file=sys.stderr)
    return {name: cpu_s(pid) - before[name] for name, pid in pids.items()}, memory, sorted(ages)


def told(used: Mapping[str, float], memory: Mapping[str, float], seconds: float) -> bool:
    """Print the table; whether the aims are met."""
    own = [name for name in used if not name.startswith("machine")]
    for name in (*own, *(name for name in used if name not in own)):
        print(f"{name:16} {used[name] / seconds:6.3f} cores {memory[name]:7.0f} MB")
    cores, gigabytes = sum(used[name] for name in own) / seconds, sum(memory[name] for name in own) / 1000
    print(f"{'the stack':16} {cores:6.3f} cores (aim {CORES_AIM:.2f}) {gigabytes:.2f} GB (aim {MEMORY_AIM_GB})")
    return cores <= CORES_AIM and gigabytes <= MEMORY_AIM_GB


def main() -> None:
    """Run, print, and exit 1 where an aim is missed or a ledger does not balance."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--seconds", type=float, default=3600.0)
    parser.add_argument("--settle", type=float, default=60.0, help="before it is measured")
    chosen = parser.parse_args()
    with tempfile.TemporaryDirectory(prefix="cnctwin-stack-") as folder, ExitStack() as stack:
        parts = Stack(Path(folder))
        stack.callback(parts.stop)
        parts.start()
        host = viewer(parts.broker.address, "cnc")
        host.start()
        stack.callback(host.stop)
        reader = PageReader(parts.page_url)
        reader.start()
        until_s = time.monotonic() + chosen.settle
        while time.monotonic() < until_s:
            host.poll(0.2)
        used, memory, ages = watch(host, chosen.seconds, parts)
        good = told(used, memory, chosen.seconds)
        size = sum(file.stat().st_size for file in (Path(folder) / "store").rglob("*") if file.is_file())
        stages = ledgers(host)
        print(
            f"messages of the edges at a reader: {len(ages)}, {len(ages) / chosen.seconds:.1f}/s; "
            f"age median {1000 * ages[len(ages) // 2]:.0f} ms, 99 % {1000 * ages[len(ages) * 99 // 100]:.0f} ms"
        )
        print(
            f"page: {reader.rows} events, {reader.bytes / chosen.seconds / 1000:.1f} kB/s; store: {size / 1e6:.1f} MB on the disk"
        )
        wrong = [stage.node for stage in stages if not stage.balances]
        dead = [name for name, child in parts.parts.items() if not child.running]
        print(f"{len(stages)} ledgers, {len(wrong)} do not balance {wrong}; ended before the end: {dead or 'none'}")
    raise SystemExit(0 if good and not wrong and not dead else 1)


if __name__ == "__main__":
    main()
