"""Measure how far the page is behind: fifty machines at 10 Hz on a real broker, `cnctwin serve`, and Debian's Chromium.

    .venv/bin/python benchmarks/page/page.py [--machines 50] [--hz 10] [--seconds 20] [--restarts]

From the stamp of a value to the moment after the frame that shows it was painted: median, 95 %, worst; frames a second; tasks of
the browser's main thread beyond 50 ms; its heap. `--restarts` kills server and broker, and says how long until live again.
"""

import argparse
import json
import os
import signal
import subprocess
import sys
import time
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

from playwright.sync_api import Page, sync_playwright

from cnctwin.processes.private_broker import PrivateBroker
from sparkplug.broker import BrokerAddress
from sparkplug.datatype import DataType
from sparkplug.edge_node import EdgeNode
from sparkplug.metric import Change, MetricSpec, NodeId
from sparkplug.quality import Quality
from tests.cnctwin.page.simulated_shop import SignalValue, signals

WATCH = """() => {
  window.seen = { long: 0, longest: 0, frames: 0 };
  const told = (one) => { seen.long += 1; seen.longest = Math.max(seen.longest, one.duration); };
  new PerformanceObserver((list) => list.getEntries().forEach(told)).observe({ type: 'longtask' });
  const frame = () => { seen.frames += 1; requestAnimationFrame(frame); };
  requestAnimationFrame(frame);
}"""
TAKE = """async () => {
  const { lag } = await import('./page/js/lag.js');
  return { lag: lag(), ...window.seen, heap: performance.memory.usedJSHeapSize / 1e6 };
}"""


def main() -> None:
    """Run it."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--machines", type=int, default=50)
    parser.add_argument("--hz", type=float, default=10.0)
    parser.add_argument("--seconds", type=float, default=20.0)
    parser.add_argument("--restarts", action="store_true", help="kill the server, then the broker")
    parser.add_argument("--publish", metavar="PORT", type=int, help=argparse.SUPPRESS)
    given = parser.parse_args()
    if given.publish:
        publish(given)
        return
    with TemporaryDirectory(prefix="page-") as folder:
        measure(given, Path(folder))


def spec_of(name: str, told: SignalValue) -> MetricSpec:
    """A metric for what is told; a null is a number."""
    kinds = {bool: DataType.BOOLEAN, str: DataType.STRING, int: DataType.INT32}
    datatype = DataType.INT32 if name == "tool_number" else kinds.get(type(told.value), DataType.DOUBLE)
    return MetricSpec(name, datatype, unit=told.unit, properties={"provenance": told.provenance})


def publish(given: argparse.Namespace) -> None:
    """The machines, and a processor for their twins: what changed, so many times a second."""
    broker = BrokerAddress("127.0.0.1", given.publish)
    names = [f"m{number:02}" for number in range(given.machines)]
    twin, edges, before = EdgeNode(broker, NodeId("cnc", "twin-thermal")), [], []
    for number, name in enumerate(names):
        told = signals(number, time.time())
        edge = EdgeNode(broker, NodeId("cnc", f"edge-{name}"))
        edge.declare_device(name, [spec_of(signal_, one) for signal_, one in told.items() if not signal_.startswith("twin/")])
        twin.declare_device(name, [spec_of(signal_, one) for signal_, one in told.items() if signal_.startswith("twin/")])
        edge.start()
        edges.append(edge)
        before.append(dict[str, SignalValue]())
    twin.start()
    begun_s, count = time.monotonic(), 0
    while True:
        for number, edge in enumerate(edges):
            now_ms = time.time_ns() // 1_000_000
            told = signals(number, now_ms / 1000.0)
            changes = [change(name, one, now_ms) for name, one in told.items() if before[number].get(name) != one]
            before[number] = told
            for node, is_twin in ((edge, False), (twin, True)):
                if own := [one for one in changes if one.name.startswith("twin/") is is_twin]:
                    node.publish(names[number], own)
            count += 1
            due_s = begun_s + count / (given.machines * given.hz)
            if (wait_s := due_s - time.monotonic()) > 0:
                time.sleep(wait_s)


def change(name: str, told: SignalValue, now_ms: int) -> Change:
    """Return what changed, as an edge tells it."""
    value = (
        float(told.value)
        if isinstance(told.value, int | float) and spec_of(name, told).datatype is DataType.DOUBLE
        else told.value
    )
    return Change(name, value, now_ms, Quality.BAD if told.reason else Quality.GOOD, told.reason)


def measure(given: argparse.Namespace, folder: Path) -> None:
    """Start all, look, and say what it took."""
    broker = PrivateBroker(folder)
    broker.start()
    options = [f"--machines={given.machines}", f"--hz={given.hz}"]
    publisher = subprocess.Popen([sys.executable, __file__, f"--publish={broker.port}", *options], stderr=subprocess.DEVNULL)
    server = Served(broker.address.url, folder)
    try:
        server.start(given.machines)
        with sync_playwright() as playwright:
            arguments = ["--no-sandbox", "--enable-precise-memory-info"]
            browser = playwright.chromium.launch(executable_path="/usr/bin/chromium", args=arguments)
            page = browser.new_page(viewport={"width": 1280, "height": 800})
            print(f"{given.machines} machines x {given.hz:g} Hz, {given.seconds:g} s each, load average {os.getloadavg()[0]:.1f}")
            for place in ("#/fleet", "#/machine/m01"):
                look(page, f"{server.url}/{place}", place, given.seconds)
            if given.restarts:
                restarts(page, server, broker, given.machines)
            browser.close()
    finally:
        server.stop()
        publisher.terminate()
        publisher.wait(10)
        broker.stop()


class Served:
    """`cnctwin serve`, which keeps its port when it is started again."""

    def __init__(self, broker: str, folder: Path) -> None:
        self._broker, self._state, self.port = broker, folder / "state.json", 0
        self._process: subprocess.Popen[bytes] | None = None

    @property
    def url(self) -> str:
        """Return where the page is."""
        return f"http://127.0.0.1:{self.port}"

    def start(self, machines: int) -> None:
        """Start, and wait until it knows so many machines (0: until it answers)."""
        self._state.unlink(missing_ok=True)
        serve = ["serve", "--broker", self._broker, "--port", str(self.port), "--no-open", "--state-file", str(self._state)]
        self._process = subprocess.Popen([sys.executable, "-m", "cnctwin", *serve], stdout=subprocess.DEVNULL)
        deadline_s = time.monotonic() + 60.0
        while time.monotonic() < deadline_s:
            told = json.loads(self._state.read_text()) if self._state.exists() else {}
            if told and told["machines"] >= machines:
                self.port = told["port"]
                return
            time.sleep(0.1)
        raise SystemExit("the server did not hear of all machines within 60 s")

    def kill(self) -> None:
        """kill -9."""
        assert self._process is not None
        self._process.send_signal(signal.SIGKILL)
        self._process.wait(10)

    def stop(self) -> None:
        """As on the day's end."""
        if self._process is not None:
            self._process.terminate()
            self._process.wait(10)


