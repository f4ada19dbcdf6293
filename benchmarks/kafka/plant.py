"""A plant on Kafka: machines, Mosquitto, bridge, Kafka and runners as a user starts them, and what each takes of the computer."""

import json
import multiprocessing
import sys
import time
from collections.abc import Iterator, Sequence
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass, field
from multiprocessing.connection import Connection
from pathlib import Path

from benchmarks.hall import load
from benchmarks.hall.load import Order, Tally
from benchmarks.hall.machine import GROUP
from benchmarks.hall.usage import busy_s, usage_of
from cnctwin.kafka.kept import read_kept
from cnctwin.kafka.settings import KafkaSettings
from cnctwin.kafka.topics import Topics, ensure
from cnctwin.processes.child import Child
from cnctwin.processes.port import free_port
from cnctwin.processes.private_broker import PrivateBroker
from tests.kafka.kafka_server import KafkaServer

_SPAWN = multiprocessing.get_context("spawn")
COMMAND = (sys.executable, "-m", "cnctwin")


@dataclass(frozen=True, slots=True)
class Live:
    """The figures of a window: CPU time of each part, µs a message that the machines sent."""

    machines: int
    messages: int
    us: dict[str, float]
    cores: dict[str, float]
    rss_mb: dict[str, float]
    elsewhere: float
    late_ms: float
    kafka_bytes: dict[str, float]
    lag_s: float
    transactions: float


