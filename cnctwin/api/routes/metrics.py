"""GET /metrics: the whole plant for Prometheus, from what the nodes publish of themselves."""

from fastapi import APIRouter
from fastapi.responses import Response

from cnctwin.api.errors import ApiError
from cnctwin.api.i3x.subscriptions import Subscriptions
from cnctwin.api.live.fan_out import FanOut
from cnctwin.api.prometheus.text import PlantCollector, Served, text
from cnctwin.api.sources import Sources
from cnctwin.errors import ApplicationError
from cnctwin.memory.store.contract import Status
from sparkplug.clock import now_ms

MEDIA_TYPE = "text/plain; version=0.0.4; charset=utf-8"


def metrics_routes(sources: Sources, fan_out: FanOut, subscriptions: Subscriptions) -> APIRouter:
    """The route."""
    router = APIRouter(tags=["health"])

    @router.get("/metrics", response_class=Response, responses={200: {"content": {"text/plain": {}}}})
    async def metrics() -> Response:
        """Prometheus text: ages, ledgers, health, alerts, gates, store, and this server's own streams."""
        status: Status | None = None
        if sources.store.configured:
            try:
                status = await sources.store.status()
            except (ApiError, ApplicationError):
                status = None
        served = Served(len(fan_out), fan_out.dropped, len(subscriptions), subscriptions.dropped)
        collector = PlantCollector(sources, status, served, now_ms())
        return Response(await sources.store.work(lambda: text(collector)), media_type=MEDIA_TYPE)

    return router
