"""The price of waiting for receipts: edges with `await_receipt = false` and "auto", in turn, with a historian on a real broker.

    python -m benchmarks.store.receipts [--machines 10] [--seconds 20] [--turns 2]

Each turn is a plant of its own: Mosquitto, `cnctwin process historian` and edges that tell eight values ten times a second.
Messages are what the broker has received, by its own count; CPU is of the edges and of the historian; the ring is files.
"""

import argparse
import os
import statistics
import sys
import tempfile
import threading
import time
from pathlib import Path
from typing import Literal

from edge.config import StoreSection
from edge.running.forwarder import Forwarder
from edge.running.ring import Ring
from edge.sample import EdgeSample
from sparkplug.actions import HostState
from sparkplug.broker import BrokerAddress
from sparkplug.datatype import DataType
from sparkplug.edge_node import EdgeNode
from sparkplug.edge_session import Command
from sparkplug.metric import MetricSpec, NodeId
from sparkplug.transport.loop import Loop
from tests.cnctwin.program import Program
from tests.wire.mosquitto import Mosquitto
from twin.vocabulary.nodes import HISTORIAN_NODE

SIGNALS = (*(f"axis_{axis}_load_pct" for axis in "xyzabc"), "spindle_rpm", "spindle_load_pct")
EVERY_S = 0.1
SETTLE_S = 6.0
Setting = Literal["auto"] | bool


class Edge:
    """An edge without a control."""

    def __init__(self, folder: Path, number: int, address: BrokerAddress, setting: Setting, loop: Loop) -> None:
        self.name = f"vmc-{number}"
        limits = StoreSection(free_bytes_min=0, await_receipt=setting)
        self.node = EdgeNode(
            address,
            NodeId("cnc", f"edge-{self.name}"),
            session_file=folder / f"{self.name}.session",
            barrier_topic=f"cnctwin/barrier/cnc/edge-{self.name}",
            on_confirmed=lambda token: self.forwarder.confirmed(token),  # noqa: PLW0108  it is made below
            on_command=self._commanded,
            watched_hosts=[HISTORIAN_NODE] if setting == "auto" else [],
            on_host_state=self._host_state,
            loop=loop,
        )
        self.file = folder / f"{self.name}.ring"
        ring = Ring(self.file, limits, wall_ms=lambda: time.time_ns() // 1_000_000, clock=time.monotonic)
        self.forwarder = Forwarder(ring, self.node, self.name, limits, time.monotonic)
        metrics = [*(MetricSpec(name, DataType.DOUBLE) for name in SIGNALS), *self.forwarder.metrics()]
        self.node.declare_device(self.name, metrics)
        self.forwarder.declare(metric.name for metric in metrics)

    def _commanded(self, command: Command) -> None:
        if isinstance(command.value, str):
            self.forwarder.receipt(command.value)

    def _host_state(self, host: str, state: HostState | None) -> None:
        self.forwarder.host_state(host, state)

    def turn(self, tick: int) -> None:
        """One message of all signals, and what is due."""
        now_ms = time.time_ns() // 1_000_000
        row = [EdgeSample(name, (tick * (n + 1)) % 1000 / 10, now_ms) for n, name in enumerate(SIGNALS)]
        self.forwarder.put([row], None)
        self.forwarder.pump()


def received(mosquitto: Mosquitto) -> int:
    """Return the number of PUBLISH that the broker has received."""
    from paho.mqtt import subscribe  # noqa: PLC0415

    told = subscribe.simple("$SYS/broker/publish/messages/received", hostname="127.0.0.1", port=mosquitto.port)
    return int(told.payload)  # type: ignore[union-attr]


def cpu_s(pid: int) -> float:
    """The processor time of a process."""
    fields = Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()
    return (int(fields[11]) + int(fields[12])) / os.sysconf("SC_CLK_TCK")


def measured(folder: Path, machines: int, seconds: float, setting: Setting) -> dict[str, float]:
    """One plant."""
    (folder / "log").mkdir()
    settings = folder / "processors.toml"
    settings.write_text(f'[historian]\nstore = "{folder / "store"}"\n')
    with Mosquitto(extra=("sys_interval 1",)) as mosquitto:
        broker = f"mqtt://127.0.0.1:{mosquitto.port}"
        command = ["process", "historian", "--config", str(settings), "--broker", broker, "--state-dir", str(folder / "state")]
        with Program(folder / "log", *command) as historian:
            loop = Loop("edges")
            address = BrokerAddress(*mosquitto.address)
            edges = [Edge(folder, number, address, setting, loop) for number in range(machines)]
            for edge in edges:
                edge.node.start()
            ends = threading.Event()
            began_s, tick = time.monotonic(), 0
            counts: dict[str, float] = {}
            ring_bytes = 0
            while not ends.is_set():
                for edge in edges:
                    edge.turn(tick)
                tick += 1
                now_s = time.monotonic() - began_s
                if "messages" not in counts and now_s >= SETTLE_S:
                    counts = {
                        "messages": received(mosquitto),
                        "edges": time.process_time(),
                        "historian": cpu_s(historian.process.pid),
                    }
                    from_s = time.monotonic()
                elif now_s >= SETTLE_S + seconds:
                    ends.set()
                time.sleep(max(began_s + tick * EVERY_S - time.monotonic(), 0.0))
            took_s = time.monotonic() - from_s
            done = {"messages": received(mosquitto), "edges": time.process_time(), "historian": cpu_s(historian.process.pid)}
            for edge in edges:
                ring_bytes += edge.file.stat().st_size + edge.file.with_name(edge.file.name + "-wal").stat().st_size
                edge.node.stop()
                edge.forwarder.close()
    return {
        "messages a second and machine": (done["messages"] - counts["messages"]) / took_s / machines,
        "edges, CPU µs a row": 1e6 * (done["edges"] - counts["edges"]) / took_s / machines * EVERY_S,
        "historian, CPU µs a row": 1e6 * (done["historian"] - counts["historian"]) / took_s / machines * EVERY_S,
        "ring, kB a machine": ring_bytes / machines / 1000,
    }


def main() -> int:
    """Measure, and print."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--machines", type=int, default=10)
    parser.add_argument("--seconds", type=float, default=20.0)
    parser.add_argument("--turns", type=int, default=2)
    asked = parser.parse_args()
    settings: tuple[Setting, ...] = (False, "auto")
    told: dict[Setting, list[dict[str, float]]] = {setting: [] for setting in settings}
    for turn in range(asked.turns):
        for setting in settings if turn % 2 == 0 else settings[::-1]:
            with tempfile.TemporaryDirectory() as folder:
                told[setting].append(measured(Path(folder), asked.machines, asked.seconds, setting))
    for name in told[False][0]:
        figures = "   ".join(
            f"{setting!s:>5} {statistics.mean(one[name] for one in told[setting]):8.2f}"
            f" ({', '.join(f'{one[name]:.2f}' for one in told[setting])})"
            for setting in settings
        )
        sys.stdout.write(f"{name:32} {figures}\n")
    return 0


if __name__ == "__main__":
    sys.exit(main())
