"""The guard before every route: who may ask, and the headers that tell a browser what a page of ours may do."""

import time
from http.cookies import CookieError, SimpleCookie

from starlette.datastructures import Headers, MutableHeaders
from starlette.exceptions import HTTPException
from starlette.types import ASGIApp, Message, Receive, Scope, Send

from cnctwin.api.access import COOKIE, Access, Asking
from cnctwin.api.errors import error_response
from cnctwin.api.failures import Failures
from cnctwin.api.security_headers import HEADERS

BODY_BYTES_MAX = 8_000_000
TOO_LONG = f"the body is longer than the {BODY_BYTES_MAX} bytes that are taken; ask in parts"


class Guard:
    """ASGI middleware. What it lets pass finds the proxy's user, where there is one, in `scope["state"]["user"]`."""

    def __init__(self, app: ASGIApp, access: Access, failures: Failures) -> None:
        self._app, self._access, self._failures = app, access, failures

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Judge a request, then pass it on or refuse it."""
        if scope["type"] != "http":
            if scope["type"] == "lifespan":
                await self._app(scope, receive, send)
            return  # there are no web sockets

        async def with_headers(message: Message) -> None:
            if message["type"] == "http.response.start":
                headers = MutableHeaders(scope=message)
                for name, value in HEADERS.items():
                    headers.setdefault(name, value)
            await send(message)

        asking = _asking(scope)
        wait_s = 0.0
        if "authorization" in asking.headers or asking.path == "/login":
            wait_s = self._failures.wait_s(asking.peer, time.monotonic())
        if (wait_s > 0.0 and asking.method != "GET") or (wait_s > 0.0 and "authorization" in asking.headers):
            line = f"too many wrong tokens from {asking.peer}; wait {wait_s:.0f} s"
            await error_response(429, line, {"Retry-After": f"{wait_s:.0f}"})(scope, receive, with_headers)
            return
        length = asking.headers.get("content-length", "0")
        if not length.isascii() or not length.isdigit() or int(length[:20]) > BODY_BYTES_MAX:
            await error_response(413, TOO_LONG)(scope, receive, with_headers)
            return
        verdict = self._access.judge(asking, time.time())
        if verdict.is_wrong_token:
            self._failures.add(asking.peer, time.monotonic())
        if verdict.status:
            challenge = {"WWW-Authenticate": "Bearer"} if verdict.status == 401 else None
            await error_response(verdict.status, verdict.line, challenge)(scope, receive, with_headers)
            return
        scope.setdefault("state", {})["user"] = verdict.user
        await self._app(scope, _counted(receive), with_headers)


def _counted(receive: Receive) -> Receive:
    """The body with its limit, also of one that does not say its length."""
    taken = 0

    async def counted() -> Message:
        nonlocal taken
        message = await receive()
        taken += len(message.get("body", b""))
        if taken > BODY_BYTES_MAX:
            raise HTTPException(413, TOO_LONG)
        return message

    return counted


def _asking(scope: Scope) -> Asking:
    headers = Headers(scope=scope)
    peer = scope["client"][0] if scope.get("client") else ""
    named = {name: headers[name] for name in headers}
    return Asking(
        scope["method"], scope["path"], peer, scope.get("scheme", "http"), named, _session_cookie(headers.get("cookie"))
    )


def _session_cookie(header: str | None) -> str | None:
    if header is None:
        return None
    try:
        found = SimpleCookie(header).get(COOKIE)
    except CookieError:
        return None
    return None if found is None else found.value
