"""A plan for a fleet: processes and their processors, cores, memory, network, disk; and when one computer is no longer enough.

    cost of a process = (shared + sum of its processors) · messages a second · speed of this computer / speed of the measured one

A process computes on one core, so it may cost at most `CORE_SHARE` of one: processors that do not fit together are spread over
several processes, each of which receives everything once more. Machines that do not fit are split into groups, each with a broker
and processes of its own, since a processor has one name on a broker; and Mosquitto computes on one core too.
"""

import math
from collections.abc import Sequence
from dataclasses import asdict, dataclass
from typing import Any

from cnctwin.errors import UsageError
from cnctwin.memory.store.plan import Plan, load_of, plan
from cnctwin.planning.measured import MEASURED, Measured
from processors.running.engine import MACHINES_MAX

CORE_SHARE = 0.7
"""The share of a core that is planned with; the rest is for births, rebirths, snapshots and a busy hour."""
MEMORY_MARGIN = 1.5
MESSAGE_BYTES, VALUE_BYTES = 110, 20
"""A data message on the wire: topic, headers of TCP and MQTT, stamp; and each value in it by alias."""
MIRROR_BYTES = 180
"""One value of the plain mirror on the wire, as JSON with its topic."""
GROUPS_MAX = 1000
CHANGING_SHARE = 11 / 13
"""The share of metrics that change in each message: 11 of 13 while a machine cuts."""


@dataclass(frozen=True, slots=True)
class Fleet:
    """The machines: how many, how often each sends, how many metrics it has."""

    machines: int
    hz: float
    metrics: int = 13

    def __post_init__(self) -> None:
        if self.machines < 1 or self.metrics < 1:
            raise UsageError(f"a fleet of {self.machines} machines with {self.metrics} metrics: both have to be 1 or more")
        if not 0.0 < self.hz <= 1000.0:
            raise UsageError(f"--hz {self.hz:g} is not above 0 and up to 1000; it is how often a machine sends a second")

    @property
    def changing(self) -> float:
        """The values that change in a message."""
        return max(1.0, self.metrics * CHANGING_SHARE)


@dataclass(frozen=True, slots=True)
class Process:
    """One `cnctwin process`, as often as there are groups: its processors, share of a core, memory."""

    processors: tuple[str, ...]
    cores: float
    memory_mb: float


@dataclass(frozen=True, slots=True)
class Computer:
    """The computer that it is to run on."""

    cores: int
    disk_bytes: int


@dataclass(frozen=True, slots=True)
class FleetPlan:
    """The needs of a fleet: processes and broker of each group; `cores` and what follows it are of all groups.

    limits: why one computer is not enough; empty where it is
    """

    fleet: Fleet
    groups: int
    processes: tuple[Process, ...]
    broker_cores: float
    cores: float
    memory_mb: float
    in_mbit_s: float
    mirror_mbit_s: float
    store: Plan | None
    machines_max: int
    limits: tuple[str, ...]
    basis: str

    def as_json(self) -> dict[str, Any]:
        """For a program to read."""
        return asdict(self) | {"store": None if self.store is None else self.store.as_json()}


def plan_fleet(
    fleet: Fleet, processors: Sequence[str], computer: Computer, *, slowness: float = 1.0, measured: Measured = MEASURED
) -> FleetPlan:
    """Return the plan. `slowness`: CPU time here over CPU time on the computer that was measured."""
    cost = _Cost(fleet.changing, slowness, measured)
    unknown = [name for name in processors if name not in measured.each_us]
    if unknown:
        raise UsageError(f"{', '.join(unknown)}: there are no figures for it; there are for {', '.join(measured.each_us)}")
    groups, packed = _packed(fleet, processors, cost)
    rate_hz = fleet.machines * fleet.hz / groups
    processes = tuple(
        Process(names, cost.of(names) * rate_hz / 1e6, _memory_mb(names, fleet.machines / groups, measured)) for names in packed
    )
    broker_cores = cost.broker(len(processes), mirrors="mirror" in processors) * rate_hz / 1e6
    cores = groups * (broker_cores + sum(one.cores for one in processes))
    memory_mb = MEMORY_MARGIN * groups * sum(one.memory_mb for one in processes)
    message_bits = 8 * (MESSAGE_BYTES + VALUE_BYTES * fleet.changing)
    store = None
    if "historian" in processors:
        store = plan(load_of(fleet.machines, math.ceil(fleet.changing), fleet.hz), computer.disk_bytes)
    spread = "" if slowness == 1.0 else f", times {slowness:.2f} as measured on this computer"
    return FleetPlan(
        fleet=fleet,
        groups=groups,
        processes=processes,
        broker_cores=broker_cores,
        cores=cores,
        memory_mb=memory_mb,
        in_mbit_s=fleet.machines * fleet.hz * message_bits / 1e6,
        mirror_mbit_s=fleet.machines * fleet.hz * fleet.changing * 8 * MIRROR_BYTES / 1e6 if "mirror" in processors else 0.0,
        store=store,
        machines_max=math.floor(fleet.machines * CORE_SHARE * computer.cores / cores),
        limits=_limits(cores, groups, computer),
        basis=f"measured {measured.date} on {measured.computer}{spread}; processes planned to {100 * CORE_SHARE:.0f} % of a core",
    )


