"""The query methods: present values, history; and the update methods, which are refused, since cnctwin only reads."""

from itertools import islice
from typing import Any

from fastapi import APIRouter, Request
from fastapi.responses import JSONResponse, Response

from cnctwin.api.errors import ApiError
from cnctwin.api.i3x.answer import answer
from cnctwin.api.i3x.explore import entries
from cnctwin.api.i3x.history import SIGNALS_MAX, Past, Range, no_values, pasts, range_of
from cnctwin.api.i3x.problem import Json, bulk, failure, item, missing
from cnctwin.api.i3x.requests import History, Values
from cnctwin.api.i3x.space import Element, Space
from cnctwin.api.store_reader import StoreReader

COMPONENTS_MAX = 20_000  # of one answer
NOT_WRITTEN = "cnctwin only reads: no value of a control is ever written; capabilities.update in /info says so"


def query_routes(space: Space, store: StoreReader) -> APIRouter:
    """The routes."""
    router = APIRouter(tags=["Query"])

    @router.post("/objects/value")
    async def value(request: Request, asked: Values) -> Response:
        """The last known values, with those of the components where `maxDepth` is not 1."""
        return await store.work(lambda: _values(request, space, asked))

    @router.post("/objects/history")
    async def history(request: Request, asked: History) -> Response:
        """Values between two times, oldest first."""
        return await _history(request, space, store, asked)

    @router.put("/objects/value")
    async def write_value() -> Response:
        """Not implemented, on purpose."""
        return JSONResponse(failure(501, NOT_WRITTEN), 501)

    @router.put("/objects/history")
    async def write_history() -> Response:
        """Not implemented, on purpose."""
        return JSONResponse(failure(501, NOT_WRITTEN), 501)

    return router


def _values(request: Request, space: Space, asked: Values) -> Response:
    room = COMPONENTS_MAX
    left_out = 0

    def shown(one: Element) -> Json:
        nonlocal room, left_out
        said: Json = {"isComposition": one.is_composition, **one.value().as_json()}
        if one.is_composition and asked.max_depth != 1:
            every = one.components()
            said["components"] = {name: value.as_json() for name, value in islice(every.items(), room)}
            left_out += len(every) - len(said["components"])
            room -= len(said["components"])
        return said

    body = bulk(entries(space, asked.element_ids, shown))
    return answer(request, body, f"{COMPONENTS_MAX} components are the limit; {left_out} were left out" if left_out else None)


async def _history(request: Request, space: Space, store: StoreReader, asked: History) -> Response:
    span = range_of(asked.start_time, asked.end_time)
    found = await store.work(lambda: list(space.find(asked.element_ids)))
    wanted: dict[str, list[str]] = {}
    for one in found:
        if one is not None and one.place.signal:
            wanted.setdefault(one.place.machine, []).append(one.place.signal)
    if (count := sum(map(len, wanted.values()))) > SIGNALS_MAX:
        raise ApiError(400, f"elementIds names {count} signals; {SIGNALS_MAX} are the limit of one history")
    known = {
        (machine, name): past
        for machine, names in wanted.items()
        for name, past in (await pasts(space.live, store, machine, list(dict.fromkeys(names)), span)).items()
    }
    left_out = {f"{signal}: {past.left_out}" for (_, signal), past in known.items() if past.left_out}
    if asked.max_depth != 1 and any(one is not None and one.is_composition for one in found):
        left_out.add("the history of components is asked for by their own element ids")
    results = (
        missing("elementId", element_id, "Element")
        if one is None
        else item("elementId", element_id, _values_of(one, known.get(one.place, Past(())), span))
        for element_id, one in zip(asked.element_ids, found, strict=True)
    )
    return answer(request, bulk(results), "; ".join(sorted(left_out)) or None)


def _values_of(one: Element, past: Past, span: Range) -> dict[str, Any]:
    values = past.values or no_values(span)
    return {"isComposition": one.is_composition, "values": [value.as_json() for value in values]}