@dataclass(slots=True)
class Plant:
    """The processes of a trial."""

    kafka: KafkaServer
    broker: PrivateBroker
    folder: Path
    settings: KafkaSettings
    children: dict[str, Child] = field(default_factory=dict)
    loads: list[tuple[Connection, int]] = field(default_factory=list)
    machines: int = 0
    is_preferred: bool = False

    def options(self) -> list[str]:
        """Return the options that bridge and runner share."""
        path = self.folder / "kafka.toml"
        path.write_text(
            f"partitions = {self.settings.partitions}\nreplication_factor = 1\nsnapshot_s = {self.settings.snapshot_s}\n"
        )
        return ["--kafka", self.kafka.bootstrap, "--kafka-config", str(path)]

    def start(self, name: str, *command: str) -> None:
        """Start a program of ours."""
        child = self.children[name] = Child(name, [*COMMAND, *command], self.folder / f"{name}.log")
        child.start()
        self._prefer(child.pid)

    def _prefer(self, pid: int | None) -> None:
        """Give a process precedence over others of this computer, where that is wanted and allowed."""
        if self.is_preferred and pid is not None:
            load.prefer(pid)

    def bridge(self, processors: Sequence[str], *, results: str) -> None:
        """Start the bridge."""
        own = ["--broker", self.broker.address.url, "--state-dir", str(self.folder / "state"), "--name", "b0"]
        self.start("bridge", "bridge", *self.options(), *own, "--processors", ",".join(processors), "--results", results)

    def runner(self, name: str, processors: Sequence[str]) -> None:
        """Start a runner."""
        self.start(name, "process", *processors, *self.options(), "--member", name)

    def bear(self, machines: int, hz: float) -> None:
        """Have machines connected and born; then they send."""
        ours, theirs = _SPAWN.Pipe()
        process = _SPAWN.Process(target=load.serve, args=(Order(self.broker.port, range(machines), hz), theirs), daemon=True)
        process.start()
        theirs.close()
        if not ours.poll(60.0):
            raise SystemExit("the load does not start")
        ours.recv()
        ours.send("go")
        assert process.pid is not None
        self.loads.append((ours, process.pid))
        self.machines = machines

    def silence(self) -> None:
        """End the load."""
        for pipe, pid in self.loads:
            pipe.send(None)
            for process in multiprocessing.active_children():
                if process.pid == pid:
                    process.join(10.0)
        self.loads.clear()

    def _used(self) -> dict[str, tuple[float, float]]:
        pids = {"mosquitto": self.broker.child.pid, "kafka": self.kafka.pid, "load": self.loads[0][1]}
        pids |= {name: child.pid for name, child in self.children.items()}
        used = {name: usage_of(pid) for name, pid in pids.items() if pid is not None}
        return {name: (one.cpu_s, one.rss_mb) for name, one in used.items()}

    def log_bytes(self) -> dict[str, int]:
        """Return the bytes of each topic's segments."""
        found: dict[str, int] = {}
        for path in (self.kafka.home / "data").glob(f"cnctwin.{GROUP}.*/*.log"):
            name = path.parent.name.rpartition("-")[0].removeprefix(f"cnctwin.{GROUP}.")
            found[name] = found.get(name, 0) + path.stat().st_size
        return found

    def look(self, seconds: float) -> Live:
        """Return the figures of a window that begins now."""
        ((pipe, _),) = self.loads
        begin_s = time.time()
        pipe.send(("window", (round(begin_s * 1000), round((begin_s + seconds) * 1000))))
        before, busy_before, bytes_before, committed = self._used(), busy_s(), self.log_bytes(), self._health()
        began_s = time.monotonic()
        time.sleep(seconds)
        after, busy_after, bytes_after, told = self._used(), busy_s(), self.log_bytes(), self._health()
        wall_s = time.monotonic() - began_s
        pipe.send(("report", None))
        tally: Tally = pipe.recv()[0]
        for name, child in self.children.items():
            if not child.running:
                raise SystemExit(f"{name} has ended: {child.last_words()}")
        spent = {name: after[name][0] - before[name][0] for name in after}
        late = sorted(tally.late_ms)
        return Live(
            machines=self.machines,
            messages=tally.sent,
            us={name: one / tally.sent * 1e6 for name, one in spent.items()},
            cores={name: one / wall_s for name, one in spent.items()},
            rss_mb={name: after[name][1] for name in after},
            elsewhere=max(0.0, (busy_after - busy_before - sum(spent.values())) / wall_s),
            late_ms=late[len(late) * 99 // 100] if late else 0.0,
            kafka_bytes={name: (bytes_after[name] - bytes_before.get(name, 0)) / tally.sent for name in bytes_after},
            lag_s=max((one["lag_s"] for one in told), default=0.0),
            transactions=(sum(one["transactions"] for one in told) - sum(one["transactions"] for one in committed)) / wall_s,
        )

    def _health(self) -> list[dict[str, float]]:
        """Return the newest word of each runner."""
        kept = read_kept(self.settings.client(), Topics(GROUP).health, range(self.settings.partitions), timeout_s=10.0)
        words = [json.loads(value) for of_partition in kept.values() for value in of_partition.values()]
        return [word for word in words if "lag_s" in word]  # a bridge's word has none


@contextmanager
def plant(
    folder: Path, *, partitions: int = 12, snapshot_s: float = 5.0, cells: Sequence[str] = (), prefer: bool = False
) -> Iterator[Plant]:
    """Start Kafka and Mosquitto; what is started on them ends with them. `cells`: processors that compare machines."""
    folder.mkdir(parents=True, exist_ok=True)
    (folder / "kafka").mkdir()
    with ExitStack() as stack:
        kafka = stack.enter_context(KafkaServer(folder / "kafka"))
        broker = PrivateBroker(folder / "broker", free_port())
        broker.start()
        stack.callback(broker.stop)
        settings = KafkaSettings(
            bootstrap=kafka.bootstrap, partitions=partitions, replication_factor=1, snapshot_s=snapshot_s, session_s=10.0
        )
        ensure(settings, Topics(GROUP), cells)
        running = Plant(kafka, broker, folder, settings, is_preferred=prefer)
        for pid in (kafka.pid, broker.child.pid):
            running._prefer(pid)
        try:
            yield running
        finally:
            running.silence()
            for child in reversed(running.children.values()):
                child.stop()
