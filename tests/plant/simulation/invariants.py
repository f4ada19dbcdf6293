"""The invariants of a plant: they hold whatever happens to it. Some of it is looked at all the time, the rest when all is quiet.

no process ends by itself           (Plant)
the broker ends no connection of ours  for what it sends, whoever has said it first
no message makes our code fail      not one that a processor has to contain, whoever has sent it
ledgers balance                     received = emitted + dropped + buffered, of each edge and each processor, each second
no sender changes another machine   each value of a machine on the mirror, on the page and in the store is its own
no row that was receipted is lost   each row that a receipt has named is in the store, after each death of the historian too
no observation is lost unsaid       each is in the store, or its edge has counted a loss: dropped, in a hole, or sent unstored
all agree in the end                machine = mirror = page = store
a state is its fold                 each processor's state is that of a fresh one which is given the same
no alert twice                      no notification arrives twice; no firing is told by two notifications
no alert is lost unsaid             each notification has arrived, or is said to have failed; none is left lying
"""

import json
from collections import Counter

from cnctwin.memory.store.embedded import EmbeddedStore
from edge.running.ledger import Ledger
from processors.alerts.messages import DELIVERY, OUTBOX
from processors.alerts.notification import Notification
from tests.plant.simulation.control import SPEED, Machine
from tests.plant.simulation.kernel import EPOCH_S
from tests.plant.simulation.observed import ObservedEngine
from tests.plant.simulation.plant import LOOK_S, Plant

SEQUENCE = "edge_sequence"
LONG_MS = 10_000_000


