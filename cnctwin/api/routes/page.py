"""The page, its log-in, and a list of the routes that needs no network: the usual one loads its parts from elsewhere."""

import asyncio
import html
import time
from typing import Any

from fastapi import APIRouter, FastAPI, Request
from fastapi.responses import HTMLResponse, Response
from pydantic import BaseModel, ConfigDict, Field
from starlette.staticfiles import StaticFiles

from cnctwin.api.access import COOKIE, SESSION_S, Access
from cnctwin.api.answers import Problem
from cnctwin.api.errors import ApiError
from cnctwin.api.failures import DELAY_S, Failures
from cnctwin.api.guard import too_many
from cnctwin.page import WEB

FRESH = "no-cache"  # kept, but asked for each time whether it is still so
_HEAD = '<!doctype html><html lang="en"><head><meta charset="utf-8"><title>cnctwin: routes</title></head><body>'


class Token(BaseModel):
    """The token of this server."""

    model_config = ConfigDict(extra="forbid", hide_input_in_errors=True)
    token: str = Field(max_length=1000, repr=False)


class PageFiles(StaticFiles):
    """The page's files; a browser asks each time whether they have changed."""

    def file_response(self, *arguments: Any, **options: Any) -> Response:
        """A file, or that it has not changed."""
        response = super().file_response(*arguments, **options)
        response.headers["Cache-Control"] = FRESH
        return response


def page_routes(access: Access, failures: Failures) -> APIRouter:
    """Log-in and log-out."""
    router = APIRouter(tags=["page"])

    @router.post("/login", status_code=204, responses={401: {"model": Problem}, 429: {"model": Problem}})
    async def login(body: Token, request: Request) -> Response:
        """Give the token once; the answer sets a cookie that no script can read, for twelve hours."""
        if not access.has_tokens:
            raise ApiError(404, "this server has no token; no login is needed")
        user = access.bearer(body.token)
        if user is None:
            if wait_s := failures.add(request.state.client, time.monotonic()):
                await asyncio.sleep(DELAY_S)
                raise ApiError(429, *too_many(request.state.client, wait_s))
            raise ApiError(401, "that is not the token of this server")
        request.state.user, request.state.role = user.name or None, user.role
        response = Response(status_code=204)
        secure = _is_secure(request, access, request.client.host if request.client else "")
        value = access.session(time.time(), user)
        response.set_cookie(COOKIE, value, max_age=SESSION_S, httponly=True, samesite="strict", secure=secure, path="/")
        return response

    @router.post("/logout", status_code=204)
    async def logout() -> Response:
        """Forget the cookie."""
        response = Response(status_code=204)
        response.delete_cookie(COOKIE, httponly=True, samesite="strict", path="/")
        return response

    return router


def serve_page(app: FastAPI) -> None:
    """The page at /, its files under /page/, the list of routes at /routes."""
    files = PageFiles(directory=WEB, check_dir=False)

    @app.get("/", include_in_schema=False)
    async def index(request: Request) -> Response:
        return await files.get_response("index.html", request.scope)

    @app.get("/routes", include_in_schema=False)
    async def routes() -> HTMLResponse:
        return HTMLResponse(routes_page(app.openapi()))

    app.mount("/page", files, name="page")


def routes_page(document: dict[str, Any]) -> str:
    """The OpenAPI document as a plain page."""
    parts = [f"{_HEAD}<h1>{html.escape(document['info']['title'])}</h1><p>{html.escape(document['info']['description'])}</p>"]
    parts.append('<p>For programs: <a href="openapi.json">openapi.json</a></p>')
    for path, methods in document["paths"].items():
        for method, route in methods.items():
            parts.append(f"<h2>{method.upper()} {html.escape(path)}</h2><p>{html.escape(route.get('description', ''))}</p><ul>")
            for one in route.get("parameters", ()):
                need = "" if one.get("required") else " (may be left out)"
                about = one.get("description", "") or one.get("schema", {}).get("description", "")
                parts.append(f"<li><code>{html.escape(one['name'])}</code>{need} {html.escape(about)}</li>")
            parts.append("</ul>")
    return "".join(parts) + "</body></html>"


def _is_secure(request: Request, access: Access, peer: str) -> bool:
    return request.url.scheme == "https" or (
        access.is_proxy(peer) and request.headers.get("x-forwarded-proto", "").lower() == "https"
    )
