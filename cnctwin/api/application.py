"""The application: all routes over what it stands on."""

import asyncio
from collections.abc import AsyncIterator, Sequence
from contextlib import asynccontextmanager
from importlib.metadata import version

from fastapi import FastAPI

from cnctwin.api.errors import handle_errors
from cnctwin.api.failures import Failures
from cnctwin.api.guard import Guard
from cnctwin.api.i3x.application import i3x_application
from cnctwin.api.i3x.problem import PREFIX as I3X
from cnctwin.api.i3x.space import Space
from cnctwin.api.i3x.subscriptions import Subscriptions
from cnctwin.api.live.batches import Batch
from cnctwin.api.live.fan_out import FanOut
from cnctwin.api.routes.alerts import alert_routes
from cnctwin.api.routes.anomaly import anomaly_routes
from cnctwin.api.routes.documentation import serve_documentation
from cnctwin.api.routes.figures import figure_routes
from cnctwin.api.routes.gap import gap_routes
from cnctwin.api.routes.health import health_routes
from cnctwin.api.routes.history import history_routes
from cnctwin.api.routes.jobs import job_routes
from cnctwin.api.routes.metrics import metrics_routes
from cnctwin.api.routes.models import models_routes
from cnctwin.api.routes.page import page_routes, serve_page
from cnctwin.api.routes.past import past_routes
from cnctwin.api.routes.people import people_routes
from cnctwin.api.routes.plant import plant_routes
from cnctwin.api.routes.prediction import prediction_routes
from cnctwin.api.routes.sealed import sealed_routes
from cnctwin.api.routes.twin import twin_routes
from cnctwin.api.sources import Sources

ABOUT = "A digital twin of CNC machines: state, predictions, history, gaps, alerts. Times are ms since 1970, UTC."


def create_app(sources: Sources) -> FastAPI:
    """The application. It starts no thread: `cnctwin serve` starts the viewer that feeds `sources.live`."""
    fan_out = FanOut(sources.live)
    subscriptions = Subscriptions(Space(sources.live))

    def tell(batches: Sequence[Batch]) -> None:
        fan_out.send(batches)
        subscriptions.send(batches)

    if sources.viewer is not None:
        sources.viewer.on_batches = tell

    @asynccontextmanager
    async def lifespan(_: FastAPI) -> AsyncIterator[None]:
        for streams in (fan_out, subscriptions):
            streams.attach(asyncio.get_running_loop())
        yield

    app = FastAPI(
        title="cnctwin",
        description=ABOUT,
        version=version("cnctwin"),
        docs_url=None,
        redoc_url=None,
        lifespan=lifespan,
        redirect_slashes=False,
    )
    failures = Failures()
    app.add_middleware(Guard, access=sources.access, failures=failures, audit=sources.audit)
    handle_errors(app)
    for router in (
        health_routes(sources),
        plant_routes(sources.live, fan_out),
        prediction_routes(sources),
        gap_routes(sources),
        twin_routes(sources),
        alert_routes(sources.live, sources.viewer),
        anomaly_routes(sources),
        job_routes(sources),
        history_routes(sources.live, sources.store),
        past_routes(sources),
        figure_routes(sources),
        metrics_routes(sources, fan_out, subscriptions),
        models_routes(sources),
        people_routes(sources.access, sources.audit),
        page_routes(sources.access, failures),
    ):
        app.include_router(router)
    if sources.envelope.is_given:
        app.include_router(sealed_routes(sources.envelope))
    app.mount(I3X, i3x_application(sources, subscriptions))
    serve_page(app)
    serve_documentation(app)
    app.state.fan_out, app.state.sources = fan_out, sources
    app.state.subscriptions, app.state.tell = subscriptions, tell
    return app
