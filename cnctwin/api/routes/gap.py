"""GET /gap/{machine} and its report: how far the twin is off, whether that grows, and what the last diagnosis says."""

import json
import re
import shlex
from datetime import datetime
from pathlib import Path
from typing import Any

from fastapi import APIRouter
from fastapi.responses import Response
from pydantic import BaseModel, Field

from cnctwin.api.answers import Answer, Problem, ValueObject
from cnctwin.api.errors import ApiError
from cnctwin.api.routes.plant import UNKNOWN, Machine, known_state
from cnctwin.api.sources import Sources
from twin.vocabulary.twin_signals import (
    GAP_BASIS,
    GAP_GROWING,
    GAP_GROWING_SIGNAL,
    GAP_LEFT_OUT_PCT,
    GAP_NOTES,
    GAP_PREFIX,
    GAP_WINDOW,
)

DIAGNOSE = "cnctwin gap diagnose CASE --out"
FILE_BYTES_MAX = 20_000_000
REPORT_POLICY = (
    "default-src 'none'; style-src 'unsafe-inline'; script-src 'unsafe-inline'; img-src data:; font-src data:; "
    "base-uri 'none'; form-action 'none'; frame-ancestors 'self'; sandbox allow-scripts allow-popups allow-downloads"
)
_NAME = re.compile(r"[\w][\w .+@-]{0,199}")


class Standing(BaseModel):
    """The standing gap of a signal, over all regimes (null) or in one."""

    signal: str
    regime: str | None
    gap: ValueObject
    mean: ValueObject | None = None


class Gap(Answer):
    """The gap of a machine. `gap` values are in floors: rms of twin minus measured over what repeats."""

    machine: str
    now: int
    standing: list[Standing]
    growing: ValueObject | None
    growing_signal: ValueObject | None
    window: dict[str, int] | None = Field(description="from and to of the recorded stretch to diagnose, ms since 1970")
    left_out_pct: ValueObject | None
    basis: str | None
    diagnosis: dict[str, Any] | None
    diagnosis_reason: str | None
    diagnosis_do: str | None = Field(default=None, description="command that makes the missing diagnosis")
    report: str | None


def gap_routes(sources: Sources) -> APIRouter:
    """The routes."""
    router = APIRouter(tags=["gap"])

    @router.get("/gap/{machine}", response_model=Gap, response_model_exclude_unset=True, responses=UNKNOWN)
    async def gap(machine: Machine) -> Any:
        """The standing gap by signal and regime, its growth, and the diagnosis where one lies in the folder."""
        state = known_state(sources.live, machine)
        found = await sources.store.work(lambda: diagnosis_of(sources.diagnoses, machine))
        diagnosis, reason, report = found
        return {
            **standing(state),
            "diagnosis": diagnosis,
            "diagnosis_reason": reason,
            "diagnosis_do": None if diagnosis else making(sources.diagnoses, machine),
            "report": f"gap/{machine}/report" if report else None,
        }

    refusals: dict[int | str, dict[str, Any]] = {200: {"content": {"text/html": {}}}, 404: {"model": Problem}}

    @router.get("/gap/{machine}/report", responses=refusals, response_class=Response)
    async def report(machine: Machine) -> Response:
        """The report as a page of its own. It may not load anything, nor ask this server for anything."""
        folder = folder_of(sources.diagnoses, machine)
        text = await sources.store.work(lambda: _read(folder, "report.html"))
        if text is None:
            do = making(sources.diagnoses, machine) or f"{DIAGNOSE} DIR/{shlex.quote(machine[:80])}"
            raise ApiError(404, f"machine {machine[:80]!r} has no report; {do}")
        headers = {"Content-Security-Policy": REPORT_POLICY, "X-Frame-Options": "SAMEORIGIN", "Cache-Control": "no-cache"}
        return Response(text, media_type="text/html; charset=utf-8", headers=headers)

    return router


