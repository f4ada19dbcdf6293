"""The lives of a processor within a stretch of the log: where its state came from at the start, and each time it was killed.

It is read from the log: a processor's twin device is born by the birth of the machine's edge that it heard first; it dies with
its edge node where the process was killed or stopped, and what began again went on from the last snapshot and heard the births
that it had asked for.
"""

import json
from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass, field, replace
from datetime import UTC, datetime

from cnctwin.memory.replay.log import Mark, birth_behind, is_twin
from cnctwin.memory.store.contract import Series, Store
from processors.description import Role
from processors.discovery import AnyProcessor
from sparkplug.host_event import NODE_OFFLINE
from sparkplug.host_session import EventKind, HostEvent
from sparkplug.metric import NodeId
from twin.vocabulary.nodes import HISTORIAN_NODE, is_twin_node

SNAPSHOT_MS_MAX = 2 * 3_600_000
"""Older ones are no start: there is one an hour of a processor that works."""
IN_FLIGHT_MS = 10_000
"""Messages that were on their way while the snapshot was saved came so long before it at the most."""
SAVED_MS_MAX = 10_000
"""A snapshot is saved within two seconds of a change; an older one may not be the one that was restored."""


Births = Mapping[tuple[str, str], int]
"""By machine and edge node, the stamp of the first birth that was heard."""


@dataclass(frozen=True, slots=True)
class Start:
    """The origin of the state: a snapshot, to go on from; the first birth that it heard; or nothing.

    received_ms: of the snapshot; hears_from: by machine, the first message that it may have heard; snapshots: by unit
    births: as `Restart.births`
    """

    text: str
    from_ms: int
    hears_from: Mapping[str, int] = field(default_factory=dict)
    received_ms: int = 0
    snapshots: Mapping[str, bytes] | None = None
    is_birth: bool = False
    births: Births = field(default_factory=dict)
    saved_ms: int = 0


@dataclass(frozen=True, slots=True)
class Restart:
    """It died at `place` of the log and went on from these snapshots, hearing again from `hears_from` on; a unit whose snapshot
    is not kept goes on as it was.

    births, saved_ms: the first that it heard in this life, where a snapshot of it tells, and when that was saved; else they are
        taken from when its twin devices were born, which leaves open whom it heard first where several begin in the same instant
    """

    place: int
    hears_from: Mapping[str, int]
    snapshots: Mapping[str, bytes]
    units: Collection[str]
    births: Births = field(default_factory=dict)
    saved_ms: int = 0


def kept_start(store: Store, processor: AnyProcessor, units: Sequence[str], from_ms: int, warm_up_ms: int) -> Start:
    """From the last snapshots before `from_ms`; where one is missing, from nothing, `warm_up_ms` earlier."""
    kept = {unit: store.snapshot_before(processor.name, unit, from_ms) for unit in units}
    usable = {
        unit: one for unit, one in kept.items() if one is not None and one.received_ms >= from_ms - SNAPSHOT_MS_MAX - warm_up_ms
    }
    if len(usable) < len(units) or not usable:
        return Start(f"from nothing, {warm_up_ms / 1000:.0f} s before the stretch: no snapshot is kept", from_ms - warm_up_ms)
    first_ms = min(one.received_ms for one in usable.values())
    text = f"from the snapshot kept {(from_ms - first_ms) / 1000:.0f} s before the stretch"
    snapshots = {unit: one.payload for unit, one in usable.items()}
    return Start(text, first_ms - IN_FLIGHT_MS, received_ms=first_ms, snapshots=snapshots)


def begun_within(  # noqa: PLR0917
    store: Store, start: Start, processor: AnyProcessor, units: Collection[str], found: Sequence[Mark], series: Sequence[Series]
) -> Start:
    """The start, where the processor had none: it began to work within the stretch, by a birth that it heard."""
    own = [mark for mark in found if mark.event.node.node == processor.node and mark.event.kind is not EventKind.HOLE]
    if start.snapshots is not None and own:
        deaths = (mark.place for mark in own if _is_of_process(mark.event) and mark.received_ms > start.received_ms)
        births, saved_ms = births_of_life(
            store, processor, units, found, start.received_ms - 1, next(deaths, found[-1].place + 1)
        )
        return replace(start, births=births, saved_ms=saved_ms)
    if start.snapshots is not None or not own or own[0].event.kind is not EventKind.BIRTH:
        return start
    names = {spec.name for spec in processor.outputs}
    if any(one.signal in names and one.first_us < start.from_ms * 1000 and processor.node in one.node for one in series):
        return start
    end = _next_death(own, own[0].place)
    heard = _heard_from(found, own[0].place, end, processor)
    births, saved_ms = births_of_life(store, processor, units, found, own[0].received_ms, end)
    text = "as it was started within the stretch"
    return Start(text, start.from_ms, heard, is_birth=True, births=births, saved_ms=saved_ms) if heard else start


