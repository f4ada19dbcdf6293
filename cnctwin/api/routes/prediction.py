"""POST /predict: temperature and force for a planned course."""

import asyncio
from typing import Any

from fastapi import APIRouter
from fastapi.responses import Response

from cnctwin.api.answers import Problem
from cnctwin.api.errors import ApiError
from cnctwin.api.prediction import Forecast, Plan, forecast, temperatures
from cnctwin.api.sources import Sources

AT_ONCE_MAX = 4


def prediction_routes(sources: Sources) -> APIRouter:
    """The route. It keeps nothing: the same plan has the same answer, after a restart too."""
    router = APIRouter(tags=["twin"])
    refusals: dict[int | str, dict[str, Any]] = {status: {"model": Problem} for status in (400, 503)}
    places = asyncio.Semaphore(AT_ONCE_MAX)

    def answer(plan: Plan) -> bytes:
        of = sources.constants.of(plan.machine)
        physics_c = temperatures(of.thermal.heat, plan)
        corrected, residual = sources.models.corrected(of, plan, physics_c)
        return forecast(of, plan, physics_c, corrected, residual)

    @router.post("/predict", response_model=Forecast, responses=refusals)
    async def predict(plan: Plan) -> Response:
        """The spindle's temperature and the cutting force for a course of ambient, load and speed.

        With the physics of the machine's live description, else of the configuration or the defaults; `basis` says which.
        """
        if places.locked():
            raise ApiError(503, f"{AT_ONCE_MAX} predictions are being made; ask again in a moment", {"Retry-After": "1"})
        async with places:
            return Response(await asyncio.to_thread(answer, plan), media_type="application/json")

    return router
