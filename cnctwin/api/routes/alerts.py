"""GET /alerts and POST /alerts/{fingerprint}/acknowledge: what fires, and who takes care of it."""

import asyncio
import json
import re
import time
from collections.abc import Mapping
from typing import Annotated, Any
from uuid import uuid4

from fastapi import APIRouter, Path, Request
from pydantic import BaseModel, ConfigDict, Field

from cnctwin.api.answers import Answer, Problem
from cnctwin.api.errors import ApiError
from cnctwin.api.live.plant import LivePlant
from cnctwin.api.live.viewer import Viewer
from cnctwin.plant.alert_desk import FRESH_S_MAX
from cnctwin.processes import published_state
from sparkplug.clock import now_ms
from twin.vocabulary.topics import ALERT_COMMAND

ANSWER_S_MAX = 5.0
LOOK_S = 0.05
_FINGERPRINT = re.compile(r"[0-9a-f]{4,64}")


class Acknowledgement(BaseModel):
    """The person who takes care, and why. Of a user who is known by name `by` is that name, whatever stands here."""

    model_config = ConfigDict(extra="forbid", json_schema_extra={"examples": [{"by": "ada", "comment": "on my way"}]})
    by: str = Field("", max_length=100)
    comment: str = Field("", max_length=1000)
    episode: int | None = Field(
        None, description="of the alert as it was shown; one that has begun anew since is not acknowledged"
    )


class Outcome(Answer):
    """The outcome of a command."""

    done: bool
    text: str = Field(examples=["rule_vibration of vmc is acknowledged by ada"])


class Alerts(Answer):
    """The state of the alerts processor as it publishes it (docs/alerts.md), and whether that can be relied on."""

    now: int
    available: bool
    reason: str | None
    alerts: list[dict[str, Any]]


def alert_routes(live: LivePlant, viewer: Viewer | None) -> APIRouter:
    """The routes."""
    router = APIRouter(tags=["alerts"])

    @router.get("/alerts", response_model=Alerts)
    async def alerts() -> Any:
        """All alerts, silences and receivers; `available` false, with the reason, where nobody keeps them up."""
        state = live.alerts()
        reason = _trouble(state)
        return {
            "alerts": [],
            "silences": [],
            "receivers": {},
            **(state or {}),
            "now": now_ms(),
            "available": reason is None,
            "reason": reason,
        }

    refusals: dict[int | str, dict[str, Any]] = {status: {"model": Problem} for status in (404, 409, 503, 504)}

    @router.post("/alerts/{fingerprint}/acknowledge", response_model=Outcome, responses=refusals)
    async def acknowledge(
        fingerprint: Annotated[str, Path(description="Of the alert, or its beginning", max_length=64, examples=["ea33a6"])],
        body: Acknowledgement,
        request: Request,
    ) -> Any:
        """Say that somebody takes care of an alert: it is not repeated and goes to nobody else."""
        by = getattr(request.state, "user", None) or body.by.strip()
        if not by:
            raise ApiError(400, "by is empty; say who takes care of it")
        state = live.alerts()
        if (reason := _trouble(state)) is not None or state is None or viewer is None:
            raise ApiError(503, reason or "no broker is listened to; nothing can be acknowledged")
        alert = _one(state, fingerprint)
        if body.episode is not None and body.episode != alert.get("episode"):
            raise ApiError(409, f"alert {fingerprint} has begun anew since (episode {alert.get('episode')}); look at it again")
        fields = {"fingerprint": alert["fingerprint"], "episode": alert.get("episode"), "by": by, "comment": body.comment}
        return await _command(live, viewer, "ack", fields)

    return router


async def _command(live: LivePlant, viewer: Viewer, name: str, fields: Mapping[str, Any]) -> dict[str, Any]:
    """Give a command, and wait for what becomes of it."""
    key = uuid4().hex[:16]
    if not viewer.publish(ALERT_COMMAND + name, json.dumps({"id": key, **fields}).encode()):
        raise ApiError(503, f"{viewer.trouble or 'too much waits for the broker'}; try again")
    deadline_s = time.monotonic() + ANSWER_S_MAX
    while time.monotonic() < deadline_s:
        await asyncio.sleep(LOOK_S)
        outcome = next((one for one in (live.alerts() or {}).get("commands", ()) if one.get("id") == key), None)
        if outcome is not None:
            if not outcome["done"]:
                raise ApiError(409, str(outcome["text"]))
            return {"done": True, "text": str(outcome["text"])}
    raise ApiError(504, f"no answer within {ANSWER_S_MAX:g} s; does the processor `alerts` run? (cnctwin process alerts)")


def _one(state: Mapping[str, Any], start: str) -> Mapping[str, Any]:
    on = [alert for alert in state.get("alerts", ()) if alert.get("phase") in ("firing", "acknowledged")]
    found: list[Mapping[str, Any]] = [alert for alert in on if str(alert.get("fingerprint", "")).startswith(start)]
    if not _FINGERPRINT.fullmatch(start) or not found:
        raise ApiError(404, f"no alert fires whose fingerprint begins with {start[:64]!r}; GET /alerts lists those that do")
    if len(found) > 1:
        raise ApiError(409, f"{len(found)} alerts fire whose fingerprint begins with {start!r}; give more of it")
    return found[0]


def _trouble(state: Mapping[str, Any] | None) -> str | None:
    if state is None:
        return "nothing was heard of alerts; does the processor run? (cnctwin process alerts)"
    age_s = published_state.age_s(state, time.time())
    if age_s > FRESH_S_MAX:
        return f"the state of alerts is {age_s:.0f} s old: the processor `alerts` does not run any more"
    return None
