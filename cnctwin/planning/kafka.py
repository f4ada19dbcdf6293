"""A plan past one computer: bridges, runners, Kafka and MQTT brokers of a fleet whose folds run on Kafka (docs/how-to/kafka.md).

Work is messages of machines, results of processors, and values of the mirror a second, each with its cost in every part.
Machines are split into groups where one Mosquitto, which computes on one core, or one bridge with all results of one processor
does not do. Every group has a broker, topics, bridges and runners of its own; one Kafka holds all of them. What was not measured
at such a size is an extrapolation, and says so.
"""

import math
from collections.abc import Sequence
from dataclasses import asdict, dataclass
from typing import Any

from cnctwin.errors import UsageError
from cnctwin.memory.store.plan import load_of, plan
from cnctwin.planning.fleet import CORE_SHARE, GROUPS_MAX, Fleet
from cnctwin.planning.measured import MEASURED, ON_KAFKA, Each, Measured, MeasuredOnKafka

REPLICAS = 3
BROKERS_LEAST = 3
BROKER_CORES = 8
"""Cores of a Kafka broker's computer, of which `CORE_SHARE` is planned with."""
RETENTION_HOURS, SNAPSHOT_S = 48.0, 5.0
PARTITIONS_LEAST = 12
UNCOMPACTED_S = 3600.0
"""The time for which a compacted topic may hold states that newer ones have replaced (`max.compaction.lag.ms`)."""
MIRROR, HISTORIAN = "mirror", "historian"


@dataclass(frozen=True, slots=True)
class Need:
    """One line of the layout: what of which, and what that rests on; `is_extrapolated` where no run was so large."""

    what: str
    need: str
    basis: str
    is_extrapolated: bool = True


@dataclass(frozen=True, slots=True)
class KafkaPlan:
    """The layout. Bridges, runners, historians and partitions are those of one group; the rest is of the plant."""

    groups: int
    bridges: int
    runners: int
    historians: int
    partitions: int
    brokers: int
    broker_cores: float
    disk_bytes: float
    in_mbit_s: float
    out_mbit_s: float
    needs: tuple[Need, ...]

    def as_json(self) -> dict[str, Any]:
        """For a program to read."""
        return asdict(self)


@dataclass(frozen=True, slots=True)
class _Rates:
    """The load of a second: messages of machines, results, and values of the mirror."""

    messages: float
    results: float
    values: float

    def cost(self, each: Each) -> float:
        """Return what all of it costs a second where each costs so much."""
        return each.message * self.messages + each.result * self.results + each.value * self.values


def plan_kafka(
    fleet: Fleet,
    processors: Sequence[str],
    *,
    slowness: float = 1.0,
    measured: MeasuredOnKafka = ON_KAFKA,
    on_one: Measured = MEASURED,
) -> KafkaPlan:
    """Return the layout. `slowness`: CPU time here over CPU time on the computer that was measured."""
    folds = [name for name in processors if name != HISTORIAN]
    if unknown := [name for name in folds if name not in measured.fold_us]:
        raise UsageError(
            f"{', '.join(unknown)}: there are no figures for it on Kafka; there are for {', '.join(measured.fold_us)}"
        )
    grown = slowness * (1.0 - on_one.grows_share + on_one.grows_share * fleet.changing / on_one.values)
    says = len([name for name in folds if name != MIRROR]) * measured.results_a_machine_s
    values = fleet.hz * fleet.changing if MIRROR in folds else 0.0
    of_machine = _Rates(fleet.hz, says, values)
    most = max(says and measured.results_a_machine_s * measured.bridge_us.result, values * measured.bridge_us.value)
    groups = _groups(fleet, grown * max(of_machine.cost(measured.mosquitto_us), most) / 1e6)
    machines = math.ceil(fleet.machines / groups)
    bridges = _processes(machines * grown * of_machine.cost(measured.bridge_us) / 1e6)
    fold_us = measured.live_factor * grown * (measured.read_us + sum(measured.fold_us[name] for name in folds))
    state_us = slowness * measured.state_us * len(folds) / SNAPSHOT_S
    runners = _processes(machines * (fold_us * fleet.hz + state_us) / 1e6) if folds else 0
    historian_us = grown * (measured.read_us + on_one.each_us[HISTORIAN])
    historians = _processes(machines * fleet.hz * historian_us / 1e6) if HISTORIAN in processors else 0
    wide = fleet.changing / on_one.values
    log_bytes_s = fleet.machines * of_machine.cost(measured.log_bytes._replace(message=measured.log_bytes.message * wide))
    state_bytes_s = fleet.machines * len(folds) / SNAPSHOT_S * measured.state_bytes
    broker_cores = REPLICAS * fleet.machines * slowness * of_machine.cost(measured.kafka_us) / 1e6
    readers = bool(folds) + bool(historians)
    made = KafkaPlan(
        groups=groups,
        bridges=bridges,
        runners=runners,
        historians=historians,
        partitions=PARTITIONS_LEAST * math.ceil(max(1.0, 2 * max(runners, historians) / PARTITIONS_LEAST)),
        brokers=max(BROKERS_LEAST, math.ceil(broker_cores / (CORE_SHARE * BROKER_CORES))),
        broker_cores=broker_cores,
        disk_bytes=REPLICAS * (RETENTION_HOURS * 3600.0 * log_bytes_s + UNCOMPACTED_S * state_bytes_s),
        in_mbit_s=8e-6 * (log_bytes_s + state_bytes_s),
        out_mbit_s=8e-6 * ((REPLICAS - 1) * (log_bytes_s + state_bytes_s) + max(1, readers) * log_bytes_s),
        needs=(),
    )
    return _with_needs(made, fleet, machines, fold_us, measured)


