"""Answers of the interface when it cannot do what it is asked: one JSON, `{"error": "<culprit, value, way out>"}`."""

import json
from typing import Any

from fastapi import FastAPI, Request, Response
from fastapi.exceptions import RequestValidationError
from starlette.exceptions import HTTPException

from cnctwin.api.i3x.problem import PREFIX as I3X
from cnctwin.api.i3x.problem import failure
from cnctwin.api.security_headers import HEADERS
from cnctwin.errors import ApplicationError

LINE_MAX = 500


class ApiError(ApplicationError):
    """A refusal with its HTTP status and its one line."""

    def __init__(self, status: int, line: str, headers: dict[str, str] | None = None) -> None:
        super().__init__(line)
        self.status = status
        self.headers = headers or {}


def error_response(status: int, line: str, headers: dict[str, str] | None = None, *, path: str = "") -> Response:
    """The one shape of all errors; below i3X's prefix, the one that i3X has."""
    text = " ".join(line.split())[:LINE_MAX]
    body = failure(status, text) if path.startswith(f"{I3X}/") else {"error": text}
    return Response(json.dumps(body), status, headers, "application/json")


def handle_errors(app: FastAPI) -> None:
    """Have every error of an application come out in that shape; what is wrong with a request is a 400."""

    async def refused(_: Request, error: Exception) -> Response:
        assert isinstance(error, ApiError)
        return error_response(error.status, str(error), error.headers)

    async def trouble(_: Request, error: Exception) -> Response:
        return error_response(503, str(error))

    async def wrong(request: Request, error: Exception) -> Response:
        assert isinstance(error, RequestValidationError)
        if request.url.path == "/login":  # what was given may be the token, in the wrong place
            return error_response(400, 'the body is not {"token": "…"} as JSON')
        return error_response(400, request_trouble(error.errors()))

    async def http(request: Request, error: Exception) -> Response:
        assert isinstance(error, HTTPException)
        lines = {
            404: f"{request.url.path} is nothing here; /openapi.json lists what there is",
            405: f"{request.method} is not for {request.url.path}; /openapi.json says what is",
        }
        return error_response(error.status_code, lines.get(error.status_code, str(error.detail)), dict(error.headers or {}))

    async def bug(_: Request, __: Exception) -> Response:
        return error_response(500, "the server failed at this; its log says how", HEADERS)  # outside the guard

    app.add_exception_handler(ApiError, refused)
    app.add_exception_handler(ApplicationError, trouble)
    app.add_exception_handler(RequestValidationError, wrong)
    app.add_exception_handler(HTTPException, http)
    app.add_exception_handler(Exception, bug)


def request_trouble(errors: Any, document: str = "/openapi.json") -> str:
    """The first thing that is wrong with a request, in one line that names it and its value.

    >>> request_trouble([{"loc": ("body", "dt_s"), "msg": "Input should be greater than 0", "input": -1}])
    'dt_s is -1: Input should be greater than 0; /openapi.json has an example'
    """
    first = errors[0]
    places = [str(part) for part in first["loc"]]
    name = ".".join(places[1:]) or (places[0] if places else "request")
    said = str(first["msg"]).removeprefix("Value error, ")
    value = repr(first.get("input"))
    if first["type"] == "missing" if "type" in first else False:
        return f"{name} is missing; {document} has an example"
    if first.get("type") == "model_attributes_type" and isinstance(first.get("input"), bytes):
        return "the body is not taken as JSON; send Content-Type: application/json"
    shown = value if len(value) <= 60 else f"{value[:57]}…"
    if first.get("type") == "value_error" and len(places) <= 1:
        return said
    return f"{name} is {shown}: {said}; {document} has an example"
