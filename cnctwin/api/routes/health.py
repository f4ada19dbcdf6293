"""GET /health, /livez, /readyz: which part is missing, and what to do about it."""

import time
from typing import Any

from fastapi import APIRouter
from fastapi.responses import JSONResponse, Response

from cnctwin.api.answers import Health, Part, Ready
from cnctwin.api.errors import ApiError
from cnctwin.api.live.plant import LivePlant
from cnctwin.api.residual import models_part
from cnctwin.api.routes.alerts import alerts_trouble
from cnctwin.api.sources import Sources
from cnctwin.errors import ApplicationError
from cnctwin.jobs.client import FRESH_S_MAX as JOBS_FRESH_S_MAX
from cnctwin.page import WEB
from cnctwin.plant.doctor import COME_AND_GO
from cnctwin.plant.quarantine import SHOWN_MAX, refused_lines
from cnctwin.processes import published_state
from sparkplug.clock import now_ms
from twin.vocabulary.nodes import JOBS_NODE, TWIN_NODE_PREFIX, is_twin_node


def health_routes(sources: Sources) -> APIRouter:
    """The routes."""
    router = APIRouter(tags=["health"])

    @router.get("/livez")
    async def livez() -> dict[str, bool]:
        """The process answers."""
        return {"alive": True}

    @router.get("/readyz", response_model=Ready)
    async def readyz() -> Response:
        """It can serve: green without models, store or broker, which are degradations; /health says which are missing."""
        if sources.viewer is not None and not sources.viewer.alive:
            return JSONResponse(
                {"ready": False, "error": "the thread that listens to the broker has ended; restart the server"}, 503
            )
        return JSONResponse({"ready": True})

    @router.get("/health", response_model=Health)
    async def health() -> Any:
        """Each part with its state, the reason and what to do; 200 also where some are missing."""
        parts = [
            _broker(sources),
            _plant(sources.live),
            _processors(sources.live),
            _refused(sources.live),
            _input(sources.live),
            await _store(sources),
            _constants(sources),
        ]
        parts += [await sources.store.work(lambda: models_part(sources.models))]
        parts += [_alerts(sources.live), _jobs(sources), _diagnoses(sources), _audit(sources), _page()]
        degraded = any(part.state in ("degraded", "missing") for part in parts)
        return Health(status="degraded" if degraded else "ok", now=now_ms(), parts=parts)

    return router


def _broker(sources: Sources) -> Part:
    viewer = sources.viewer
    if viewer is None:
        return Part(part="broker", state="off", reason="no broker is listened to")
    if not viewer.online:
        return Part(part="broker", state="missing", reason=viewer.trouble, do="start the broker, or name it with --broker")
    lost = viewer.counts()["dropped"]
    if lost:
        return Part(
            part="broker", state="degraded", reason=f"{lost} messages came too fast to be read", do="give it more processor"
        )
    return Part(part="broker", state="ok", reason=f"{viewer.url}, group {viewer.group}")


def _input(live: LivePlant) -> Part:
    """Return the part on what came from the broker and could not be taken over."""
    counts = live.counts
    words = {"readings_refused": "readings", "documents_refused": "documents", "failures": "messages"}
    kept_out = ", ".join(f"{counts[name]} {word}" for name, word in words.items() if counts[name])
    if not kept_out:
        return Part(part="input", state="ok")
    newest = f"; the newest: {live.refused}" if live.refused else ""
    return Part(part="input", state="degraded", reason=f"{kept_out} kept out{newest}", do="look at who sends it")


def _processors(live: LivePlant) -> Part:
    """Those that were heard of since the server began; one that ends in its own time, as a nightly check, is not missed."""
    others = (*COME_AND_GO, JOBS_NODE)
    known = [view for view in live.nodes() if is_twin_node(view.node) and view.node not in others]
    if not known:
        return Part(part="processors", state="missing", reason="no processor was heard of", do="cnctwin process NAME…")
    dead = [view.node.removeprefix(TWIN_NODE_PREFIX) for view in known if not view.online]
    if dead:
        line = f"{len(dead)} of {len(known)} are offline: {', '.join(dead)}; what they said last is not live"
        return Part(part="processors", state="degraded", reason=line, do=f"cnctwin process {' '.join(dead)}")
    if (behind := live.notices().behind) is not None:
        return Part(part="processors", state="degraded", reason=behind, do="cnctwin plan fleet")
    return Part(part="processors", state="ok", reason=f"{len(known)} online")


