"""GET /twin/{machine}, POST /twin/{machine}/diagnose, promote, back, withdraw: a machine's loop, and what people ask of it."""

import asyncio
import json
import time
from collections.abc import Mapping
from typing import Annotated, Any
from uuid import uuid4

from fastapi import APIRouter, Request
from pydantic import BaseModel, ConfigDict, Field

from cnctwin.api.answers import Problem
from cnctwin.api.errors import ApiError
from cnctwin.api.live.loops import LoopDocument
from cnctwin.api.live.viewer import Viewer
from cnctwin.api.routes.plant import Machine, known_state
from cnctwin.api.sources import Sources
from twin.vocabulary.topics import LOOP_REQUEST

ANSWER_S_MAX = 8.0
LOOK_S = 0.05
RUNS = "does `cnctwin twin run` run?"


class TwinRequest(BaseModel):
    """The person who asks, and the version that is meant. A user who is known by name has that name, whatever stands here."""

    model_config = ConfigDict(extra="forbid", json_schema_extra={"examples": [{"by": "ada", "why": "the pump is new"}]})
    by: str = Field("", max_length=100)
    version: Annotated[str, Field(max_length=64, pattern=r"^[0-9a-f]*$")] | None = Field(
        None, description="the challenger; of back the live description that is to go; else the one that is there now"
    )
    why: str = Field("", max_length=1000)


class Twin(LoopDocument):
    """The loop's document; where none was heard, `step` is null, and `reason` says what to do."""

    reason: str | None = None
    sealed: dict[str, Any] | None = Field(None, description="of the demo: the hash of what is hidden, and what it was")


def twin_routes(sources: Sources) -> APIRouter:
    """The routes."""
    router = APIRouter(tags=["twin"])
    refusals: dict[int | str, dict[str, Any]] = {status: {"model": Problem} for status in (400, 404, 409, 503, 504)}

    @router.get("/twin/{machine}", response_model=Twin, response_model_exclude_unset=True, responses={404: {"model": Problem}})
    async def twin(machine: Machine) -> Any:
        """Return the live description, the challenger, what each does to the standing gap, and what the loop is doing."""
        return _shown(sources, machine)

    @router.post("/twin/{machine}/diagnose", response_model=Twin, response_model_exclude_unset=True, responses=refusals)
    async def diagnose(machine: Machine, body: TwinRequest, request: Request) -> Any:
        """Have the gap of a machine diagnosed."""
        return await _asked(sources, "diagnose", machine, body, request)

    @router.post("/twin/{machine}/promote", response_model=Twin, response_model_exclude_unset=True, responses=refusals)
    async def promote(machine: Machine, body: TwinRequest, request: Request) -> Any:
        """Make the challenger the live description."""
        return await _asked(sources, "promote", machine, body, request)

    @router.post("/twin/{machine}/back", response_model=Twin, response_model_exclude_unset=True, responses=refusals)
    async def back(machine: Machine, body: TwinRequest, request: Request) -> Any:
        """Make the description before the live one live again."""
        return await _asked(sources, "back", machine, body, request)

    @router.post("/twin/{machine}/withdraw", response_model=Twin, response_model_exclude_unset=True, responses=refusals)
    async def withdraw(machine: Machine, body: TwinRequest, request: Request) -> Any:
        """Take the challenger away, or end the diagnosis that is under way."""
        return await _asked(sources, "withdraw", machine, body, request)

    return router


def _shown(sources: Sources, machine: str) -> dict[str, Any]:
    viewer = sources.viewer
    document = None if viewer is None else viewer.loops.of(machine)
    sealed = {"sealed": sources.envelope.shown()} if sources.envelope.is_given else {}
    if document is not None:
        return {**document, **sealed}
    known_state(sources.live, machine)
    reason = f"nothing was heard of the loop of {machine}: is it described (machines/{machine}.toml), and {RUNS}"
    return {"machine": machine, "step": None, "reason": reason, **sealed}


async def _asked(sources: Sources, word: str, machine: str, body: TwinRequest, request: Request) -> dict[str, Any]:
    """Send a request, and wait for what becomes of it. Raises ApiError where it is refused, or nobody answers."""
    by = request.state.user or body.by.strip()
    if not by:
        raise ApiError(400, "by is empty; say who does it")
    viewer = sources.viewer
    if viewer is None:
        raise ApiError(503, "no broker is listened to; nothing can be asked for")
    document = viewer.loops.of(machine)
    if document is None:
        raise ApiError(404, str(_shown(sources, machine)["reason"]))
    version = body.version or _meant(document, word)
    request.state.object = " ".join(filter(None, (machine, version)))
    if word == "promote" and version == _version(document, "challenger") and not document.get("may_promote"):
        raise ApiError(409, str(document.get("why_not") or "it may not be promoted"))
    key = uuid4().hex[:16]
    asked = {"machine": machine, "by": str(by), "version": version, "why": body.why, "id": key}
    if not viewer.publish(LOOP_REQUEST + word, json.dumps(asked).encode()):
        raise ApiError(503, f"{viewer.trouble or 'too much waits for the broker'}; try again")
    await _answered(viewer, machine, key)
    return _shown(sources, machine)


async def _answered(viewer: Viewer, machine: str, key: str) -> None:
    deadline_s = time.monotonic() + ANSWER_S_MAX
    while time.monotonic() < deadline_s:
        await asyncio.sleep(LOOK_S)
        answers = (viewer.loops.of(machine) or {}).get("answers", ())
        answer = next((one for one in answers if one["id"] == key), None)
        if answer is not None:
            if not answer["done"]:
                raise ApiError(409, str(answer["text"]))
            return
    raise ApiError(504, f"no answer within {ANSWER_S_MAX:g} s; {RUNS}")


def _meant(document: Mapping[str, Any], word: str) -> str:
    return _version(document, "live" if word == "back" else "challenger")


def _version(document: Mapping[str, Any], which: str) -> str:
    found = document.get(which)
    return str(found.get("version") or "") if isinstance(found, dict) else ""
