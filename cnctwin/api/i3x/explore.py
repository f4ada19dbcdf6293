"""The exploratory methods: /info, namespaces, object types, relationship types and objects."""

from collections.abc import Callable, Iterable, Mapping
from functools import partial
from itertools import islice
from typing import Annotated, Any

from fastapi import APIRouter, Query, Request
from fastapi.responses import Response

from cnctwin.api.i3x.answer import answer
from cnctwin.api.i3x.problem import Json, bulk, item, missing, success
from cnctwin.api.i3x.requests import Objects, Related, Types
from cnctwin.api.i3x.space import Element, Space
from cnctwin.api.i3x.types import NAMESPACES, object_types, relationship_types
from cnctwin.api.store_reader import StoreReader

SPEC_VERSION = "1.0"
OBJECTS_MAX = 20_000
Namespace = Annotated[str | None, Query(alias="namespaceUri", max_length=2_000)]
CAPABILITIES = {
    "query": {"history": True},
    "update": {"current": False, "history": False},
    "subscribe": {"stream": True},
}


def explore_routes(space: Space, store: StoreReader) -> APIRouter:
    """The routes."""
    router = APIRouter(tags=["Explore"])

    @router.get("/info")
    async def info() -> Json:
        """Tell the capabilities of this server. No log-in is needed, so it says nothing of the plant."""
        return success({"specVersion": SPEC_VERSION, "serverName": "cnctwin", "capabilities": CAPABILITIES})

    @router.get("/namespaces")
    async def namespaces() -> Json:
        """All namespaces."""
        return success(NAMESPACES)

    @router.get("/objecttypes")
    async def all_object_types(namespace: Namespace = None) -> Json:
        """All object types, or those of a namespace."""
        return success(_of_namespace((one.as_json() for one in object_types().values()), namespace))

    @router.post("/objecttypes/query")
    async def some_object_types(asked: Types) -> Json:
        """Object types by id."""
        known = {name: one.as_json() for name, one in object_types().items()}
        return _by_id(asked.element_ids, known, "Object type")

    @router.get("/relationshiptypes")
    async def all_relationship_types(namespace: Namespace = None) -> Json:
        """All relationship types, or those of a namespace."""
        return success(_of_namespace(relationship_types(), namespace))

    @router.post("/relationshiptypes/query")
    async def some_relationship_types(asked: Types) -> Json:
        """Relationship types by id."""
        return _by_id(asked.element_ids, {one["elementId"]: one for one in relationship_types()}, "Relationship type")

    @router.get("/objects")
    async def objects(
        request: Request,
        type_id: Annotated[str | None, Query(alias="typeElementId", max_length=2_000)] = None,
        with_metadata: Annotated[bool, Query(alias="includeMetadata")] = False,
        root: bool = False,
    ) -> Response:
        """All objects, those of a type, or the root."""
        return await store.work(lambda: _objects(request, space, type_id, with_metadata=with_metadata, root=root))

    @router.post("/objects/list")
    async def some_objects(asked: Objects) -> Json:
        """Objects by id, without their values."""
        shown = partial(Element.as_json, with_metadata=asked.include_metadata)
        return await store.work(lambda: bulk(entries(space, asked.element_ids, shown)))

    @router.post("/objects/related")
    async def related(asked: Related) -> Json:
        """The relationships of objects, each with the object that it leads to."""
        return await store.work(lambda: bulk(entries(space, asked.element_ids, lambda one: _edges(space, one, asked))))

    return router


def entries(space: Space, element_ids: list[str], shown: Callable[[Element], Any]) -> Iterable[Json]:
    """Yield what became of each object that was asked for, in the order of the request."""
    for element_id, found in zip(element_ids, space.find(element_ids), strict=True):
        if found is None:
            yield missing("elementId", element_id, "Element")
        else:
            yield item("elementId", element_id, shown(found))


def _objects(request: Request, space: Space, type_id: str | None, *, with_metadata: bool, root: bool) -> Response:
    every = [space.plant()] if root else space.every()
    wanted = (one for one in every if type_id is None or one.type_id == type_id)
    found = [one.as_json(with_metadata=with_metadata) for one in islice(wanted, OBJECTS_MAX + 1)]
    line = f"{OBJECTS_MAX} objects are the limit; ask for those of a type, or go from object to object"
    return answer(request, success(found[:OBJECTS_MAX]), line if len(found) > OBJECTS_MAX else None)


def _edges(space: Space, one: Element, asked: Related) -> list[Json]:
    targets = [(name, Element(place)) for name, place in one.related() if asked.relationship_type in (None, name)]
    found = space.find([target.element_id for _, target in targets])
    return [
        {"sourceRelationship": name, "object": target.as_json(with_metadata=asked.include_metadata)}
        for (name, _), target in zip(targets, found, strict=True)
        if target is not None
    ]


def _by_id(element_ids: list[str], known: Mapping[str, Json], what: str) -> Json:
    return bulk(item("elementId", one, known[one]) if one in known else missing("elementId", one, what) for one in element_ids)


def _of_namespace(found: Iterable[Json], uri: str | None) -> list[Json]:
    return [one for one in found if uri is None or one["namespaceUri"] == uri]