def _processes(cores: float) -> int:
    return max(1, math.ceil(cores / CORE_SHARE - 1e-9))


def _groups(fleet: Fleet, cores_a_machine: float) -> int:
    """Return the number of groups by which each broker, and each bridge that publishes one processor, has room."""
    if cores_a_machine > CORE_SHARE:
        raise UsageError(
            f"{fleet.hz:g} Hz with {fleet.metrics} metrics: one machine is more than a broker can take; lower --hz, or average "
            "in the edge"
        )
    groups = math.ceil(fleet.machines / math.floor(CORE_SHARE / cores_a_machine))
    if groups > GROUPS_MAX:
        raise UsageError(f"{fleet.machines} machines at {fleet.hz:g} Hz are more than {GROUPS_MAX} groups; plan a part of them")
    return groups


def _with_needs(made: KafkaPlan, fleet: Fleet, machines: int, fold_us: float, measured: MeasuredOnKafka) -> KafkaPlan:
    """Return the plan with its lines, and what each rests on."""
    found = [
        Need("MQTT brokers", f"{made.groups} Mosquitto, one a group of {machines} machines", f"{_told(measured.mosquitto_us)}"),
        Need(
            "bridges",
            f"{_times(made.bridges, made.groups)}; --nodes shares the machines, --results the results",
            f"{_told(measured.bridge_us)}",
        ),
    ]
    if made.runners:
        memory_mb = measured.process_mb + measured.machine_mb * machines / made.runners
        found.append(
            Need(
                "runners",
                f"{_times(made.runners, made.groups)}, about {memory_mb:.0f} MB each",
                f"{fold_us:.0f} µs a message, {measured.state_us:.0f} µs a state each {SNAPSHOT_S:g} s; with two on two cores, "
                "Kafka beside them, runners did not add up",
            )
        )
    found += [
        Need(
            "partitions",
            f"{made.partitions} of each topic of a group; cannot be changed later",
            f"a rule: two or more for each runner, in steps of {PARTITIONS_LEAST}",
            is_extrapolated=False,
        ),
        Need(
            "Kafka brokers",
            f"{made.brokers} of {BROKER_CORES} cores, {made.broker_cores:.1f} cores used",
            f"{_told(measured.kafka_us)}, on one broker with one replica, times {REPLICAS} replicas",
        ),
        Need(
            "Kafka disk",
            f"{_size(made.disk_bytes)} in all, {_size(made.disk_bytes / made.brokers)} a broker",
            f"{_told(measured.log_bytes, 'B')} after lz4, {RETENTION_HOURS:g} h, {REPLICAS} replicas; "
            f"states of {measured.state_bytes:.0f} B, uncompacted for an hour",
        ),
        Need(
            "network",
            f"{made.in_mbit_s:.0f} Mbit/s into Kafka, {made.out_mbit_s:.0f} Mbit/s out of it to replicas and readers",
            "the same bytes",
        ),
    ]
    if made.historians:
        load = load_of(fleet.machines, math.ceil(fleet.changing), fleet.hz)
        a_day = plan(load, 10**12).year_bytes / 365.25
        found.append(
            Need(
                "historians",
                f"{_times(made.historians, made.groups)}, a store each; {_size(a_day)} a day together",
                "the historian's cost on MQTT and the bytes of docs/reference/store.md; not measured on Kafka",
            )
        )
    found.append(Need("pages", f"{made.groups}, one a group", "a page reads one broker; not measured with so many machines"))
    return KafkaPlan(**{name: getattr(made, name) for name in made.__slots__ if name != "needs"}, needs=tuple(found))


def _times(count: int, groups: int) -> str:
    return f"{count} of a core each" if groups == 1 else f"{count} a group, {count * groups} of a core each in all"


def _told(each: Each, unit: str = "µs") -> str:
    return (
        f"{each.message:.0f} {unit} a message, {each.result:.0f} {unit} a result, {each.value:.0f} {unit} a value of the mirror"
    )


def _size(size: float) -> str:
    return f"{size / 1e12:.1f} TB" if size >= 1e12 else f"{size / 1e9:.1f} GB"