def look(page: Page, url: str, place: str, seconds: float) -> None:
    """One view for so long."""
    page.goto(url)
    page.wait_for_selector("body[data-link=live]")
    page.wait_for_timeout(4000)
    page.evaluate("async () => (await import('./page/js/lag.js')).forget()")
    page.evaluate(WATCH)
    page.wait_for_timeout(1000 * seconds)
    took: dict[str, Any] = page.evaluate(TAKE)
    lag = took["lag"]
    kept = f"the last {min(lag['count'], 4096)} of {lag['count']} values"
    print(f"{place}: stamp to paint median {lag['median']:.0f} ms, 95 % {lag['p95']:.0f} ms, worst {lag['max']:.0f} ms of {kept}")
    tasks = f"{took['long']} tasks over 50 ms, longest {took['longest']:.0f} ms"
    print(f"  {took['frames'] / seconds:.0f} frames/s, {tasks}, heap {took['heap']:.0f} MB")


def restarts(page: Page, server: Served, broker: PrivateBroker, machines: int) -> None:
    """Kill the server, then the broker; how long the page takes to say so, and to be live again after each is back."""
    page.goto(f"{server.url}/#/fleet")
    page.wait_for_selector("body[data-link=live]")
    server.kill()
    begun_s = time.monotonic()
    page.wait_for_selector("body[data-link=lost]", timeout=30_000)
    print(f"server killed: the page says so after {time.monotonic() - begun_s:.1f} s", end="; ")
    server.start(0)
    begun_s = time.monotonic()
    page.wait_for_selector("body[data-link=live]", timeout=60_000)
    print(f"live again {time.monotonic() - begun_s:.1f} s after the server was back")
    until_all_live(page, machines)
    assert broker.child.pid is not None
    os.kill(broker.child.pid, signal.SIGKILL)
    begun_s = time.monotonic()
    page.wait_for_selector("body:not([data-link=live]), .unit.stale", timeout=30_000)
    print(f"broker killed: the page says so after {time.monotonic() - begun_s:.1f} s", end="; ")
    broker.watch()
    begun_s = time.monotonic()
    until_all_live(page, machines)
    print(f"all live again {time.monotonic() - begun_s:.1f} s after it was started again")


def until_all_live(page: Page, machines: int) -> None:
    """Wait; the page's policy forbids the usual way, which compiles a text."""
    deadline_s = time.monotonic() + 120.0
    while time.monotonic() < deadline_s:
        live = page.evaluate("document.body.dataset.link === 'live' ? document.querySelectorAll('.unit:not(.stale)').length : -1")
        if live == machines:
            return
        page.wait_for_timeout(100)
    raise SystemExit(f"after two minutes only {live} of {machines} machines are live on the page")


if __name__ == "__main__":
    main()