class Invariants:
    """Watches one plant."""

    def __init__(self, plant: Plant) -> None:
        self._plant, self._kernel = plant, plant.kernel
        self._machines = {machine.name: machine for machine in plant.machines}
        self._known: set[str] = set()
        self._outcomes: dict[str, set[str]] = {}
        self._firings: Counter[tuple[str, str, str]] = Counter()
        plant.broker.observers.append(self._heard)
        self._kernel.at(LOOK_S, self._look)

    # All the time.

    def _look(self) -> None:
        for name, runtime in self._plant.runtimes.items():
            if self._plant.processes[f"edge-{name}"].is_alive and not runtime._lock.locked():
                counters = runtime.ledger.snapshot()
                if (difference := Ledger.difference(counters)) != 0 and counters["ledger/received"]:
                    self._kernel.violated("ledgers balance", f"edge {name} is {difference} off: {counters}")
        for where, runner in self._plant.runners.items():
            if self._plant.processes[where].is_alive:
                for worker in runner.workers:
                    if worker._faults.faults:
                        self._kernel.violated("no message makes our code fail", f"{worker.name}: {worker._faults.text}")
                    if worker.engine.ledger.balance:
                        self._kernel.violated("ledgers balance", f"{worker.name} is {worker.engine.ledger.balance} off")
        self._kernel.at(self._kernel.now_s + LOOK_S, self._look)

    def _heard(self, client: str, topic: str, payload: bytes, retain: bool) -> None:
        if topic.startswith("cnc/") and topic.endswith(f"/{SPEED}"):
            owner = self._machines.get(topic.split("/")[1])
            value = json.loads(payload).get("value") if payload else None
            if owner is not None and value is not None and not owner.owns(value):
                self._kernel.violated("no sender changes another machine", f"{topic} says {value}")
        elif topic.startswith(OUTBOX) and payload:
            message = Notification.of(payload)
            if message.id not in self._known:
                self._known.add(message.id)
                for said in message.says:
                    fingerprint, episode, what, *_ = said.split(".")
                    if what == "firing":
                        self._firings[message.receiver, fingerprint, episode] += 1
        elif topic.startswith(DELIVERY) and payload:
            told = json.loads(payload)
            self._outcomes.setdefault(told["id"], set()).add(told["outcome"])

    # In the end.

    def is_quiet(self) -> bool:
        """Return True if nothing is on its way any more."""
        plant = self._plant
        if any(not process.is_alive for process in plant.processes.values()):
            return False
        if self._unsettled():
            return False
        for machine in plant.machines:
            runtime = plant.runtimes.get(machine.name)
            if runtime is None or runtime.ledger.snapshot()["ledger/buffered"]:
                return False
            if not all(value == machine.last(SPEED) for value in self._views(machine).values()):
                return False
        return True

    def _unsettled(self) -> list[str]:
        """Return the notifications in the outbox whose fate is not known yet."""
        retained = self._plant.broker.retained
        waiting = [topic.removeprefix(OUTBOX) for topic in retained if topic.startswith(OUTBOX)]
        return [key for key in waiting if DELIVERY + key not in retained]

    def _views(self, machine: Machine) -> dict[str, object]:
        """Return the speed of a machine as the mirror and the page have it."""
        payload, _ = self._plant.broker.retained.get(f"cnc/{machine.name}/{SPEED}", (b"{}", 0))
        shown = json.loads(payload)
        reading = self._plant.live.readings(machine.name).get(SPEED)
        return {
            "mirror": shown.get("value") if shown.get("quality") == "good" else shown,
            "page": reading.value if reading is not None and reading.quality == 192 else reading,
        }

    def judge(self) -> None:
        """Look at everything that has to hold when all is quiet."""
        if not self.is_quiet():
            self._kernel.violated("all comes to its end", self._unfinished())
        self._judge_folds()
        self._judge_store()
        self._judge_alerts()

    def _unfinished(self) -> str:
        plant = self._plant
        dead = [name for name, process in plant.processes.items() if not process.is_alive]
        left = self._unsettled()
        waits = {name: runtime.ledger.snapshot()["ledger/buffered"] for name, runtime in plant.runtimes.items()}
        views = {one.name: {"machine": one.last(SPEED), **self._views(one)} for one in plant.machines}
        differ = {name: seen for name, seen in views.items() if any(value != seen["machine"] for value in seen.values())}
        return f"dead {dead}, notifications left {left}, waiting { ({k: v for k, v in waits.items() if v}) }, differ {differ}"

    def _judge_folds(self) -> None:
        for runner in self._plant.runners.values():
            for worker in runner.workers:
                engine = worker.engine
                if isinstance(engine, ObservedEngine) and (units := engine.differing()):
                    self._kernel.violated("a state is its fold", f"{worker.name}: {', '.join(units)}")

    def _judge_store(self) -> None:
        plant, kernel = self._plant, self._kernel
        store = EmbeddedStore(plant.store_folder)
        try:
            for machine in plant.machines:
                rows, speeds = self._stored(store, machine)
                lost = plant.receipted.get(machine.name, set()) - rows
                if lost:
                    kernel.violated(
                        "no row that was receipted is lost", f"{machine.name}: {len(lost)} rows, the first is {min(lost)}"
                    )
                for speed in speeds:
                    if not machine.owns(speed):
                        kernel.violated("no sender changes another machine", f"the store has {speed} of {machine.name}")
                        break
                missing = [one for one in machine.day if one.signal == SPEED and one.value not in speeds]
                said = plant.losses(machine.name)
                if len(missing) > said:
                    kernel.violated(
                        "no observation is lost unsaid",
                        f"{machine.name}: {len(missing)} speeds of {len(machine.day)} observations are not in the store, "
                        f"the first of {missing[0].at_s:.3f} s; {said} are said to be lost",
                    )
        finally:
            store.close()

    def _stored(self, store: EmbeddedStore, machine: Machine) -> tuple[set[int], set[float]]:
        """Return the rows of a machine in the store, and its speeds."""
        rows: set[int] = set()
        speeds: set[float] = set()
        if machine.name not in store.machines():
            return rows, speeds
        begin_ms = round(EPOCH_S * 1000)
        for message in store.messages(machine.name, begin_ms - LONG_MS, begin_ms + LONG_MS):
            for reading in message.event.readings:
                if reading.name == SEQUENCE and isinstance(reading.value, int):
                    rows.add(reading.value)
                elif reading.name == SPEED and isinstance(reading.value, float):
                    speeds.add(reading.value)
        return rows, speeds

    def _judge_alerts(self) -> None:
        kernel, plant = self._kernel, self._plant
        for key, count in sorted(plant.receiver.arrived.items()):
            if count > 1 and key not in plant.forgotten:
                kernel.violated("no alert twice", f"notification {key} has arrived {count} times")
        for (receiver, fingerprint, episode), count in sorted(self._firings.items()):
            if count > 1 and not plant.forgotten:
                kernel.violated("no alert twice", f"{receiver} was told {count} times that {fingerprint}.{episode} fires")
        for key in sorted(self._known):
            if key in plant.forgotten:
                continue
            if key not in plant.receiver.arrived and "failed" not in self._outcomes.get(key, ()):
                kernel.violated("no alert is lost unsaid", f"notification {key} has not arrived, and nobody says so")
