"""The guard before every route: who may ask, how much at once, what is noted, and the headers that every answer has."""

import asyncio
import json
import time
from collections import Counter
from http.cookies import CookieError, SimpleCookie
from typing import Any

from starlette.datastructures import Headers, MutableHeaders
from starlette.types import ASGIApp, Message, Receive, Scope, Send

from cnctwin.api.access import COOKIE, Access, Asking, Verdict
from cnctwin.api.door.audit import DONE, AuditLog, Deed
from cnctwin.api.door.body import counted, is_too_long, too_long
from cnctwin.api.door.role import Right, Role, right_of
from cnctwin.api.errors import error_response
from cnctwin.api.failures import DELAY_S, Failures
from cnctwin.api.security_headers import HEADERS

UNDER_WAY_MAX = 64  # of one client; its streams are among them
ANYBODY = "anybody"
_REFUSED = 400


class Guard:
    """ASGI middleware. What it lets pass finds `user`, `role` and `client` in `scope["state"]`."""

    def __init__(self, app: ASGIApp, access: Access, failures: Failures, audit: AuditLog) -> None:
        self._app, self._access, self._failures, self._audit = app, access, failures, audit
        self._under_way: Counter[str] = Counter()

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Judge a request, then pass it on or refuse it."""
        if scope["type"] != "http":
            if scope["type"] == "lifespan":
                await self._app(scope, receive, send)
            return  # there are no web sockets
        asking = _asking(scope)
        answer = _Answer(send)
        client = self._access.client(asking)
        right = right_of(asking.method, asking.path)
        if self._under_way[client] >= UNDER_WAY_MAX:
            line = f"{client} has {UNDER_WAY_MAX} requests under way, which is the limit; wait for their answers"
            await error_response(503, line, {"Retry-After": "2"}, path=asking.path)(scope, receive, answer.send)
            return
        state: dict[str, Any] = scope.setdefault("state", {})
        state |= {"client": client, "user": None, "role": None}
        self._under_way[client] += 1
        try:
            if is_too_long(asking.path, asking.headers.get("content-length", "0")):
                await error_response(413, too_long(asking.path), path=asking.path)(scope, receive, answer.send)
            else:
                verdict = self._access.judge(asking, time.time())
                state |= {"user": verdict.user, "role": verdict.role}
                if verdict.status:
                    await self._refuse(verdict, client, scope, receive, answer)
                else:
                    await self._app(scope, counted(receive, asking.path), answer.send)
                if verdict.is_wrong_token:
                    right = Right(Role.READER, "give token", asking.path)
        finally:
            self._under_way[client] -= 1
            if not self._under_way[client]:
                del self._under_way[client]
            if right.action:
                self._note(right, state, answer)

    async def _refuse(self, verdict: Verdict, client: str, scope: Scope, receive: Receive, answer: "_Answer") -> None:
        status, line, headers = verdict.status, verdict.line, {"WWW-Authenticate": "Bearer"} if verdict.status == 401 else {}
        if verdict.is_wrong_token and (wait_s := self._failures.add(client, time.monotonic())):
            status, line, headers = 429, *too_many(client, wait_s)
            await asyncio.sleep(DELAY_S)
        await error_response(status, line, headers, path=scope["path"])(scope, receive, answer.send)

    def _note(self, right: Right, state: dict[str, Any], answer: "_Answer") -> None:
        role: Role | None = state["role"]
        user = state["user"] or (ANYBODY if role is None else role.title)
        what = str(state.get("object") or right.object)
        title = "" if role is None else role.title
        self._audit.note(Deed(str(user), title, state["client"], right.action, what, answer.outcome), time.time())


class _Answer:
    """An answer on its way, with the headers of all, and what is noted of it."""

    def __init__(self, send: Send) -> None:
        self._send = send
        self._status = 0
        self._line = ""

    @property
    def outcome(self) -> str:
        """`done`, or the refusal with its status."""
        if 0 < self._status < _REFUSED:
            return DONE
        return f"{self._status} {self._line}".rstrip() if self._status else "no answer"

    async def send(self, message: Message) -> None:
        """Send on."""
        if message["type"] == "http.response.start":
            self._status = message["status"]
            headers = MutableHeaders(scope=message)
            for name, value in HEADERS.items():
                headers.setdefault(name, value)
        elif self._status >= _REFUSED and not self._line:
            self._line = _error(message.get("body", b""))
        await self._send(message)


def too_many(client: str, wait_s: float) -> tuple[str, dict[str, str]]:
    """Return the line and the headers of the answer to who has guessed too often."""
    return f"too many wrong tokens from {client}; wait {wait_s:.0f} s", {"Retry-After": f"{max(wait_s, 1.0):.0f}"}


def _error(body: bytes) -> str:
    try:
        said = json.loads(body)
        return str(said["error"] if "error" in said else said["responseDetail"]["detail"])
    except (ValueError, KeyError, TypeError):
        return ""


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
