"""Disturbances that all machines of a hall feel at once: each with its own strength, and a little later than its neighbour.

| kind | what it does | a working day | lasts |
|---|---|---|---|
| forklift | shakes the floor: adds to the vibration of all, cutting or not | 10 | 10 to 40 s |
| press | a press next door: the same for longer | 1 | 5 to 30 min |
| coolant | pressure falls: cuts take more load and shake more | 1.3 | 3 to 20 min |
| mains | voltage dips: speeds fall, loads rise | 1 | 2 to 20 s |
| heat | sun or a gate: the ambient air | 0.5 | 1 to 4 h |

The strength on a machine is log-normal: 35 % of it belongs to the machine (how far it stands), 20 % to the event.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from enum import StrEnum

import numpy as np
from numpy.typing import NDArray

from benchmarks.simulated_cell.schedule import DAY_S, SHIFTS_S, WORK_DAYS

Floats = NDArray[np.float64]
OF_MACHINE, OF_EVENT = 0.35, 0.20


class Kind(StrEnum):
    """The kind of a disturbance."""

    FORKLIFT = "forklift"
    PRESS = "press"
    COOLANT = "coolant"
    MAINS = "mains"
    HEAT = "heat"


@dataclass(frozen=True, slots=True)
class Sort:
    """The sort of a disturbance: how often a working day, how long, how strong in the unit of its effect, and the delay of
    the last machine.
    """

    a_day: float
    lasts_s: tuple[float, float]
    strength: tuple[float, float]
    delay_s: float
    edge_s: float


SORTS = {
    Kind.FORKLIFT: Sort(10.0, (10, 40), (0.05, 0.3), 6.0, 3.0),
    Kind.PRESS: Sort(1.0, (300, 1800), (0.1, 0.5), 0.5, 5.0),
    Kind.COOLANT: Sort(1.3, (180, 1200), (0.15, 0.5), 20.0, 20.0),
    Kind.MAINS: Sort(1.0, (2, 20), (0.03, 0.08), 0.1, 1.0),
    Kind.HEAT: Sort(0.5, (3600, 14400), (3.0, 8.0), 120.0, 900.0),
}
"""Strength: g (forklift, press), share of the load (coolant), share of the speed (mains), K (heat)."""


@dataclass(frozen=True, slots=True)
class Disturbance:
    """One event. gains, delays_s: of each machine."""

    kind: Kind
    start_s: float
    lasts_s: float
    strength: float
    gains: tuple[float, ...]
    delays_s: tuple[float, ...]


def draw_disturbances(machines: int, days: int, rng: np.random.Generator) -> tuple[Disturbance, ...]:
    """All events of `days` days, in order of time."""
    stands = {kind: rng.normal(0.0, OF_MACHINE, machines) for kind in Kind}
    found = []
    for day in range(days):
        if day % 7 >= WORK_DAYS:
            continue
        for kind, sort in SORTS.items():
            for _ in range(int(rng.poisson(sort.a_day))):
                start_s = day * DAY_S + rng.uniform(*SHIFTS_S)
                found.append(draw_disturbance(kind, start_s, float(rng.uniform(*sort.lasts_s)), stands[kind], rng))
    return tuple(sorted(found, key=lambda one: one.start_s))


def draw_disturbance(kind: Kind, start_s: float, lasts_s: float, stands: Floats, rng: np.random.Generator) -> Disturbance:
    """An event of a kind; stands: logarithm of each machine's own share of the strength, (N,)."""
    sort = SORTS[kind]
    gains = np.exp(stands + rng.normal(0.0, OF_EVENT, len(stands)))
    delays = rng.uniform(0.0, sort.delay_s, len(stands))
    strength = float(np.exp(rng.uniform(*np.log(sort.strength))))
    return Disturbance(kind, float(start_s), lasts_s, strength, tuple(gains.tolist()), tuple(delays.tolist()))


def course(disturbances: Sequence[Disturbance], kind: Kind, machine: int, ticks: int) -> Floats:
    """Return what the machine feels of that kind at each second, (T,), in the unit of its strength."""
    felt, edge_s = np.zeros(ticks), SORTS[kind].edge_s
    for one in disturbances:
        if one.kind is kind:
            start_s, end_s = one.start_s + one.delays_s[machine], one.start_s + one.delays_s[machine] + one.lasts_s
            first, last = max(0, int(start_s)), min(ticks, int(end_s + 4 * edge_s) + 1)
            t_s = np.arange(first, last, dtype=np.float64)
            up, down = 1.0 - np.exp(-np.maximum(t_s - start_s, 0.0) / edge_s), np.exp(-np.maximum(t_s - end_s, 0.0) / edge_s)
            felt[first:last] += one.strength * one.gains[machine] * up * down
    return felt
