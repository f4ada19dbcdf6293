"""GET /history/{machine}: signals over time, from the store, or of the last minutes from memory."""

import json
from collections.abc import Sequence
from typing import Annotated, Any

from fastapi import APIRouter, Query
from fastapi.responses import Response

from cnctwin.api.answers import History
from cnctwin.api.errors import ApiError
from cnctwin.api.live.memory_column import column
from cnctwin.api.live.plant import LivePlant
from cnctwin.api.routes.plant import BUSY, UNKNOWN, Machine, unknown_machine
from cnctwin.api.store_reader import StoreReader
from cnctwin.api.value_object import QUALITY_NAMES, plain
from cnctwin.memory.store.contract import Column, Store, StoreError
from cnctwin.memory.store.contract import Query as StoreQuery
from sparkplug.clock import now_ms

SIGNALS_MAX = 60
WINDOWS_MAX = 200_000  # over all signals
RAW_MS_MAX = 3_600_000
LAST_MS = 300_000
JSON = "application/json"
MS_MAX = 32_503_680_000_000  # the year 3000

FromMs = Annotated[int | None, Query(alias="from", ge=0, le=MS_MAX, description="ms since 1970; else five minutes before `to`")]
ToMs = Annotated[int | None, Query(alias="to", ge=0, le=MS_MAX, description="ms since 1970; else now")]


def history_routes(live: LivePlant, store: StoreReader) -> APIRouter:
    """The route."""
    router = APIRouter(tags=["history"])

    @router.get("/history/{machine}", response_model=History, responses={**UNKNOWN, **BUSY})
    async def history(
        machine: Machine,
        signals: Annotated[str, Query(description="Names, with commas between", max_length=6000, examples=["spindle_load_pct"])],
        from_ms: FromMs = None,
        to_ms: ToMs = None,
        every_ms: Annotated[int | None, Query(ge=1, le=7 * 86_400_000, description="windows so wide; else as it came")] = None,
    ) -> Response:
        """Signals of [from, to): as they came, or for each window the mean of the good numbers, with low and high."""
        end_ms = now_ms() if to_ms is None else to_ms
        query = asked(machine, signals, end_ms - LAST_MS if from_ms is None else from_ms, end_ms, every_ms)
        if live.remembers(machine, query.signals, query.from_ms):
            return Response(await store.work(lambda: _from_memory(live, query, None)), media_type=JSON)
        try:
            body = await store.ask(lambda opened: _from_store(opened, query))
        except (ApiError, StoreError) as error:
            if machine not in live.machines():
                if store.configured:
                    raise
                raise unknown_machine(machine, live.machines()) from None
            reason = str(error)
            return Response(await store.work(lambda: _from_memory(live, query, reason)), media_type=JSON)
        if body is None:
            raise unknown_machine(machine, live.machines())
        return Response(body, media_type=JSON)

    return router


def asked(machine: str, signals: str, start_ms: int, end_ms: int, every_ms: int | None) -> StoreQuery:
    """The question, within its limits. Raises ApiError."""
    names = tuple(dict.fromkeys(name for name in (part.strip() for part in signals.split(",")) if name))
    if not 1 <= len(names) <= SIGNALS_MAX:
        raise ApiError(400, f"signals names {len(names)}; ask for 1 to {SIGNALS_MAX}, with commas between")
    if end_ms <= start_ms:
        raise ApiError(400, f"to {end_ms} is not after from {start_ms}; give a stretch of time in ms since 1970")
    if every_ms is None and end_ms - start_ms > RAW_MS_MAX:
        raise ApiError(400, f"from {start_ms} to {end_ms} is more than an hour as it came; give every_ms, or a shorter stretch")
    if every_ms is not None and (windows := (end_ms - start_ms) // every_ms * len(names)) > WINDOWS_MAX:
        raise ApiError(400, f"every_ms {every_ms} makes {windows} windows of {len(names)} signals; {WINDOWS_MAX} are the limit")
    return StoreQuery(machine, names, start_ms, end_ms, every_ms)


def _from_memory(live: LivePlant, query: StoreQuery, reason: str | None) -> bytes:
    known = live.recent(query.machine, query.signals, query.from_ms, query.to_ms)
    columns = [column(name, *known.get(name, (None, [])), query.every_ms) for name in query.signals]
    return _body(query, "memory", reason, columns)


def _from_store(store: Store, query: StoreQuery) -> bytes | None:
    columns = store.query(query)
    if not any(one.t_us for one in columns) and query.machine not in store.machines():
        return None
    return _body(query, "store", None, [_as_json(one) for one in columns])


def _as_json(one: Column) -> dict[str, Any]:
    return {
        "signal": one.signal,
        "unit": one.unit,
        "t": [t_us // 1000 for t_us in one.t_us],
        "value": [plain(value)[0] for value in one.value],
        "quality": [QUALITY_NAMES.get(quality, "bad") for quality in one.quality],
        "reason": one.reason,
        "low": one.low,
        "high": one.high,
        "count": one.count,
    }


def _body(query: StoreQuery, source: str, reason: str | None, columns: Sequence[dict[str, Any]]) -> bytes:
    head = {"machine": query.machine, "from": query.from_ms, "to": query.to_ms, "every_ms": query.every_ms}
    said = {**head, "source": source, "reason": reason, "columns": columns}
    return json.dumps(said, separators=(",", ":"), allow_nan=False).encode()
