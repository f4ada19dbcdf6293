"""GET and POST /jobs, GET /jobs/{id} and its files, POST /jobs/{id}/cancel: what the batch consumer does, and is asked to do.

What is asked for goes over the broker, as from anybody else; the server itself computes nothing.
"""

import asyncio
import json
import time
from pathlib import Path as FilePath
from typing import Annotated, Any
from uuid import uuid4

from fastapi import APIRouter, Path, Request
from fastapi.responses import Response
from pydantic import BaseModel, ConfigDict, Field

from cnctwin.api.answers import Answer, Problem
from cnctwin.api.errors import ApiError
from cnctwin.api.live.documents import JobInShort
from cnctwin.api.live.jobs import LiveJobs
from cnctwin.api.live.viewer import Viewer
from cnctwin.api.routes.gap import REPORT_POLICY
from cnctwin.api.routes.health import jobs_trouble
from cnctwin.api.sources import Sources
from cnctwin.jobs.kinds import KINDS
from cnctwin.jobs.request import RequestError, is_id, read_request
from sparkplug.clock import now_ms
from twin.vocabulary.topics import JOB_CANCEL, JOB_REQUEST

ANSWER_S_MAX = 8.0
REPEAT_S = 2.0  # nobody is told of a message that the consumer missed; the same id twice is the same job
LOOK_S = 0.05
FILE_BYTES_MAX = 50_000_000
JobId = Annotated[str, Path(description="As GET /jobs has it", max_length=64, examples=["optimise-4f1d2a90c3b7"])]


class JobRequest(BaseModel):
    """A request for a job: its kind and its parameters (docs/how-to/jobs.md). Files lie below the consumer's folder."""

    model_config = ConfigDict(
        extra="allow",
        json_schema_extra={"examples": [{"job": "optimise", "program": "plate.nc", "machine": "vmc.toml", "objective": "time"}]},
    )
    job: str = Field(max_length=40, json_schema_extra={"enum": list(KINDS)})
    id: str | None = Field(None, max_length=64, description="the caller's own, if any; the same id twice is the same job")
    by: str | None = Field(
        None, max_length=100, description="who asks; of a user who is known by name, that name, whatever stands here"
    )


class JobAnswer(Answer):
    """The consumer's answer."""

    id: str = Field(examples=["optimise-4f1d2a90c3b7"])
    answer: str = Field(description="accepted, known (it was asked for before) or cancelled", examples=["accepted"])
    state: str = Field(examples=["queued"])
    place: int | None = Field(None, description="0 = running, 1 = next; null = over")


class JobInFull(JobInShort):
    """With its result: a sentence, figures by kind, and `files`, name → bytes."""

    result: dict[str, Any] = Field(default_factory=dict)


class Jobs(Answer):
    """All jobs in short: running, waiting in their order, then those that are over, newest first."""

    now: int
    available: bool
    reason: str | None
    offers_files: bool = Field(description="whether this server was given the consumer's folder (--jobs)")
    jobs: list[JobInShort]


def job_routes(sources: Sources) -> APIRouter:
    """The routes."""
    router = APIRouter(tags=["jobs"])
    viewer = sources.viewer
    missing: dict[int | str, dict[str, Any]] = {404: {"model": Problem}}
    refusals: dict[int | str, dict[str, Any]] = {status: {"model": Problem} for status in (400, 409, 503, 504)}

    @router.get("/jobs", response_model=Jobs)
    async def jobs() -> Any:
        """All jobs; `available` false, with the reason, where no consumer keeps them up."""
        state = None if viewer is None else viewer.jobs.all()
        reason = jobs_trouble(state)
        known = [] if viewer is None else [_cautioned(viewer, job) for job in (state or {}).get("jobs", [])]
        told = {"available": reason is None, "reason": reason, "offers_files": sources.jobs is not None}
        return {**(state or {}), "jobs": known, "now": now_ms(), **told}

    @router.get("/jobs/{job_id}", response_model=JobInFull, responses=missing)
    async def job(job_id: JobId) -> Any:
        """One job in full."""
        found = _known(viewer, job_id)
        return {**found, "caution": caution_of(found)}

    @router.get("/jobs/{job_id}/files/{name}", responses={200: {"content": {"*/*": {}}}, **missing}, response_class=Response)
    async def file(
        job_id: JobId, name: Annotated[str, Path(description="Of a file of its result", max_length=100, examples=["report.html"])]
    ) -> Response:
        """A file of a result. A report is a page of its own, which may not load anything; the others are to be kept."""
        files = _known(viewer, job_id).get("result", {}).get("files", {})
        if name not in files:
            raise ApiError(404, f"job {job_id} has no file {name[:80]!r}; GET /jobs/{job_id} lists those that it has")
        content = await sources.store.work(lambda: _content(sources.jobs, job_id, name))
        headers = {"Cache-Control": "no-cache"}
        if name.endswith(".html"):
            headers |= {"Content-Security-Policy": REPORT_POLICY, "X-Frame-Options": "SAMEORIGIN"}
            return Response(content, media_type="text/html; charset=utf-8", headers=headers)
        headers["Content-Disposition"] = f'attachment; filename="{job_id}-{name}"'
        return Response(content, media_type="application/octet-stream", headers=headers)

    @router.post("/jobs", response_model=JobAnswer, responses=refusals)
    async def ask(body: JobRequest, request: Request) -> Any:
        """Have something computed. It is accepted when this is answered, and is not lost from then on."""
        document = body.model_dump(exclude_none=True) | _signed(request)
        document.setdefault("id", f"{body.job}-{uuid4().hex[:12]}")
        if "reply_to" in document:
            raise ApiError(400, "reply_to is for requests over the broker; the answer to this one comes here")
        request.state.object = document["id"]
        try:
            read_request(json.dumps(document).encode())
        except RequestError as error:
            raise ApiError(400, str(error)) from None
        return await _answer(viewer, JOB_REQUEST, document)

    @router.post("/jobs/{job_id}/cancel", response_model=JobAnswer, responses={**missing, **refusals})
    async def cancel(job_id: JobId, request: Request) -> Any:
        """Cancel a job that waits or runs."""
        _known(viewer, job_id)
        return await _answer(viewer, JOB_CANCEL, {"id": job_id, **_signed(request)})

    return router


