"""A whole plant: machines, edges, a broker, processors with historian and courier, a page, who is notified, supervisors.

All but the machines, the broker and who is notified is the code that runs in a plant, begun as its commands begin it.
"""

import fcntl
import os
import shutil
import sqlite3
import tempfile
from collections import Counter
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from functools import cache
from pathlib import Path
from random import Random
from types import SimpleNamespace
from typing import Any
from uuid import uuid4

import cnctwin.memory.historian
import cnctwin.memory.store.embedded
import cnctwin.memory.store.sealed.tier
import edge.running.run
import processors.alerts.courier.thread
import processors.alerts.courier.webhook
import processors.running.runner
import processors.running.runtime
import processors.running.worker
import sparkplug.edge_node
import sparkplug.host
from cnctwin.api.live.plant import LivePlant
from cnctwin.api.live.viewer import Viewer
from cnctwin.running.processors import process
from edge.config import BrokerSection, EdgeConfig, MachineSection, StoreSection
from edge.running.driver import Turning
from edge.running.run import edge_runtime
from edge.running.runtime import EdgeRuntime
from edge.sample import Drop
from processors.discovery import find
from sparkplug.broker import BrokerAddress
from tests.plant.simulation.broker import Broker, Link
from tests.plant.simulation.connection import SimulatedConnection, SimulatedLoop
from tests.plant.simulation.control import Machine, NoSection, adapter_of, machine
from tests.plant.simulation.disk import Disk
from tests.plant.simulation.kernel import Kernel, Process
from tests.plant.simulation.observed import ObservedEngine, ObservedForwarder, ObservedRecorder, ObservedRunner
from tests.plant.simulation.receiver import Receiver
from tests.plant.simulation.seams import Event, Stand, clock_of, simulated

IMPORTED_LATE = (processors.alerts.courier.thread, cnctwin.memory.store.embedded, cnctwin.memory.store.sealed.tier)
"""Modules that our code imports when it runs; they have to be there when the names in them are replaced."""
ADDRESS = BrokerAddress()
GROUP = "cnc"
FAULTS_UNTIL_S = 20.0
RUN_S = 24.0
QUIET_S_MAX = 150.0
LOOK_S = 1.0
AUTOSAVE_S = 10.0
REFOLD_EVERY = 3  # seeds; in these each state is compared with a second fold
ALERTS = {
    "receivers": {
        "desk": {"type": "webhook", "url": "https://desk.plant.example/hook", "give_up_after_s": 60.0, "rate_per_hour": 1000}
    },
    "group_wait_s": 1.0,
    "group_interval_s": 5.0,
    "flap_episodes": 50,
    "signals": {"twin/rule_load_over_limit": {"severity": "high", "keep_firing_for_s": 2.0}},
    "machine_offline": {"severity": "medium", "for_s": 20.0, "keep_firing_for_s": 2.0},
    "alarm_source_lost": {"severity": "medium", "for_s": 60.0, "keep_firing_for_s": 2.0},
}
PROCESSORS = ("historian", "mirror", "rules", "thermal")
LOSSES = (Drop.STORE_AGE, Drop.STORE_BYTES, Drop.STORE_DISK, Drop.BROKER_OFFLINE, Drop.UNDECLARED, Drop.CONTROL_LOST)
SHMEM = Path("/dev/shm")


class SimulatedDriver:
    """As edge.running.driver.Driver, for one edge whose reader has a thread: turns, and the loop of its connection."""

    def __init__(self, kernel: Kernel) -> None:
        self.loop = SimulatedLoop("edges mqtt")
        self._kernel = kernel
        self._due: dict[Turning, float] = {}

    def run(self) -> None:
        """Go round and round."""
        while True:
            now_s = self._kernel.now_s
            for one, due_s in list(self._due.items()):
                if due_s <= now_s:
                    wait_s = one.turn()
                    if one in self._due:
                        self._due[one] = now_s + wait_s
            self.loop.turn(min([0.1, *(max(due_s - self._kernel.now_s, 0.001) for due_s in self._due.values())]))

    def add(self, edge: Turning) -> None:
        """Give this edge turns."""
        self._due[edge] = self._kernel.now_s

    def remove(self, edge: Turning) -> None:
        """No more turns."""
        self._due.pop(edge, None)


@cache
def configured(name: str) -> tuple[Any, Any]:
    """Return a processor with the configuration that it has in each plant."""
    processor = find(name)
    return processor, processor.configured(ALERTS if name == "alerts" else None)


