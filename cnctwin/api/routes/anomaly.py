"""GET /anomaly/{machine}, POST /anomaly/{machine}/verdict: why a machine's score alarms, and what a person says of it."""

import asyncio
import json
import time
from collections.abc import Mapping
from typing import Any, Literal
from uuid import uuid4

from fastapi import APIRouter, Request
from pydantic import BaseModel, ConfigDict, Field

from cnctwin.api.answers import Answer, MachineName, Problem, T
from cnctwin.api.errors import ApiError
from cnctwin.api.routes.plant import UNKNOWN, Machine, known_state
from cnctwin.api.sources import Sources
from processors.plain_topic import topic_level
from sparkplug.clock import now_ms
from twin.anomaly.parts.alarms.verdict import LINE
from twin.vocabulary import twin_signals
from twin.vocabulary.topics import VERDICT

ANSWER_S_MAX = 5.0
LOOK_S = 0.05
RUNS = "does the processor `joint_anomaly` run with common_mode = parts? (cnctwin process joint_anomaly)"


class VerdictRequest(BaseModel):
    """A person's word on an alarm. A user who is known by name has that name, whatever stands here.

    verdict: true = it is a fault; false = it is none, and its size is to alarm no more; known = the cause is known, and its like
    is to be held back until it is gone
    """

    model_config = ConfigDict(
        extra="forbid", json_schema_extra={"examples": [{"verdict": "known", "label": "dull tool", "by": "ada"}]}
    )
    verdict: Literal["true", "false", "known"]
    label: str = Field(
        "", max_length=60, pattern=LINE, description="what it was, in a few words; shown at later alarms that look like it"
    )
    by: str = Field("", max_length=100, pattern=LINE)
    alarm_at_s: float | None = Field(
        None, ge=0.0, le=1e11, description="when the alarm began, s since 1970, as GET has it; absent = the latest"
    )
    ends: bool = Field(False, description="an alarm that was called true, and stands, ends now")


class Anomaly(Answer):
    """The score of a machine with its reason, and the last alarms with who said what of them; null = not known."""

    machine: MachineName
    now: T
    is_alarm: bool | None = Field(description="null: no threshold, no score, or no processor computes them")
    score: float | None
    threshold: float | None
    why: dict[str, Any] | None = Field(description="signal, scale, program, tool, lines, measured, expected, by, like, peers, …")
    why_t: int | None = Field(description="when the reason was reported, ms since 1970")
    knows: str | None = Field(description="what the score knows of the program that runs", examples=["12 parts"])
    verdicts: dict[str, Any] | None = Field(description="alarms, limits that were raised, outcomes, precision, suggestion")
    reason: str | None


def anomaly_routes(sources: Sources) -> APIRouter:
    """The routes."""
    router = APIRouter(tags=["anomaly"])
    refusals: dict[int | str, dict[str, Any]] = {status: {"model": Problem} for status in (400, 404, 409, 503, 504)}

    @router.get("/anomaly/{machine}", response_model=Anomaly, responses=UNKNOWN)
    async def anomaly(machine: Machine) -> Any:
        """Return why the score of a machine alarms, and what was said of its last alarms."""
        return _shown(sources, machine)

    @router.post("/anomaly/{machine}/verdict", response_model=Anomaly, responses=refusals)
    async def verdict(machine: Machine, body: VerdictRequest, request: Request) -> Any:
        """Say that an alarm was true, false, or of a known cause."""
        by = request.state.user or body.by.strip()
        if not by:
            raise ApiError(400, "by is empty; say who does it")
        alarm_at_s = _meant(_shown(sources, machine), body.alarm_at_s)
        request.state.object = f"{machine} {alarm_at_s:.3f} {body.verdict}"
        said = body.model_dump(include={"verdict", "label", "ends"}) | {"alarm_at_s": alarm_at_s, "by": str(by)}
        await _said(sources, machine, said)
        return _shown(sources, machine)

    return router


def _shown(sources: Sources, machine: str) -> dict[str, Any]:
    twin: Mapping[str, Mapping[str, Any]] = known_state(sources.live, machine)["twin"]

    def now(name: str) -> Any:
        one = twin.get(name, {})
        return one.get("value") if one.get("quality") == "good" else None

    verdicts, alarm = _document(now(twin_signals.ANOMALY_VERDICTS)), twin.get(twin_signals.ANOMALY_ALARM, {})
    reason = f"nothing was heard of the alarms of {machine}; {RUNS}" if verdicts is None else alarm.get("reason")
    return {
        "machine": machine,
        "now": now_ms(),
        "is_alarm": now(twin_signals.ANOMALY_ALARM),
        "score": now(twin_signals.ADJUSTED_SCORE),
        "threshold": now(twin_signals.ANOMALY_THRESHOLD),
        "why": _document(now(twin_signals.ANOMALY_WHY)),
        "why_t": twin.get(twin_signals.ANOMALY_WHY, {}).get("t"),
        "knows": now(twin_signals.ANOMALY_KNOWS),
        "verdicts": verdicts,
        "reason": reason,
    }


def _document(text: Any) -> dict[str, Any] | None:
    """Return the object that a text is; None where it is none."""
    try:
        found = json.loads(text) if isinstance(text, str) else None
    except (ValueError, RecursionError):
        return None
    return found if isinstance(found, dict) else None


def _meant(shown: Mapping[str, Any], alarm_at_s: float | None) -> float:
    """Return when the alarm that is meant began. Raises ApiError where there is none."""
    if shown["verdicts"] is None:
        raise ApiError(503, str(shown["reason"]))
    began_s = [one.get("alarm_at_s") for one in shown["verdicts"].get("alarms", ()) if isinstance(one, dict)]
    known = [one for one in began_s if isinstance(one, (int, float))]
    if alarm_at_s is not None:
        return alarm_at_s
    if not known:
        raise ApiError(404, f"{shown['machine']} has had no anomaly alarm that is remembered")
    return float(known[0])


async def _said(sources: Sources, machine: str, said: Mapping[str, Any]) -> None:
    """Publish a verdict, retained, and wait for what becomes of it. Raises ApiError where it is refused, or nobody answers."""
    viewer = sources.viewer
    if viewer is None:
        raise ApiError(503, "no broker is listened to; nothing can be said")
    key = uuid4().hex[:16]
    payload = json.dumps({"version": 1, "id": key, "at_s": round(time.time(), 3), **said}).encode()
    if not viewer.publish(VERDICT + topic_level(machine), payload, retain=True):
        raise ApiError(503, f"{viewer.trouble or 'too much waits for the broker'}; try again")
    deadline_s = time.monotonic() + ANSWER_S_MAX
    while time.monotonic() < deadline_s:
        await asyncio.sleep(LOOK_S)
        outcomes = (_shown(sources, machine)["verdicts"] or {}).get("outcomes", ())
        outcome = next((one for one in outcomes if isinstance(one, dict) and one.get("id") == key), None)
        if outcome is not None:
            if not outcome.get("is_done"):
                raise ApiError(409, str(outcome.get("text")))
            return
    raise ApiError(504, f"no answer within {ANSWER_S_MAX:g} s; the broker keeps the verdict for when it is back: {RUNS}")
