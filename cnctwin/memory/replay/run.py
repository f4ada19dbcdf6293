"""A replay: the log is read twice, once for who was born and died in it, once for the folds."""

import hashlib
import time
from collections import deque
from collections.abc import Mapping, Sequence
from typing import Any

from cnctwin.memory.descriptions import Described, described
from cnctwin.memory.replay.comparison import Comparison
from cnctwin.memory.replay.lives import Start, begun_within, kept_start, offers, restarts
from cnctwin.memory.replay.log import Mark, Stretch, marks
from cnctwin.memory.replay.rerun import Rerun, outputs_of
from cnctwin.memory.replay.result import Difference, ProcessorReplayed, Replayed, ReplayRefusedError
from cnctwin.memory.store.contract import Series, Store
from processors.config import CellConfig, Configuration, ProcessorConfig
from processors.discovery import AnyProcessor, find
from processors.errors import UnknownProcessorError
from sparkplug.host_session import HostEvent
from twin.vocabulary.nodes import TWIN_NODE_PREFIX, is_twin_node

WARM_UP_MS = 1_800_000
NOT_COMPARED = frozenset({"historian", "mirror"})  # what they give is no metric, or is of the store itself


def replay(  # noqa: PLR0917
    store: Store,
    machine: str,
    from_ms: int,
    to_ms: int,
    processors: Sequence[str] | None = None,
    tables: Mapping[str, Mapping[str, Any]] | None = None,
    *,
    chain: bool = False,
    warm_up_ms: int = WARM_UP_MS,
) -> Replayed:
    """Run processors again over [from_ms, to_ms) of a machine's history, and compare with what they published then.

    processors None: all that published of this machine. tables: their configuration, as it was then. chain: each is fed with what
    the others give now, not with what they gave then. Raises ReplayRefusedError, StoreError, ConfigurationError.
    """
    began_s = time.perf_counter()
    if to_ms <= from_ms:
        raise ReplayRefusedError(f"to {to_ms} is not after from {from_ms}; give a stretch of time")
    known = store.machines()
    if machine not in known:
        raise ReplayRefusedError(f"the store has no machine {machine!r}; it has: {', '.join(known) or 'none'}")
    series = {machine: store.series(machine)}
    chosen = [_found(name) for name in (published_of(series[machine]) if processors is None else dict.fromkeys(processors))]
    if not chosen:
        raise ReplayRefusedError(f"no processor has ever published of {machine!r}; name those to run with --processors")
    pairs = [(one, one.configured((tables or {}).get(one.name))) for one in chosen]
    units = [_units(configuration, machine, known) for _, configuration in pairs]
    starts = [kept_start(store, one, tuple(unit), from_ms, warm_up_ms) for (one, _), unit in zip(pairs, units, strict=True)]
    machines = tuple(sorted({name for unit in units for members in unit.values() for name in members}))
    series |= {name: store.series(name) for name in machines if name != machine}
    stretch = Stretch(store, machines, min(start.from_ms for start in starts), to_ms)
    found, messages, samples = marks(stretch)
    differences: list[Difference] = []
    descriptions = {name: described(store, name, stretch.from_ms, to_ms) for name in machines}
    chained = [one.node for one in chosen] if chain else []
    reruns = [
        _rerun(store, pair, machine, unit, start, found, series, descriptions, differences, chained)
        for pair, unit, start in zip(pairs, units, starts, strict=True)
    ]
    _run(stretch, reruns, from_ms)
    results = tuple(_result(one) for one in reruns)
    digest = hashlib.sha256("\n".join(f"{one.name} {one.sha256}" for one in results).encode()).hexdigest()
    seconds = time.perf_counter() - began_s
    own = tuple(one for number, one in enumerate(descriptions[machine]) if not _is_over(descriptions[machine][number:], from_ms))
    return Replayed(machine, from_ms, to_ms, chain, results, tuple(differences), own, messages, samples, seconds, digest)


def _is_over(rest: Sequence[Described], from_ms: int) -> bool:
    """Return True if the first of these descriptions had been followed by another one in its role when the stretch began."""
    return any(one.role is rest[0].role and one.received_ms <= from_ms for one in rest[1:])


def published_of(series: Sequence[Series]) -> list[str]:
    """The processors that have published of a machine, by name."""
    nodes = {one.node.rpartition("/")[2] for one in series}
    names = {node.removeprefix(TWIN_NODE_PREFIX) for node in nodes if is_twin_node(node)}
    return sorted(names - NOT_COMPARED)


def _found(name: str) -> AnyProcessor:
    try:
        processor = find(name)
    except UnknownProcessorError as error:
        raise ReplayRefusedError(str(error)) from None
    if name in NOT_COMPARED:
        raise ReplayRefusedError(f"{name} publishes nothing that could be compared; leave it out")
    return processor


def _units(configuration: Configuration[ProcessorConfig], machine: str, known: Sequence[str]) -> dict[str, list[str]]:
    """Return the units that have a state, with their machines: the machine, or all cells that are needed to run its own."""
    config = configuration.default
    if not isinstance(config, CellConfig):
        return {machine: [machine]}
    cell = config.cell_of(machine)
    return {cell: [name for name in known if config.cell_of(name) == cell]}


def _rerun(  # noqa: PLR0917
    store: Store,
    pair: tuple[AnyProcessor, Configuration[ProcessorConfig]],
    machine: str,
    units: Mapping[str, Sequence[str]],
    start: Start,
    found: Sequence[Mark],
    series: Mapping[str, Sequence[Series]],
    descriptions: Mapping[str, Sequence[Described]],
    differences: list[Difference],
    chained: Sequence[str],
) -> Rerun:
    processor, configuration = pair
    of_units = {name for members in units.values() for name in members}
    own = [mark for mark in found if mark.event.device is None or mark.event.device in of_units]
    start = begun_within(store, start, processor, tuple(units), own, series[machine])
    notes: list[str] = []
    lives = restarts(store, processor, units, own, notes) if own else {}
    comparison = Comparison(processor.name, outputs_of(processor), differences)
    names = offers(own, series)
    fed = {node for node in chained if processor.listens_to(node)}
    told = sorted((one for name in of_units for one in descriptions[name]), key=lambda one: one.received_ms)
    rerun = Rerun(
        processor, configuration, machine, of_units, start, lives, names, comparison,
        fed=fed, is_chained=bool(chained), described=told,
    )  # fmt: skip
    rerun.notes += notes
    return rerun


def _run(stretch: Stretch, reruns: Sequence[Rerun], from_ms: int) -> None:
    for place, (received_ms, event) in enumerate(stretch.messages(), start=1):
        is_counted = received_ms >= from_ms
        waiting: deque[HostEvent] = deque()
        for rerun in reruns:
            waiting += rerun.take(place, received_ms, event, is_counted=is_counted)
        while waiting:
            said = waiting.popleft()
            for rerun in reruns:
                waiting += rerun.chained(received_ms, said, is_counted=is_counted)
    for rerun in reruns:
        rerun.end()


def _result(rerun: Rerun) -> ProcessorReplayed:
    metrics = rerun.comparison.end()
    if not rerun.comparison.is_heard:
        rerun.notes.append("it published nothing then: there is nothing to compare with")
    return ProcessorReplayed(
        rerun.processor.name,
        rerun.start.text,
        rerun.comparison.values,
        metrics,
        rerun.restarts,
        rerun.dead_letters,
        rerun.comparison.sha256,
        tuple(rerun.notes),
    )