def restarts(
    store: Store, processor: AnyProcessor, units: Mapping[str, Collection[str]], found: Sequence[Mark], notes: list[str]
) -> dict[int, Restart]:
    """Each death of its edge node that was a death of the process, by place. `units`: their machines by name.

    A process that begins again asks for births. Where no edge was born between its death and its rebirth, only its connection was
    cut, and the state went on.
    """
    of_twin = [mark for mark in found if mark.event.node.node == processor.node]
    result: dict[int, Restart] = {}
    handled_until = 0
    for mark in of_twin:
        if not _is_of_process(mark.event) or mark.place <= handled_until:
            continue
        rebirth = next((one for one in of_twin if one.place > mark.place and one.event.kind is EventKind.BIRTH), None)
        until = rebirth.place if rebirth is not None else found[-1].place + 1
        asked = any(
            mark.place < one.place < until and one.event.kind is EventKind.BIRTH and not is_twin(one.event) for one in found
        )
        if rebirth is not None and not asked:
            continue
        handled_until = until
        nothing = {machine: until for members in units.values() for machine in members}
        end = _next_death(of_twin, until)
        hears_from = nothing if rebirth is None else nothing | _heard_from(found, mark.place, end, processor)
        births, saved_ms = births_of_life(store, processor, units, found, mark.received_ms, end)
        snapshots = {}
        for unit in units:
            kept = store.snapshot_before(processor.name, unit, mark.received_ms + 1)
            if kept is None:
                notes.append(f"restarted at {_utc(mark.received_ms)}: the snapshot of {unit} that it went on from is not kept")
                continue
            snapshots[unit] = kept.payload
            if kept.received_ms < mark.received_ms - SAVED_MS_MAX:
                older_s = (mark.received_ms - kept.received_ms) / 1000
                notes.append(
                    f"restarted at {_utc(mark.received_ms)}: the last snapshot of {unit} that is kept is {older_s:.0f} s older"
                )
        result[mark.place] = Restart(mark.place, hears_from, snapshots, tuple(units), births, saved_ms)
    notes += [
        f"the memory has a hole until {_utc(mark.received_ms)}: {mark.event.detail}"
        for mark in found
        if mark.event.kind is EventKind.HOLE and mark.event.node.node == HISTORIAN_NODE
    ][:3]
    return result


def _utc(at_ms: int) -> str:
    return datetime.fromtimestamp(at_ms / 1000, UTC).strftime("%Y-%m-%dT%H:%M:%SZ")


def _is_of_process(event: HostEvent) -> bool:
    """Return True if a twin device died with its edge node, and not with its machine."""
    return event.kind is EventKind.DEATH and NODE_OFFLINE in event.detail


def _next_death(of_twin: Sequence[Mark], place: int) -> int:
    """Return the next death, of the marks of a processor; beyond all where there is none."""
    deaths = (one.place for one in of_twin if one.place > place and _is_of_process(one.event))
    return next((death for death in deaths), of_twin[-1].place + 1)


def _heard_from(found: Sequence[Mark], begin: int, end: int, processor: AnyProcessor) -> dict[str, int]:
    """By machine, the birth of its edge by which its twin device was born in this life: what came before was not heard."""
    result: dict[str, int] = {}
    for mark in found:
        event = mark.event
        if not begin <= mark.place < end or event.node.node != processor.node or event.kind is not EventKind.BIRTH:
            continue
        behind = birth_behind(found, mark)
        if behind is not None and event.device is not None and event.device not in result:
            result[event.device] = behind.place
    return result


def births_of_life(  # noqa: PLR0917
    store: Store, processor: AnyProcessor, units: Collection[str], found: Sequence[Mark], begin_ms: int, end: int
) -> tuple[dict[tuple[str, str], int], int]:
    """Return what a snapshot that was saved in a life tells, that of its end or the last one kept; and when it was saved."""
    # No later than what is at hand: a snapshot that was saved after it may be of a later life.
    end_ms = next((mark.received_ms for mark in found if mark.place == end), found[-1].received_ms if found else begin_ms)
    result: dict[tuple[str, str], int] = {}
    saved_ms = 0
    for unit in units:
        kept = store.snapshot_before(processor.name, unit, end_ms + 1)
        if kept is None or kept.received_ms <= begin_ms:
            continue
        saved_ms = kept.received_ms
        result |= births_of(kept.payload)
    return result, saved_ms


def births_of(payload: bytes) -> dict[tuple[str, str], int]:
    """The births that a snapshot tells of, by machine and node."""
    lanes = json.loads(payload)["live"]["machines"]
    return {(machine, node): at_ms for machine, lane in lanes.items() for node, at_ms in lane.get("births", {}).items()}


def versions_of(payload: bytes) -> set[tuple[str, Role, str]]:
    """The descriptions by which a snapshot's states were folded, of its machines."""
    live = json.loads(payload)["live"]
    versions = {Role.LIVE: live.get("description"), Role.CHALLENGER: live.get("challenger", {}).get("version")}
    return {(machine, role, version) for machine in live["machines"] for role, version in versions.items() if version}


def offers(found: Sequence[Mark], series: Mapping[str, Sequence[Series]]) -> dict[str, dict[NodeId, list[str]]]:
    """Return the nodes that offer each signal of each machine, edges first."""
    nodes = {(mark.event.device or "", mark.event.node) for mark in found if mark.event.kind is not EventKind.HOLE}
    result: dict[str, dict[NodeId, list[str]]] = {}
    for machine, node in sorted(nodes, key=lambda pair: (pair[0], is_twin_node(pair[1].node), pair[1])):
        names = [one.signal for one in series.get(machine, ()) if one.node in (node.node, str(node))]
        result.setdefault(machine, {})[node] = names
    return result
