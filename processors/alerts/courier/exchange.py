"""One HTTP request, within limits of time and size, and what its end says about whether it was taken.

A connection is made for each: one that lay idle may be closed by the server just when a notification goes into it, and then
nobody knows whether it arrived. Redirects are not followed: a secret goes nowhere but to the address that was configured. The
whole exchange has one deadline, and nothing that comes back is decoded: an answer that is compressed, which nobody asked for, is
judged by its status and left unread.
"""

import asyncio
import logging
import socket
import ssl
from collections.abc import Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass
from functools import lru_cache
from typing import Any
from urllib.parse import urlsplit

import httpx

from processors.alerts.courier.outcome import Outcome, Verdict
from processors.alerts.courier.secret import redacted
from processors.alerts.receivers import LOOPBACK

ANSWER_BYTES_MAX = 64 * 1024
CONNECT_S_MAX = 5.0
AFTER_S_MAX = 300.0
for _chatty in ("httpx", "httpcore"):  # they log whole addresses, and a token may be in one
    logging.getLogger(_chatty).setLevel(logging.WARNING)


@dataclass(frozen=True, slots=True)
class Request:
    """A request to be sent; `secrets` are kept out of every reason."""

    method: str
    url: str
    headers: Mapping[str, str]
    json: Any = None
    content: bytes | None = None
    form: Mapping[str, str] | None = None
    query: Mapping[str, str | list[str]] | None = None
    secrets: Sequence[str] = ()
    authorities: ssl.SSLContext | None = None  # None: those of the system

    @property
    def host(self) -> str:
        """The host it goes to, for people to read."""
        return urlsplit(self.url).hostname or "?"

    @property
    def place(self) -> str:
        """The host with its port, where the address has one, for people to read."""
        try:
            port = urlsplit(self.url).port
        except ValueError:
            port = None
        return self.host if port is None else f"{self.host}:{port}"


class Answer:
    """An answer. `body` is cut at the most bytes, or where the connection ended, and empty where it is compressed; then `wrong`
    says so."""

    __slots__ = ("body", "headers", "status", "wrong")

    def __init__(self, status: int, headers: Mapping[str, str], body: bytes, wrong: str = "") -> None:
        self.status, self.headers, self.body, self.wrong = status, headers, body, wrong


def exchanged(request: Request, timeout_s: float, bytes_max: int = ANSWER_BYTES_MAX) -> Answer | Outcome:
    """The answer, or the outcome where there is none."""
    return asyncio.run(_limited(request, timeout_s, bytes_max))


def judged(answer: Answer, request: Request) -> Outcome:
    """Return the outcome of a status: 2xx taken; 429 and 5xx surely not taken, but for 504, where a gateway has passed it on."""
    status = answer.status
    if 200 <= status < 300:
        return Outcome(Verdict.DELIVERED)
    reason = f"{request.host} answered {status}"
    if status == 504:
        return Outcome(Verdict.UNSURE, f"{reason}: a gateway had no answer; it may have arrived")
    if status == 429 or status >= 500:
        return Outcome(Verdict.NOT_TAKEN, reason, _after_s(answer.headers.get("retry-after", "")))
    return Outcome(Verdict.REFUSED, reason)


def _after_s(text: str) -> float | None:
    """The Retry-After header in seconds; a date is not worth reading.

    >>> _after_s("30"), _after_s("Wed, 21 Oct 2026 07:28:00 GMT"), _after_s("1e9")
    (30.0, None, None)
    """
    return min(float(text), AFTER_S_MAX) if text.isascii() and text.isdigit() else None


@lru_cache(maxsize=1)
def _authorities() -> ssl.SSLContext:
    """Whom to trust; read once, since that takes longer than a request."""
    return httpx.create_ssl_context()


async def _limited(request: Request, timeout_s: float, bytes_max: int) -> Answer | Outcome:
    begun: list[str] = []
    try:
        async with asyncio.timeout(timeout_s + CONNECT_S_MAX):
            return await _exchange(request, timeout_s, bytes_max, begun)
    except TimeoutError:
        return _without_answer(request, f"no answer within {timeout_s:g} s", begun)
    except httpx.TimeoutException as error:
        return _without_answer(request, f"{type(error).__name__} after {timeout_s:g} s", begun)
    except (httpx.HTTPError, httpx.InvalidURL, OSError) as error:
        return _without_answer(request, _in_words(error), begun)


def _in_words(error: BaseException) -> str:
    """Return why there is no connection, as the system has it; else the error's own name and text.

    >>> _in_words(ConnectionRefusedError(111, "Connection refused")), _in_words(ValueError("odd"))
    ('connection refused', 'ValueError: odd')
    """
    cause: BaseException | None = error
    while cause is not None:
        inner = cause.exceptions if isinstance(cause, BaseExceptionGroup) else (cause,)
        for one in inner:
            if isinstance(one, ConnectionRefusedError):
                return "connection refused"
            if isinstance(one, socket.gaierror):
                return "there is no host of this name, or it cannot be looked up now"
        cause = inner[0].__cause__ or inner[0].__context__
    return f"{type(error).__name__}: {error}"


def _without_answer(request: Request, error: str, begun: list[str]) -> Outcome:
    reason = redacted(f"{request.place}: {error}", [request.url, *request.secrets])
    if begun:
        return Outcome(Verdict.UNSURE, f"{reason}; it may have arrived")
    return Outcome(Verdict.NOT_TAKEN, reason)


async def _exchange(request: Request, timeout_s: float, bytes_max: int, begun: list[str]) -> Answer:
    async def watch(event: str, _: Any) -> None:
        if event.endswith("send_request_headers.started"):
            begun.append(event)

    limits = httpx.Timeout(timeout_s, connect=min(timeout_s, CONNECT_S_MAX))
    # The proxies of the environment are for what is outside; nothing of this computer goes through them.
    is_outside = request.host not in LOOPBACK
    async with (
        httpx.AsyncClient(
            timeout=limits, follow_redirects=False, trust_env=is_outside, verify=request.authorities or _authorities()
        ) as client,
        client.stream(
            request.method,
            request.url,
            headers={"Accept-Encoding": "identity", **request.headers},
            json=request.json,
            content=request.content,
            data=None if request.form is None else dict(request.form),
            params=None if request.query is None else dict(request.query),
            extensions={"trace": watch},
        ) as response,
    ):
        encoding = response.headers.get("content-encoding", "identity").strip().lower()
        if encoding != "identity":
            return Answer(
                response.status_code, response.headers, b"", f"is compressed ({encoding[:40]!r}), which was not asked for"
            )
        body, wrong = bytearray(), "did not come to its end in time"
        with suppress(httpx.HTTPError, TimeoutError, asyncio.CancelledError):  # the status has come, and says it
            async for piece in response.aiter_raw():
                body += piece
                if len(body) > bytes_max:
                    break
            wrong = f"is longer than {bytes_max} bytes" if len(body) > bytes_max else ""
        return Answer(response.status_code, response.headers, bytes(body[:bytes_max]), wrong)
