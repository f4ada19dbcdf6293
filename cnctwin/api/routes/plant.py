"""GET /machines, /state/{machine} and /stream: the plant as it is now."""

from functools import partial
from typing import Annotated, Any

from fastapi import APIRouter, Path, Query, Request
from fastapi.responses import Response

from cnctwin.api.answers import FleetItem, Problem, State
from cnctwin.api.errors import ApiError
from cnctwin.api.live.batches import event
from cnctwin.api.live.event_stream import EventStream
from cnctwin.api.live.fan_out import FanOut
from cnctwin.api.live.plant import LivePlant
from sparkplug.clock import now_ms

NAMES_SHOWN = 20
Machine = Annotated[str, Path(description="Its name: the Sparkplug device", max_length=200, examples=["vmc"])]
UNKNOWN: dict[int | str, dict[str, Any]] = {404: {"model": Problem, "description": "This machine is not known"}}
BUSY: dict[int | str, dict[str, Any]] = {503: {"model": Problem, "description": "A part is missing or busy; the line says which"}}


def plant_routes(live: LivePlant, fan_out: FanOut) -> APIRouter:
    """The routes."""
    router = APIRouter(tags=["plant"])

    @router.get("/machines", response_model=list[FleetItem])
    async def machines() -> Any:
        """Each machine in short."""
        return live.fleet()

    @router.get("/state/{machine}", response_model=State, response_model_exclude_unset=True, responses=UNKNOWN)
    async def state(machine: Machine) -> Any:
        """All that is known of a machine now: measured beside the twin's, each with unit, quality and provenance."""
        return known_state(live, machine)

    @router.get("/stream", responses={200: {"content": {"text/event-stream": {}}}, **UNKNOWN, **BUSY}, response_class=Response)
    async def stream(
        request: Request,
        machine: Annotated[str | None, Query(description="One machine; without it, the fleet", max_length=200)] = None,
    ) -> Response:
        """Server-sent events, at most ten a second.

        Of a machine: `state` (as /state), then `rows`: `{"now", "rows": [[t, signal, value, quality, reason]], "online"}`, and
        `state` again where signals or the connection have changed. Without a machine: `fleet`, then `fleet_rows`:
        `{"now", "rows": [[machine, t, signal, value, quality]]}`. On both: `alerts`, as /alerts, and `processors`:
        `{"now", "behind", "refused", "described"}`, on change: the sentences on processors that fall behind, on what is refused,
        and on descriptions that have a fault, or null.
        """
        if machine is not None:
            known_state(live, machine)
        reader = fan_out.open(machine, request.state.client)
        if machine is None:
            first = event("fleet", {"now": now_ms(), **live.notices()._asdict(), "machines": live.fleet()})
        else:
            first = event("state", known_state(live, machine))
        return EventStream(first, reader.messages.get, partial(fan_out.close, reader))

    return router


def known_state(live: LivePlant, machine: str) -> dict[str, Any]:
    """The state of a machine. Raises ApiError, with the names of those that are known."""
    state = live.state(machine, now_ms())
    if state is None:
        raise unknown_machine(machine, live.machines())
    return state


def unknown_machine(machine: str, known: list[str]) -> ApiError:
    """The refusal that names those that there are."""
    shown = ", ".join(known[:NAMES_SHOWN]) + (f" and {len(known) - NAMES_SHOWN} more" if len(known) > NAMES_SHOWN else "")
    return ApiError(404, f"machine {machine[:80]!r} is not known; there are {shown or 'none yet'}")