def caution_of(job: dict[str, Any]) -> str:
    """Return in words what the result of a job in full exceeds; such a job is done all the same.

    >>> caution_of({"result": {"lines_over": 2, "collisions": []}})
    '2 lines are above a limit'
    >>> caution_of({"result": {"lines_over": 1, "collisions": [12, 14]}})
    'a rapid goes into material in line 12; 1 line is above a limit'
    """
    result = job.get("result") or {}
    over, collisions = result.get("lines_over"), result.get("collisions")
    said = [f"a rapid goes into material in line {collisions[0]}"] if isinstance(collisions, list) and collisions else []
    if isinstance(over, int) and over:
        said.append(f"{over} line{' is' if over == 1 else 's are'} above a limit")
    return "; ".join(said)


def _cautioned(viewer: Viewer, job: dict[str, Any]) -> dict[str, Any]:
    """A job in short, with what only the one in full tells."""
    return {**job, "caution": caution_of(viewer.jobs.one(str(job.get("id"))) or {})}


def _signed(request: Request) -> dict[str, str]:
    """`by`, where the server knows who asks: then it is that name, whatever the request says."""
    return {"by": request.state.user} if request.state.user else {}


def _known(viewer: Viewer | None, job_id: str) -> dict[str, Any]:
    found = viewer.jobs.one(job_id) if viewer is not None and is_id(job_id) else None
    if found is None:
        raise ApiError(404, f"job {job_id[:80]!r} is not known; GET /jobs lists them")
    return found


async def _answer(viewer: Viewer | None, topic: str, document: dict[str, Any]) -> dict[str, Any]:
    """Ask the consumer, and wait for what it says. Raises ApiError where it refuses, or says nothing."""
    if viewer is None:
        raise ApiError(503, "no broker is listened to; nothing can be asked for")
    jobs: LiveJobs = viewer.jobs
    if (reason := jobs_trouble(jobs.all())) is not None:
        raise ApiError(503, reason)
    if (reply := jobs.await_answer()) is None:
        raise ApiError(503, "too many wait for an answer already; try again")
    payload = json.dumps({**document, "reply_to": reply}).encode()
    try:
        return await _heard(viewer, topic, payload, reply)
    finally:
        jobs.forget(reply)


async def _heard(viewer: Viewer, topic: str, payload: bytes, reply: str) -> dict[str, Any]:
    deadline_s = time.monotonic() + ANSWER_S_MAX
    sent_s = float("-inf")
    while (now_s := time.monotonic()) < deadline_s:
        if now_s - sent_s >= REPEAT_S:
            if not viewer.publish(topic, payload):
                raise ApiError(503, f"{viewer.trouble or 'too much waits for the broker'}; try again")
            sent_s = now_s
        await asyncio.sleep(LOOK_S)
        if (told := viewer.jobs.answer(reply)) is not None:
            if told.get("answer") == "refused":
                raise ApiError(409, str(told.get("reason")))
            return told
    raise ApiError(504, f"no answer within {ANSWER_S_MAX:g} s; GET /jobs says whether it was taken. The same id again is safe")


def _content(folder: FilePath | None, job_id: str, name: str) -> bytes:
    """A file of the consumer's folder, and of nowhere else. Raises ApiError."""
    if folder is None:
        raise ApiError(404, "this server does not see the consumer's folder; give `cnctwin serve --jobs DIR`")
    path = folder / job_id / "result" / name
    try:
        if not path.resolve().is_relative_to((folder / job_id).resolve()) or path.stat().st_size > FILE_BYTES_MAX:
            raise ApiError(404, f"{name} of job {job_id} is not to be had here; look into the consumer's folder")
        return path.read_bytes()
    except OSError as error:
        raise ApiError(404, f"{name} of job {job_id}: {error.strerror}; is --jobs the folder of the consumer?") from None
