"""The application below `/i3x/v1`: its own routes, its own shape of refusals, its own OpenAPI document."""

from fastapi import FastAPI, Request, Response
from fastapi.exceptions import RequestValidationError
from fastapi.responses import JSONResponse
from starlette.exceptions import HTTPException
from starlette.middleware.gzip import GZipMiddleware

from cnctwin.api.errors import ApiError, request_trouble
from cnctwin.api.i3x.explore import SPEC_VERSION, explore_routes
from cnctwin.api.i3x.problem import PREFIX, failure
from cnctwin.api.i3x.query import query_routes
from cnctwin.api.i3x.space import Space
from cnctwin.api.i3x.subscribe import subscribe_routes
from cnctwin.api.i3x.subscriptions import Subscriptions
from cnctwin.api.security_headers import HEADERS
from cnctwin.api.sources import Sources
from cnctwin.errors import ApplicationError

LINE_MAX = 500
DOCUMENT = f"{PREFIX}/openapi.json"


def i3x_application(sources: Sources, subscriptions: Subscriptions) -> FastAPI:
    """The application. `Guard` stands before it, as before all routes."""
    app = FastAPI(
        title="cnctwin over i3X",
        description="CESMII's common interface for industrial information, the reading part (docs/reference/i3x.md).",
        version=SPEC_VERSION,
        docs_url=None,
        redoc_url=None,
        redirect_slashes=False,
    )
    app.add_middleware(GZipMiddleware, minimum_size=0)
    space = Space(sources.live)
    for router in (
        explore_routes(space, sources.store),
        query_routes(space, sources.store),
        subscribe_routes(space, sources.store, subscriptions),
    ):
        app.include_router(router)
    _handle_errors(app)
    return app


def _handle_errors(app: FastAPI) -> None:
    async def refused(_: Request, error: Exception) -> Response:
        assert isinstance(error, ApiError)
        return _refusal(error.status, str(error), error.headers)

    async def trouble(_: Request, error: Exception) -> Response:
        return _refusal(503, str(error))

    async def wrong(_: Request, error: Exception) -> Response:
        assert isinstance(error, RequestValidationError)
        return _refusal(400, request_trouble(error.errors(), DOCUMENT))

    async def http(request: Request, error: Exception) -> Response:
        assert isinstance(error, HTTPException)
        line = f"{request.method} {request.url.path} is nothing here; {DOCUMENT} lists what there is"
        return _refusal(error.status_code, line if error.status_code in (404, 405) else str(error.detail))

    async def bug(_: Request, __: Exception) -> Response:
        return _refusal(500, "the server failed at this; its log says how", HEADERS)

    app.add_exception_handler(ApiError, refused)
    app.add_exception_handler(ApplicationError, trouble)
    app.add_exception_handler(RequestValidationError, wrong)
    app.add_exception_handler(HTTPException, http)
    app.add_exception_handler(Exception, bug)


def _refusal(status: int, line: str, headers: dict[str, str] | None = None) -> Response:
    return JSONResponse(failure(status, " ".join(line.split())[:LINE_MAX]), status, headers)