def _refused(live: LivePlant) -> Part:
    """Return the part on what is not let in."""
    own = [(view.node, view.values) for view in live.nodes() if view.online and is_twin_node(view.node)]
    lines = refused_lines((), own)
    if not lines:
        return Part(part="admission", state="ok", reason="nothing is refused")
    line = "; ".join(lines[:SHOWN_MAX]) + (f"; and {len(lines) - SHOWN_MAX} more" if len(lines) > SHOWN_MAX else "")
    return Part(part="admission", state="degraded", reason=line, do="correct what these edges send, or raise [limits]")


def _plant(live: LivePlant) -> Part:
    fleet = live.fleet()
    if not fleet:
        return Part(part="machines", state="missing", reason="no machine was heard of", do="cnctwin edge run CONFIG")
    offline = [item["machine"] for item in fleet if not item["online"]]
    if offline:
        names = ", ".join(offline[:10])
        line = f"{len(offline)} of {len(fleet)} have no connection to their control: {names}"
        return Part(part="machines", state="degraded", reason=line, do="cnctwin doctor")
    return Part(part="machines", state="ok", reason=f"{len(fleet)} online")


async def _store(sources: Sources) -> Part:
    if not sources.store.configured:
        line = "no store: history is that of the last minutes"
        return Part(part="store", state="missing", reason=line, do="cnctwin process historian, and cnctwin serve --store WHERE")
    try:
        status = await sources.store.status()
    except (ApiError, ApplicationError) as error:
        return Part(part="store", state="missing", reason=str(error), do="cnctwin process historian")
    if status.trouble:
        return Part(part="store", state="degraded", reason=status.trouble, do="cnctwin store status")
    left = "" if status.days_left is None else f", {status.days_left:.0f} days of disk left"
    return Part(part="store", state="ok", reason=f"{status.samples} samples, {status.bytes} bytes{left}")


def _constants(sources: Sources) -> Part:
    path = sources.constants.path
    if path is None:
        line = "predictions rest on default constants, which are good for trends only"
        return Part(part="constants", state="degraded", reason=line, do="cnctwin serve --config processors.toml")
    return Part(part="constants", state="ok", reason=str(path))


def _alerts(live: LivePlant) -> Part:
    state = live.alerts()
    if state is None:
        return Part(part="alerts", state="missing", reason="nothing was heard of alerts", do="cnctwin process alerts")
    if (reason := alerts_trouble(live, state)) is not None:
        return Part(part="alerts", state="degraded", reason=reason, do="cnctwin process alerts")
    return Part(part="alerts", state="ok", reason="the processor keeps its state up")


def _jobs(sources: Sources) -> Part:
    """A plant need not have a consumer, so one that was never heard of is not missed."""
    state = None if sources.viewer is None else sources.viewer.jobs.all()
    reason = jobs_trouble(state)
    if state is None:
        return Part(part="jobs", state="off", reason=reason or "", do="cnctwin jobs run")
    if reason is not None or state.get("disk_trouble"):
        return Part(part="jobs", state="degraded", reason=reason or str(state["disk_trouble"]), do="cnctwin jobs run")
    return Part(part="jobs", state="ok", reason=f"{state.get('queued', 0)} wait, {1 if state.get('running') else 0} runs")


def jobs_trouble(state: dict[str, Any] | None) -> str | None:
    """Why the state of jobs cannot be relied on; None where it can."""
    if state is None:
        return "nothing was heard of jobs; does the batch consumer run? (cnctwin jobs run)"
    age_s = published_state.age_s(state, time.time())
    if age_s > JOBS_FRESH_S_MAX:
        return f"the state of jobs is {age_s:.0f} s old: the batch consumer does not run any more (cnctwin jobs run)"
    return None


def _diagnoses(sources: Sources) -> Part:
    folder = sources.diagnoses
    if folder is None:
        return Part(part="diagnoses", state="off", reason="no folder of diagnoses was named", do="cnctwin serve --diagnoses DIR")
    if not folder.is_dir():
        line = f"{folder} is no folder"
        return Part(part="diagnoses", state="missing", reason=line, do="cnctwin gap diagnose CASE --out DIR/<machine>")
    return Part(part="diagnoses", state="ok", reason=str(folder))


def _audit(sources: Sources) -> Part:
    audit = sources.audit
    if audit.trouble:
        return Part(part="audit", state="degraded", reason=audit.trouble, do="cnctwin serve --audit FILE")
    return Part(part="audit", state="ok", reason="in memory only" if audit.file is None else str(audit.file))


def _page() -> Part:
    if not (WEB / "index.html").is_file():
        return Part(
            part="page", state="missing", reason="the page's files are not installed", do="install cnctwin from its wheel"
        )
    return Part(part="page", state="ok")
