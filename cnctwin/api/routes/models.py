"""GET /models, POST /models/{kind}/{machine}/promote: the models (docs/explanation/anomaly.md), and which version counts."""

import time
from pathlib import Path as FilePath
from typing import Annotated, Any

from fastapi import APIRouter, Path, Request
from pydantic import BaseModel, ConfigDict, Field

from cnctwin.api.answers import Answer, Problem
from cnctwin.api.errors import ApiError
from cnctwin.api.sources import Sources
from cnctwin.errors import UsageError
from cnctwin.models import registry


class Promotion(BaseModel):
    """The version that is to count from now on, and why."""

    model_config = ConfigDict(
        extra="forbid", json_schema_extra={"examples": [{"version": "3f9c", "because": "won its comparison of last week"}]}
    )
    version: str = Field(min_length=1, max_length=200, description="or its beginning")
    because: str = Field(min_length=1, max_length=500)


class Shelf(Answer):
    """All versions of one kind for one machine, the newest last; `champion` is the one that counts."""

    kind: str = Field(examples=["anomaly"])
    machine: str
    versions: list[str]
    champion: str | None
    previous: str | None
    reason: str


def models_routes(sources: Sources) -> APIRouter:
    """The routes."""
    router = APIRouter(tags=["models"])
    refusals: dict[int | str, dict[str, Any]] = {status: {"model": Problem} for status in (400, 403, 404, 409, 503)}

    def folder() -> FilePath:
        if sources.registry is None:
            raise ApiError(404, "no registry of models was named; give `cnctwin serve --registry DIR`")
        return sources.registry

    @router.get("/models", response_model=list[Shelf], responses=refusals)
    async def models() -> Any:
        """Each kind of each machine, with its versions."""
        place = folder()
        return await sources.store.work(lambda: [_told(one) for one in registry.shelves(place)])

    @router.post("/models/{kind}/{machine}/promote", response_model=Shelf, responses=refusals)
    async def promote(
        kind: Annotated[str, Path(max_length=200, examples=["anomaly"])],
        machine: Annotated[str, Path(max_length=200, examples=["vmc"])],
        body: Promotion,
        request: Request,
    ) -> Any:
        """Let a version count, for administrators. The one before is kept warm for 48 h."""
        place, by = folder(), request.state.user
        request.state.object = f"{kind}/{machine} {body.version}"
        because = f"{body.because.strip()} (by {by})" if by else body.because.strip()
        return await sources.store.work(lambda: _promoted(place, kind, machine, body.version, because))

    return router


def _promoted(place: FilePath, kind: str, machine: str, version: str, because: str) -> dict[str, Any]:
    try:
        own = registry.shelf(place, kind, machine)
        registry.promoted(own, own.named(version).name, because, time.time())
    except UsageError as error:
        raise ApiError(409, str(error)) from None
    except OSError as error:
        raise ApiError(503, f"the registry {place} cannot be written: {error.strerror}; may this server write there?") from None
    return _told(own)


def _told(own: registry.Shelf) -> dict[str, Any]:
    pointer = own.pointer()
    head = {"kind": own.kind, "machine": own.machine, "versions": list(own.versions())}
    if pointer is None:
        return {**head, "champion": None, "previous": None, "reason": ""}
    return {**head, "champion": pointer.champion, "previous": pointer.previous, "reason": pointer.reason}
