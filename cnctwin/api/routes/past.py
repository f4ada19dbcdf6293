"""Routes to the past: GET /events/{machine}, /parts/{machine}, /validation/{machine}, POST /twin/replay."""

import asyncio
from typing import Annotated, Any

from fastapi import APIRouter, Query
from pydantic import BaseModel, ConfigDict, Field

from cnctwin.api.answers import Events, Parts, Replayed, Validation
from cnctwin.api.errors import ApiError
from cnctwin.api.event_list import EVENTS_MAX, description_text, events_of, part_records
from cnctwin.api.replay_child import replayed
from cnctwin.api.routes.history import MS_MAX, FromMs, ToMs
from cnctwin.api.routes.plant import BUSY, UNKNOWN, Machine, unknown_machine
from cnctwin.api.samples import samples_of
from cnctwin.api.sources import Sources
from cnctwin.memory.descriptions import described, faults
from cnctwin.memory.store.contract import Store
from sparkplug.clock import now_ms
from twin.vocabulary.twin_signals import PART_RECORD

DAY_MS = 86_400_000
STRETCH_MS_MAX = 31 * DAY_MS
REPLAY_MS_MAX = 6 * 3_600_000
PARTS_MAX = 1000


class Stretch(BaseModel):
    """A stretch of a machine's history, at most six hours."""

    model_config = ConfigDict(
        extra="forbid",
        populate_by_name=True,
        json_schema_extra={"examples": [{"machine": "vmc", "from": 1795305600000, "to": 1795309200000}]},
    )
    machine: str = Field(min_length=1, max_length=200, pattern=r"^[^\x00]*$")
    from_ms: int = Field(alias="from", ge=0, le=MS_MAX)
    to_ms: int = Field(alias="to", ge=0, le=MS_MAX)


def past_routes(sources: Sources) -> APIRouter:
    """The routes."""
    router = APIRouter(tags=["history"])
    replaying = asyncio.Lock()

    @router.get("/events/{machine}", response_model=Events, responses={**UNKNOWN, **BUSY})
    async def events(machine: Machine, from_ms: FromMs = None, to_ms: ToMs = None) -> Any:
        """Execution states, programs, tool changes, alarms, stops, parts, holes, pins and descriptions; a day if not said."""
        start_ms, end_ms = _stretch(from_ms, to_ms)
        found, source = await samples_of(sources, machine, None, start_ms, end_ms)
        told = events_of(found)
        descriptions: list[dict[str, Any]] = []
        if sources.store.configured and source == "store":
            told += await sources.store.ask(lambda store: _pins(store, machine, start_ms, end_ms))
            descriptions = await sources.store.ask(lambda store: _descriptions(store, machine, start_ms, end_ms))
            told += [_change(one) for one in descriptions if one["t"] >= start_ms]
            told += await sources.store.ask(lambda store: _faults(store, machine, start_ms, end_ms))
        told.sort(key=lambda one: one["t"])
        left_out = max(len(told) - EVENTS_MAX, 0)
        head = {"machine": machine, "from": start_ms, "to": end_ms, "source": source}
        return {**head, "left_out": left_out, "events": told[left_out:], "descriptions": descriptions}

    @router.get("/parts/{machine}", response_model=Parts, responses={**UNKNOWN, **BUSY})
    async def parts(
        machine: Machine,
        from_ms: FromMs = None,
        to_ms: ToMs = None,
        limit: Annotated[int, Query(ge=1, le=PARTS_MAX, description="the newest so many")] = 100,
    ) -> Any:
        """The as-built records of the parts that were made, newest first: what, with which tools, how hot, with what force."""
        start_ms, end_ms = _stretch(from_ms, to_ms)
        found, source = await samples_of(sources, machine, (PART_RECORD,), start_ms, end_ms)
        records = part_records(found.get(PART_RECORD, ()))
        return {"machine": machine, "from": start_ms, "to": end_ms, "source": source, "parts": records[:limit]}

    @router.get("/validation/{machine}", response_model=Validation, responses={**UNKNOWN, **BUSY})
    async def validation(machine: Machine) -> Any:
        """The twin against ground truth: the newest night that was judged, those before it, and whether to train again."""
        told = await sources.store.work(lambda: sources.nights.of(machine))
        if told["t"] is None and machine not in sources.live.machines():
            raise unknown_machine(machine, sources.live.machines())
        return told

    @router.post("/twin/replay", response_model=Replayed, responses={**UNKNOWN, **BUSY})
    async def replay(stretch: Stretch) -> Any:
        """The processors run again over at most six hours, compared with what was published then. One at a time."""
        start_ms, end_ms = stretch.from_ms, stretch.to_ms
        if not 0 < end_ms - start_ms <= REPLAY_MS_MAX:
            raise ApiError(400, f"from {start_ms} to {end_ms} is no stretch of at most six hours; give one")
        known = await sources.store.ask(lambda store: store.machines())
        if stretch.machine not in known:
            raise unknown_machine(stretch.machine, known)
        if replaying.locked():
            raise ApiError(503, "a replay is running; ask again when it is done", {"Retry-After": "10"})
        async with replaying:
            return await replayed(sources.store.where, stretch.machine, start_ms, end_ms, sources.constants.path)

    return router


def _descriptions(store: Store, machine: str, from_ms: int, to_ms: int) -> list[dict[str, Any]]:
    return [
        {"t": one.received_ms, "role": str(one.role), "version": one.version, "text": description_text(one.role, one.message)}
        for one in described(store, machine, from_ms, to_ms)
    ]


def _change(one: dict[str, Any]) -> dict[str, Any]:
    return {"t": one["t"], "until": None, "kind": "description", "text": one["text"]}


def _faults(store: Store, machine: str, from_ms: int, to_ms: int) -> list[dict[str, Any]]:
    return [
        {"t": max(one.from_ms, from_ms), "until": one.until_ms, "kind": "description_fault", "text": one.text}
        for one in faults(store, machine, from_ms, to_ms)
    ]


def _pins(store: Store, machine: str, from_ms: int, to_ms: int) -> list[dict[str, Any]]:
    return [
        {
            "t": max(pin.from_ms, from_ms),
            "until": pin.to_ms,
            "kind": "pin",
            "text": f"raw data kept for good: {pin.reason.replace('_', ' ')}",
        }
        for pin in store.pins(machine)
        if pin.from_ms < to_ms and pin.to_ms > from_ms
    ]


def _stretch(from_ms: int | None, to_ms: int | None) -> tuple[int, int]:
    end_ms = now_ms() if to_ms is None else to_ms
    start_ms = end_ms - DAY_MS if from_ms is None else from_ms
    if not 0 < end_ms - start_ms <= STRETCH_MS_MAX:
        raise ApiError(400, f"from {start_ms} to {end_ms} is no stretch of at most 31 days; give one")
    return start_ms, end_ms
