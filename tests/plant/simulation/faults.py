"""The faults of a run, drawn from its seed. A run is replayed by its seed alone; each fault can be left out by its place."""

from dataclasses import dataclass
from random import Random

KINDS = {
    "cut": 8,  # a connection is lost with all that is on its way; each side notices after a while
    "stall": 5,  # nothing passes for some seconds; QoS 0 that finds no room is dropped
    "unreachable": 3,  # a client cannot reach the broker for some seconds
    "duplicates": 2,  # messages of QoS 1 come twice for some seconds
    "kill edge": 5,
    "kill processors": 4,
    "kill alerts": 4,  # the process of the alerts and of their courier
    "kill notifying": 4,  # the same, while somebody is being notified
    "kill page": 1,
    "kill broker": 2,
    "kill at disk": 5,  # kill -9 just before or after a write or an fsync
    "power edge": 3,  # the power of a computer is cut: what is not synced may be lost or torn
    "power processors": 3,
    "disk full": 2,
    "clock": 4,  # the wall's clock of a process jumps
    "control away": 2,  # a machine says nothing for some seconds
    "receiver": 3,  # who is notified refuses, or takes it and does not answer
    "hostile": 5,  # an edge that nobody asked for sends what it can think of
}
"""Each kind of fault, and how often it is drawn."""


@dataclass(frozen=True, slots=True)
class Fault:
    """One fault: when it begins, for how long (s) where it lasts, and a number that chooses its target and its course."""

    at_s: float
    kind: str
    lasts_s: float
    chance: int

    def __str__(self) -> str:
        return f"{self.at_s:.2f} s {self.kind} ({self.lasts_s:.1f} s, {self.chance})"


def drawn(seed: int, until_s: float, without: frozenset[str] = frozenset()) -> list[Fault]:
    """Draw the faults of a run, in the order of time.

    Each draw takes as many numbers of chance whatever is left out, so that the others stay the same.
    """
    chance = Random(f"faults {seed}")
    kinds, weights = list(KINDS), list(KINDS.values())
    found = []
    for _ in range(chance.randint(2, 10)):
        kind = chance.choices(kinds, weights)[0]
        fault = Fault(round(chance.uniform(1.5, until_s), 3), kind, round(chance.uniform(0.3, 6.0), 2), chance.randrange(1 << 30))
        if kind not in without:
            found.append(fault)
    return sorted(found, key=lambda fault: fault.at_s)
