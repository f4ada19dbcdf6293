"""Samples of signals over a stretch of time: from the store, or, where there is none, those of the last minutes from memory."""

from collections.abc import Mapping, Sequence

from cnctwin.api.errors import ApiError
from cnctwin.api.event_list import event_signals
from cnctwin.api.live.trace import Sample
from cnctwin.api.routes.plant import unknown_machine
from cnctwin.api.sources import Sources
from cnctwin.api.value_object import plain
from cnctwin.memory.store.contract import Query as StoreQuery
from cnctwin.memory.store.contract import Store, StoreError


async def samples_of(
    sources: Sources, machine: str, signals: tuple[str, ...] | None, from_ms: int, to_ms: int
) -> tuple[Mapping[str, Sequence[Sample]], str]:
    """Return the samples of signals (None: those that tell events), and where they are from: store or memory. Raises ApiError."""
    live = sources.live
    if sources.store.configured:
        try:
            found = await sources.store.ask(lambda store: _stored(store, machine, signals, from_ms, to_ms))
        except (ApiError, StoreError):
            if machine not in live.machines():
                raise
        else:
            if found is None:
                raise unknown_machine(machine, live.machines())
            return found, "store"
    if machine not in live.machines():
        raise unknown_machine(machine, live.machines())
    asked = signals or event_signals(live.readings(machine))
    return {name: held for name, (_, held) in live.recent(machine, asked, from_ms, to_ms).items()}, "memory"


def _stored(
    store: Store, machine: str, signals: tuple[str, ...] | None, from_ms: int, to_ms: int
) -> dict[str, Sequence[Sample]] | None:
    known = {one.signal for one in store.series(machine)}
    if not known and machine not in store.machines():
        return None
    asked = event_signals(known) if signals is None else tuple(name for name in signals if name in known)
    if not asked:
        return {}
    columns = store.query(StoreQuery(machine, asked, from_ms, to_ms))
    return {
        one.signal: [
            Sample(t_us // 1000, plain(value)[0], quality, reason)
            for t_us, value, quality, reason in zip(one.t_us, one.value, one.quality, one.reason, strict=True)
        ]
        for one in columns
    }
