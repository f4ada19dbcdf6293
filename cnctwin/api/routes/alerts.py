"""GET /alerts, POST /alerts/{fingerprint}/acknowledge, /silences and /silences/{id}/end: what fires, and who takes care of it."""

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
from cnctwin.plant.alert_desk import ALERTS_NODE, FRESH_S_MAX, silent
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
        None, description="of the alert as it was shown; one that has begun again since is not acknowledged"
    )


class NewSilence(BaseModel):
    """Send no notifications for a while, of alerts that match all that is named; `*` and `?` stand for any characters."""

    model_config = ConfigDict(
        extra="forbid", json_schema_extra={"examples": [{"machine": "vmc", "for_s": 7200, "by": "ada", "comment": "service"}]}
    )
    machine: str = Field("", max_length=200)
    alertname: str = Field("", max_length=200)
    severity: str = Field("", max_length=20)
    for_s: float = Field(gt=0.0, le=30 * 86_400.0)
    by: str = Field("", max_length=100)
    comment: str = Field("", max_length=1000)


class EndOfSilence(BaseModel):
    """The person who ends it."""

    model_config = ConfigDict(extra="forbid")
    by: str = Field("", max_length=100)


class Outcome(Answer):
    """The outcome of a command."""

    done: bool
    text: str = Field(examples=["rule_vibration of vmc is acknowledged by ada"])


class Alerts(Answer):
    """The state of the alerts processor as it publishes it (docs/how-to/alerts.md), and whether that can be relied on."""

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
        reason = alerts_trouble(live, state)
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
        """Say that somebody takes care of an alert: it is neither repeated nor escalated."""
        by = _signed(request, body.by)
        state = _kept_up(live)
        alert = _one(state, fingerprint)
        if body.episode is not None and body.episode != alert.get("episode"):
            raise ApiError(409, f"alert {fingerprint} has begun again since (episode {alert.get('episode')}); look at it again")
        fields = {"fingerprint": alert["fingerprint"], "episode": alert.get("episode"), "by": by, "comment": body.comment}
        return await _command(live, viewer, "ack", fields)

    @router.post("/silences", response_model=Outcome, responses=refusals)
    async def silence(body: NewSilence, request: Request) -> Any:
        """Begin a silence."""
        by = _signed(request, body.by)
        matchers = {name: text for name in ("machine", "alertname", "severity") if (text := getattr(body, name).strip())}
        if not matchers:
            raise ApiError(400, "a silence needs machine, alertname or severity; machine '*' is all of them")
        request.state.object = ", ".join(f"{name} = {text}" for name, text in matchers.items())
        _kept_up(live)
        fields = {"by": by, "comment": body.comment, "matchers": matchers, "for_s": body.for_s}
        return await _command(live, viewer, "silence", fields)

    @router.post("/silences/{silence_id}/end", response_model=Outcome, responses=refusals)
    async def end_silence(
        silence_id: Annotated[str, Path(description="As GET /alerts has it", max_length=64, examples=["9f31c2"])],
        body: EndOfSilence,
        request: Request,
    ) -> Any:
        """End a silence now."""
        by = _signed(request, body.by)
        if silence_id not in [one.get("id") for one in _kept_up(live).get("silences", ())]:
            raise ApiError(404, f"there is no silence {silence_id[:64]!r}; GET /alerts lists them")
        return await _command(live, viewer, "unsilence", {"by": by, "silence": silence_id})

    return router


def _signed(request: Request, given: str) -> str:
    """Return who does it: the user that the server knows by name, else whoever is given. Raises ApiError where nobody is."""
    by = request.state.user or given.strip()
    if not by:
        raise ApiError(400, "by is empty; say who does it")
    return str(by)


def _kept_up(live: LivePlant) -> Mapping[str, Any]:
    """The state of alerts. Raises ApiError where nobody keeps it up."""
    state = live.alerts()
    if (reason := alerts_trouble(live, state)) is not None or state is None:
        raise ApiError(503, reason or "nothing was heard of alerts")
    return state


async def _command(live: LivePlant, viewer: Viewer | None, name: str, fields: Mapping[str, Any]) -> dict[str, Any]:
    """Give a command, and wait for what becomes of it."""
    if viewer is None:
        raise ApiError(503, "no broker is listened to; nothing can be commanded")
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


def alerts_trouble(live: LivePlant, state: Mapping[str, Any] | None) -> str | None:
    """Return why the state of alerts cannot be relied on; None where it can. It is retained, and outlives its processor."""
    if state is None:
        return "nothing was heard of alerts; does the processor run? (cnctwin process alerts)"
    is_gone = any(view.node == ALERTS_NODE and not view.online for view in live.nodes())
    return silent(state) if is_gone or published_state.age_s(state, time.time()) > FRESH_S_MAX else None
