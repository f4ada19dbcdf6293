"""The moment of a unit: what a snapshot leaves out because a restart forgets it, so that a unit goes on at the very record.

On the broker nobody knows what was missed while a processor was down, and its machines are born again (`running/snapshot.py`). A
log has missed nothing: who was online still is, silence goes on, and what was held back is still held back.
"""

import base64
from collections.abc import Mapping
from types import MappingProxyType
from typing import Any

from processors.errors import SnapshotError
from processors.running.engine import Engine
from processors.running.lane import Lane
from processors.running.snapshot import PLAIN_TYPES
from processors.running.unit import Machine, Unit
from sparkplug.errors import PayloadError
from sparkplug.metric import NodeId, Reading
from sparkplug.records.named import NamedPayloads, written


def moment_of(engine: Engine, unit: Unit) -> dict[str, Any]:
    """Return the moment of a unit as JSON values."""
    return {
        "machines": {machine.name: _machine(engine, machine) for machine in unit.machines.values()},
        "shown": list(unit.live.rows),
    }


def go_on(engine: Engine, unit: Unit, moment: Mapping[str, Any]) -> None:
    """Have a unit that was restored go on at its moment. Raises SnapshotError where that is not of this unit."""
    try:
        for name, told in moment["machines"].items():
            _go_on(engine, unit.machines[name], told)
        unit.live.rows.clear()
        for name in moment["shown"]:  # in the order in which they came online
            unit.live.show(name, MappingProxyType(unit.machines[name].live.row))
    except (KeyError, TypeError, ValueError, AttributeError, PayloadError) as error:
        raise SnapshotError(f"moment of {unit.name}: {type(error).__name__}: {error}") from error


def _machine(engine: Engine, machine: Machine) -> dict[str, Any]:
    return {
        "online": sorted(map(str, machine.online)),
        "excluded": {str(node): sorted(names) for node, names in machine.excluded.items()},
        "undescribed": machine.name in engine.undescribed,
        "live": _lane(machine.live),
        "history": None if machine.history is None else _lane(machine.history),
    }


def _lane(lane: Lane) -> dict[str, Any]:
    """Return what the snapshot does not hold of a lane; values that JSON cannot hold as Sparkplug writes them."""
    told: dict[str, Any] = {"anchor": [lane.anchor_ms, lane.anchor_wall_s], "births_are_old": lane.births_are_old}
    if lane.held:
        told["held"] = [_packed(readings) for readings in lane.held]
    odd = tuple(reading for reading in lane.row.values() if not isinstance(reading.value, PLAIN_TYPES))
    if odd:
        told["odd"] = _packed(odd)
        told["order"] = list(lane.row)
    return told


def _packed(readings: Any) -> str:
    return base64.b64encode(written(0, tuple(readings), 0)).decode()


def _unpacked(text: str) -> tuple[Reading, ...]:
    return NamedPayloads().read(base64.b64decode(text)).readings


def _go_on(engine: Engine, machine: Machine, told: Mapping[str, Any]) -> None:
    machine.online = {_node(text) for text in told["online"]}
    machine.excluded = {_node(text): frozenset(names) for text, names in told["excluded"].items()}
    if told["undescribed"]:
        engine.undescribed.add(machine.name)
    machine.live.go_on()
    _into_lane(machine.live, told["live"])
    if machine.history is not None and told["history"] is not None:
        _into_lane(machine.history, told["history"])
        machine.history.is_restored = False
    engine.silences.watch(machine)


def _into_lane(lane: Lane, told: Mapping[str, Any]) -> None:
    lane.anchor_ms, lane.anchor_wall_s = told["anchor"]
    lane.births_are_old = told["births_are_old"] is True
    lane.held = [_unpacked(text) for text in told.get("held", ())]
    if "odd" in told:
        rows = lane.row | {reading.name: reading for reading in _unpacked(told["odd"])}
        lane.row.clear()
        lane.row.update((name, rows[name]) for name in told["order"])


def _node(text: str) -> NodeId:
    group, _, node = text.partition("/")
    return NodeId(group, node)