def chosen(processors: str, measured: Measured = MEASURED) -> tuple[str, ...]:
    """Return the processors that are meant: all, those named, or a number of them, the dearest first, so that it is enough.

    >>> chosen("2")
    ('mirror', 'rules')
    """
    known = tuple(measured.each_us)
    if processors == "all":
        return known
    if not processors.isdecimal():
        return tuple(dict.fromkeys(processors.split(",")))
    if not 1 <= int(processors) <= len(known):
        raise UsageError(f"--processors {processors}: there are {len(known)}; give a number from 1 to {len(known)}, or names")
    return tuple(sorted(known, key=lambda name: -measured.each_us[name])[: int(processors)])


@dataclass(frozen=True, slots=True)
class _Cost:
    """CPU time a message, µs, of machines with so many changing values on a computer that is so slow."""

    changing: float
    slowness: float
    measured: Measured

    def _scaled(self, us: float) -> float:
        """Return a cost that was measured with other values a message."""
        share = self.measured.grows_share
        return us * self.slowness * (1.0 - share + share * self.changing / self.measured.values)

    def of(self, names: Sequence[str]) -> float:
        """Return the cost of one process."""
        return self._scaled(self.measured.shared_us + sum(self.measured.each_us[name] for name in names))

    def broker(self, processes: int, *, mirrors: bool) -> float:
        """Return the cost of the broker that feeds so many processes."""
        return self._scaled(self.measured.broker_us * processes + (self.measured.broker_mirror_us if mirrors else 0.0))


def _packed(fleet: Fleet, processors: Sequence[str], cost: _Cost) -> tuple[int, list[tuple[str, ...]]]:
    """Return groups of machines and the processes of each: as few processes with brokers as there can be."""
    best: tuple[int, list[tuple[str, ...]]] | None = None
    for groups in range(math.ceil(fleet.machines / MACHINES_MAX), min(fleet.machines, GROUPS_MAX) + 1):
        if best is not None and 2 * groups >= best[0] * (1 + len(best[1])):
            break
        us_max = CORE_SHARE * 1e6 / (fleet.machines * fleet.hz / groups)
        packed = _fitted(processors, cost, us_max)
        if packed is None or cost.broker(len(packed), mirrors="mirror" in processors) > us_max:
            continue
        if best is None or groups * (1 + len(packed)) < best[0] * (1 + len(best[1])):
            best = groups, packed
    if best is None:
        raise UsageError(
            f"{fleet.machines} machines at {fleet.hz:g} Hz with {fleet.metrics} metrics: one of them is more than a process "
            "can take, or there are too many; lower --hz, or average in the edge"
        )
    return best


def _fitted(processors: Sequence[str], cost: _Cost, us_max: float) -> list[tuple[str, ...]] | None:
    """Return the processors packed into processes of at most `us_max`, the dearest first; None where one does not fit."""
    packed: list[list[str]] = []
    for name in sorted(processors, key=lambda name: -cost.of((name,))):
        if cost.of((name,)) > us_max:
            return None
        place = next((one for one in packed if cost.of((*one, name)) <= us_max), None)
        if place is None:
            packed.append([name])
        else:
            place.append(name)
    return [tuple(sorted(one)) for one in packed]


def _memory_mb(names: Sequence[str], machines: float, measured: Measured) -> float:
    """Return the memory of one process, without a margin."""
    return measured.process_mb + measured.machine_mb * machines * len(names) / len(measured.each_us)


def _limits(cores: float, groups: int, computer: Computer) -> tuple[str, ...]:
    """Return why one computer is not enough; empty where it is."""
    found = []
    if cores > CORE_SHARE * computer.cores:
        found.append(f"{cores:.1f} cores are used and {computer.cores} are here")
    if groups > 1:
        found.append(f"one broker with one set of processors does not do: it takes {groups} groups")
    return tuple(found)