class Plant:
    """See the module. `machines` are as many as the seed draws."""

    def __init__(self, seed: int, folder: Path, *, await_receipt: bool = True) -> None:
        chance = Random(f"plant {seed}")
        self.seed, self.chance, self.await_receipt = seed, chance, await_receipt
        self.kernel = kernel = Kernel(seed)
        self.disk = Disk(kernel, folder)
        self.broker = Broker(kernel, latency_s=chance.choice((0.0005, 0.002, 0.02)))
        SimulatedLoop.kernel, SimulatedLoop.broker = kernel, self.broker
        self.receiver = Receiver(kernel, Random(f"receiver {seed}"))
        self.machines = [machine(f"m{n}", n, RUN_S, chance) for n in range(chance.randint(2, 6))]
        self.synchronous = {one.name: chance.choice(("normal", "full")) for one in self.machines}
        self.is_split = chance.random() < 0.6  # alerts and their courier in a process of their own
        self.away_until_s: dict[str, float] = {}
        self.processes: dict[str, Process] = {}
        self.runtimes: dict[str, EdgeRuntime] = {}
        self.runners: dict[str, ObservedRunner] = {}
        self.lives: Counter[str] = Counter()
        self.forgotten: set[str] = set()  # notifications of which a broker that was killed has forgotten something
        self.receipted: dict[str, set[int]] = {}
        self.live = LivePlant()
        self.injected: Counter[str] = Counter()
        self.unstored: Counter[str] = Counter()  # observations that went out past a disk which took nothing
        self.errors: list[BaseException] = []
        self._losses: Counter[str] = Counter()  # of the lives of each edge that are over
        self._mains: dict[str, Callable[[], None]] = {f"edge-{one.name}": self._edge(one) for one in self.machines}
        self._mains["processors"] = self._processors(PROCESSORS if self.is_split else (*PROCESSORS, "alerts"), "processors")
        if self.is_split:
            self._mains["alerts"] = self._processors(("alerts",), "alerts")
        self._mains["page"] = self._page

    @property
    def alerts_process(self) -> str:
        """Return the process in which alerts and courier are."""
        return "alerts" if self.is_split else "processors"

    @property
    def store_folder(self) -> Path:
        """Return the store's folder."""
        return self.disk.folder / "processors" / "store"

    # Processes and their supervisors.

    def begin(self) -> None:
        """Begin all processes, one after the other, in the order that the seed draws."""
        names = list(self._mains)
        self.chance.shuffle(names)
        for name in names:
            self.kernel.at(self.chance.uniform(0.0, 1.5), lambda name=name: self.start(name))  # type: ignore[misc]
        self._autosave()

    def start(self, name: str) -> None:
        """Begin a process."""
        before = self.processes.get(name)
        if before is not None and before.is_alive:
            return
        fresh = Process(self.kernel, name, 0.0 if before is None else before.wall_offset_s)
        self.lives[name] += 1
        fresh.life = self.lives[name]
        self.processes[name] = fresh
        fresh.at_death.append(lambda: self.disk.died(fresh))
        fresh.at_death.append(lambda: self._supervise(fresh))
        fresh.spawn(lambda: self._main(fresh), name)
        self.kernel.note("start", name)

    def _main(self, of: Process) -> None:
        try:
            self._mains[of.name]()
        except Exception as error:
            if not of.is_alive:
                return
            if of.name not in self.disk.full:  # else its supervisor tries again, until there is room
                self.kernel.violated("no process ends by itself", f"{of.name}: {type(error).__name__}: {error}")
                self.errors.append(error)
            self.kernel.note("ended", of.name)
            of.kill()

    def _supervise(self, of: Process) -> None:
        self.kernel.note("died", of.name)
        runtime = self.runtimes.pop(of.name.removeprefix("edge-"), None)
        if runtime is not None:
            self._losses[runtime.config.machine.name] += lost_by(runtime)
        self.kernel.at(self.kernel.now_s + self.chance.uniform(0.5, 4.0), lambda: self.start(of.name))

    def _autosave(self) -> None:
        self.broker.save()
        self.kernel.at(self.kernel.now_s + AUTOSAVE_S, self._autosave)

    def losses(self, machine: str) -> int:
        """Return how many observations of a machine its edge has said to be lost, in all of its lives."""
        runtime = self.runtimes.get(machine)
        return self._losses[machine] + self.unstored[machine] + (0 if runtime is None else lost_by(runtime))

    # What each process does.

    def _edge(self, of: Machine) -> Callable[[], None]:
        def main() -> None:
            kernel, folder = self.kernel, self.disk.folder / f"edge-{of.name}"
            driver = SimulatedDriver(kernel)
            config = EdgeConfig(
                source=NoSection(),
                machine=MachineSection(name=of.name, adapter="simulated", lost_after_s=10.0),
                broker=BrokerSection(group=GROUP, session_file=str(folder / "session.json")),
                store=StoreSection(
                    file=str(folder / "ring.store"),
                    await_receipt=self.await_receipt,
                    synchronous=self.synchronous[of.name],
                ),
            )
            adapter = adapter_of(kernel, of, lambda: kernel.now_s < self.away_until_s.get(of.name, 0.0))
            runtime = edge_runtime(config, ADDRESS, adapter=adapter, driver=driver)  # type: ignore[arg-type]
            self.runtimes[of.name] = runtime
            kernel.me().process.spawn(driver.run, "driver")
            runtime.run()

        return main

    def _processors(self, names: tuple[str, ...], where: str) -> Callable[[], None]:
        def main() -> None:
            pairs = [configured(name) for name in names]
            folder = self.disk.folder / where
            pairs = [(one, one.configured({"store": str(self.store_folder)}) if one.records else config) for one, config in pairs]
            process(pairs, ADDRESS, Event(self.kernel), group=GROUP, state_dir=folder)  # type: ignore[arg-type]

        return main

    def _page(self) -> None:
        self.live = LivePlant()
        viewer = Viewer(ADDRESS, GROUP, self.live)
        viewer.start()
        Event(self.kernel).wait()

    # Faults.

    def link_of(self, name: str) -> Link | None:
        """Return a connection of a process, if it has one."""
        links = [link for link in self.broker.links if self.owner_of(link.client) == name and not link.is_cut]
        return links[self.chance.randrange(len(links))] if links else None

    def owner_of(self, client: str) -> str:
        """Return the process whose connection has this client id."""
        if client.startswith("cnc/edge-"):
            return client.removeprefix("cnc/")
        if client.startswith(("host-look-", "host-view-")):
            return "page"
        is_alerts = client.startswith(("cnc/twin-alerts", "host-twin-alerts", "host-courier"))
        return self.alerts_process if is_alerts else "processors"


