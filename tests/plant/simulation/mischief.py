"""The faults of a run at work: each kind has a function that brings it about, and what it has changed is put right at the end."""

from collections.abc import Callable
from random import Random

from tests.plant.simulation.faults import Fault
from tests.plant.simulation.hostile import Hostile
from tests.plant.simulation.plant import Plant
from twin.vocabulary.topics import ALERTS

BROKER_NOTICES_S_MAX = 20.0
STALL_S_MAX = 6.0


class Mischief:
    """Brings about the faults of a plant."""

    def __init__(self, plant: Plant, faults: list[Fault]) -> None:
        self._plant, self._kernel, self._broker = plant, plant.kernel, plant.broker
        for fault in faults:
            self._kernel.at(fault.at_s, lambda fault=fault: self._happen(fault))  # type: ignore[misc]

    def _happen(self, fault: Fault) -> None:
        self._plant.injected[fault.kind] += 1
        self._kernel.note("fault", fault.kind)
        do: dict[str, Callable[[Fault, Random], None]] = {
            "cut": self._cut,
            "stall": self._stall,
            "unreachable": self._unreachable,
            "duplicates": self._duplicates,
            "kill edge": lambda fault, chance: self._kill(self._edge(chance)),
            "kill processors": lambda fault, chance: self._kill("processors"),
            "kill alerts": lambda fault, chance: self._kill(self._plant.alerts_process),
            "kill notifying": lambda fault, chance: setattr(self._plant.receiver, "is_deadly", True),
            "kill page": lambda fault, chance: self._kill("page"),
            "kill broker": self._kill_broker,
            "kill at disk": self._kill_at_disk,
            "power edge": lambda fault, chance: self._cut_power(self._edge(chance), chance),
            "power processors": lambda fault, chance: self._cut_power("processors", chance),
            "disk full": self._fill,
            "clock": self._jump,
            "control away": self._away,
            "receiver": self._refuse,
            "hostile": lambda fault, chance: Hostile(self._plant, fault.chance, fault.lasts_s).begin(),
        }
        do[fault.kind](fault, Random(fault.chance))

    def _edge(self, chance: Random) -> str:
        return f"edge-{chance.choice(self._plant.machines).name}"

    def _any(self, chance: Random) -> str:
        return chance.choice([*self._plant.processes])

    def _until(self, fault: Fault, then: Callable[[], None]) -> None:
        self._kernel.at(self._kernel.now_s + fault.lasts_s, then)

    # The network.

    def _cut(self, fault: Fault, chance: Random) -> None:
        links = [link for link in self._broker.links if not link.is_cut]
        if links:
            link = chance.choice(links)
            self._broker.cut(
                link,
                chance.choice((0.0, chance.uniform(0.0, 5.0))),
                chance.choice((0.0, chance.uniform(0.0, BROKER_NOTICES_S_MAX))),
            )

    def _stall(self, fault: Fault, chance: Random) -> None:
        links = [link for link in self._broker.links if not link.is_cut]
        if links:
            chance.choice(links).stalled_until_s = self._kernel.now_s + min(fault.lasts_s, STALL_S_MAX)

    def _unreachable(self, fault: Fault, chance: Random) -> None:
        links = [link for link in self._broker.links if not link.is_cut]
        if links:
            link = chance.choice(links)
            self._broker.unreachable_until_s[link.client] = self._kernel.now_s + fault.lasts_s
            self._broker.cut(link, chance.uniform(0.0, 1.0), chance.uniform(0.0, BROKER_NOTICES_S_MAX))

    def _duplicates(self, fault: Fault, chance: Random) -> None:
        self._broker.duplicates = chance.choice((0.05, 0.5))
        self._until(fault, lambda: setattr(self._broker, "duplicates", 0.0))

    def _kill_broker(self, fault: Fault, chance: Random) -> None:
        if self._broker.is_up:
            self._kernel.note("broker killed")
            changed = self._broker.kill()
            self._plant.forgotten |= {topic.rpartition("/")[2] for topic in changed if topic.startswith(ALERTS)}
            self._until(fault, self._broker.begin)

    # Processes and their disks.

    def _kill(self, name: str) -> None:
        process = self._plant.processes.get(name)
        if process is not None and process.is_alive:
            process.kill()

    def _kill_at_disk(self, fault: Fault, chance: Random) -> None:
        name = chance.choice((self._edge(chance), "processors"))
        self._plant.disk.kill_at[name] = chance.randint(0, 60)

    def _cut_power(self, name: str, chance: Random) -> None:
        plant = self._plant
        process = plant.processes.get(name)
        if process is None or not process.is_alive:
            return
        for link in [link for link in self._broker.links if plant.owner_of(link.client) == name]:
            self._broker.cut(link, None, chance.uniform(0.0, BROKER_NOTICES_S_MAX))
        process.at_death.insert(0, lambda: plant.disk.lost_power(process, plant.disk.folder / name, chance))
        process.kill()

    def _fill(self, fault: Fault, chance: Random) -> None:
        name = chance.choice((self._edge(chance), "processors"))
        self._plant.disk.full.add(name)
        self._until(fault, lambda: self._plant.disk.full.discard(name))

    def _jump(self, fault: Fault, chance: Random) -> None:
        process = self._plant.processes.get(self._any(chance))
        if process is not None:
            step_s = chance.choice((chance.uniform(-5.0, 5.0), chance.uniform(-120.0, 120.0)))
            self._kernel.note("clock", process.name, step_s)
            process.wall_offset_s += step_s

    # Machines and people.

    def _away(self, fault: Fault, chance: Random) -> None:
        name = chance.choice(self._plant.machines).name
        self._plant.away_until_s[name] = self._kernel.now_s + fault.lasts_s * chance.choice((1.0, 2.5))

    def _refuse(self, fault: Fault, chance: Random) -> None:
        self._plant.receiver.trouble = chance.choice((0.3, 0.9))
        self._until(fault, lambda: setattr(self._plant.receiver, "trouble", 0.0))


def heal(plant: Plant) -> None:
    """Put right what a fault has left behind; the clocks stay as they are."""
    plant.broker.begin()
    plant.broker.duplicates = 0.0
    plant.broker.unreachable_until_s.clear()
    plant.disk.full.clear()
    plant.disk.kill_at.clear()
    plant.away_until_s.clear()
    plant.receiver.trouble, plant.receiver.is_deadly = 0.0, False