def standing(state: dict[str, Any]) -> dict[str, Any]:
    """Return the gap processor's figures of a machine, sorted out of its state.

    >>> value = {"value": 1.5, "t": 0, "quality": "good", "provenance": "inferred"}
    >>> found = standing({"machine": "vmc", "now": 0, "twin": {"twin/gap_spindle_load_pct/air": value}})
    >>> found["standing"][0]["signal"], found["standing"][0]["regime"]
    ('spindle_load_pct', 'air')
    """
    twin = state["twin"]
    rows = []
    for name, value in twin.items():
        if not name.startswith(GAP_PREFIX) or name in GAP_NOTES or name.endswith("/mean") or _is_of_no_axis(value):
            continue
        signal, _, regime = name.removeprefix(GAP_PREFIX).partition("/")
        mean = twin.get(f"{GAP_PREFIX}{signal}/mean")
        rows.append({"signal": signal, "regime": regime or None, "gap": value, "mean": None if regime else mean})
    basis = twin.get(GAP_BASIS)
    return {
        "machine": state["machine"],
        "now": state["now"],
        "standing": rows,
        "growing": twin.get(GAP_GROWING),
        "growing_signal": twin.get(GAP_GROWING_SIGNAL),
        "window": _window(twin.get(GAP_WINDOW)),
        "left_out_pct": twin.get(GAP_LEFT_OUT_PCT),
        "basis": None if basis is None else basis["value"],
    }


def making(folder: Path | None, machine: str) -> str | None:
    """Return the command whose diagnosis of a machine this server shows; None where it has no place for one."""
    try:
        return f"{DIAGNOSE} {shlex.quote(str(folder_of(folder, machine)))}"
    except ApiError:
        return None


def diagnosis_of(folder: Path | None, machine: str) -> tuple[dict[str, Any] | None, str | None, bool]:
    """The diagnosis of a machine, else why there is none; and whether there is a report."""
    try:
        own = folder_of(folder, machine)
    except ApiError as error:
        return None, str(error), False
    has_report = (own / "report.html").is_file()
    text = _read(own, "diagnosis.json")
    if text is None:
        return None, f"no diagnosis of {machine} yet; {DIAGNOSE} {shlex.quote(str(own))}", has_report
    try:
        found = json.loads(text)
    except (ValueError, RecursionError) as error:
        return None, f"{own / 'diagnosis.json'} cannot be read: {error}; diagnose again", has_report
    if not isinstance(found, dict):
        return None, f"{own / 'diagnosis.json'} holds no diagnosis; diagnose again", has_report
    return found, None, has_report


def folder_of(folder: Path | None, machine: str) -> Path:
    """The folder of a machine's diagnosis, which lies in the folder of all and nowhere else. Raises ApiError."""
    if folder is None:
        raise ApiError(404, "no folder of diagnoses was named; give `cnctwin serve --diagnoses DIR`")
    if not _NAME.fullmatch(machine) or not (folder / machine).resolve().is_relative_to(folder.resolve()):
        raise ApiError(404, f"machine {machine[:80]!r} has a name that no folder can have; its diagnosis cannot be shown")
    return folder / machine


def _is_of_no_axis(value: dict[str, Any]) -> bool:
    """Return True if a figure is null because the machine has no such signal: most machines have no axis a, b or c."""
    return value["value"] is None and str(value.get("reason", "")).endswith("is not offered")


def _read(folder: Path, name: str) -> str | None:
    path = folder / name
    try:
        if path.stat().st_size > FILE_BYTES_MAX or not path.resolve().is_relative_to(folder.resolve()):
            return None
        return path.read_text(encoding="utf-8")
    except (OSError, UnicodeDecodeError):
        return None


def _window(told: dict[str, Any] | None) -> dict[str, int] | None:
    """`start/end` as two times; None where there is none."""
    text = told["value"] if told is not None else None
    if not isinstance(text, str) or "/" not in text:
        return None
    try:
        start, end = (round(datetime.fromisoformat(part).timestamp() * 1000) for part in text.split("/", 1))
    except ValueError:
        return None
    return {"from": start, "to": end}