def lost_by(runtime: EdgeRuntime) -> int:
    """Return how many observations an edge has counted as lost."""
    counters = runtime.ledger.snapshot()
    return runtime.health.lost_observations + sum(counters[f"ledger/dropped/{reason}"] for reason in LOSSES)


def observed(plant: Plant) -> list[tuple[Any, str, Any]]:
    """Return the names that are replaced while a plant runs."""
    ObservedRunner.plant = ObservedRecorder.plant = ObservedForwarder.plant = plant
    ObservedEngine.remembers = plant.seed % REFOLD_EVERY == 0
    chance = Random(f"host {plant.seed}")
    clock = clock_of(plant.kernel)
    defaults = {**(EdgeRuntime.__init__.__kwdefaults__ or {}), "wall_s": clock.time, "monotonic_s": clock.monotonic}

    return [
        (sparkplug.edge_node, "MqttConnection", SimulatedConnection),
        (sparkplug.host, "MqttConnection", SimulatedConnection),
        (sparkplug.host, "Random", lambda: Random(chance.random())),
        (processors.running.runtime, "Loop", SimulatedLoop),
        (processors.running.runtime, "Runner", ObservedRunner),
        (processors.running.worker, "Engine", ObservedEngine),
        (edge.running.run, "Forwarder", ObservedForwarder),
        (processors.running.runner, "PROCESS", "plant:1"),
        (processors.alerts.courier.webhook, "exchanged", plant.receiver.exchanged),
        (cnctwin.memory.historian, "StoreRecorder", ObservedRecorder),
        (EdgeRuntime.__init__, "__kwdefaults__", defaults),
    ]


@contextmanager
def plant_of(seed: int, **options: Any) -> Iterator[Plant]:
    """Make a plant on the simulated clock; afterwards nothing is left of it."""
    folder = Path(tempfile.mkdtemp(prefix="plant-", dir=SHMEM if SHMEM.is_dir() else None))
    plant = Plant(seed, folder, **options)
    disk = plant.disk
    chance = Random(f"identity {seed}")
    stands = {
        uuid4: lambda: SimpleNamespace(hex=f"{chance.getrandbits(128):032x}"),
        sqlite3: Stand(sqlite3, {"connect": disk.connect}),
        shutil: Stand(shutil, {"disk_usage": disk.usage}),
        fcntl: Stand(fcntl, {"flock": disk.flock}),
        os: Stand(os, {"fsync": disk.fsync, "getpid": lambda: 1}),
    }
    try:
        with simulated(plant.kernel, observed(plant), stands):
            try:
                yield plant
            finally:
                plant.kernel.close(list(plant.processes.values()))
                disk.close()
    finally:
        shutil.rmtree(folder, ignore_errors=True)
