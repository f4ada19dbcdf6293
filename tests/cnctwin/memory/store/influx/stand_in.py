"""Servers that answer as they are told: one in memory, and one over HTTP that remembers each request."""

from __future__ import annotations

import gzip
import json
import ssl
import threading
from collections import Counter, deque
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from typing import NamedTuple
from urllib.parse import parse_qs, urlsplit

from cnctwin.memory.store.influx.server import RefusedError, ServerAnswer, ServerAwayError

ANSWERS_MAX = 10_000


class MemoryServer:
    """Keeps lines by bucket; `trouble` says, given the lines of a write, what to raise."""

    def __init__(
        self, trouble: Callable[[list[str]], ServerAnswer | None] = lambda lines: None, *, settle_s: float = 0.0
    ) -> None:
        self.trouble, self.settle_s = trouble, settle_s
        self.kept: Counter[tuple[str, str]] = Counter()
        self.writes: list[int] = []
        self.started = 1

    def write(self, bucket: str, lines: bytes) -> None:
        split = lines.decode().splitlines()
        self.writes.append(len(split))
        if refusal := self.trouble(split):
            raise refusal
        self.kept.update((bucket, line) for line in split)

    def incarnation(self) -> str:
        if isinstance(refusal := self.trouble([]), ServerAwayError):
            raise refusal
        return str(self.started)

    def close(self) -> None:
        """Nothing."""

    def distinct(self) -> int:
        """Lines that are there, as a server with overwriting has them."""
        return len(self.kept)


def refuses(word: str, *, is_sure: bool = True) -> Callable[[list[str]], ServerAnswer | None]:
    """Refuse what holds a line with a word."""

    def judge(lines: list[str]) -> ServerAnswer | None:
        bad = [line for line in lines if word in line]
        return RefusedError(f"400: unable to parse {bad[0]!r}", is_sure=is_sure) if bad else None

    return judge


class Request(NamedTuple):
    """What a client sent."""

    method: str
    path: str
    query: dict[str, list[str]]
    headers: dict[str, str]
    body: bytes


class Answer(NamedTuple):
    """What it is answered."""

    status: int = 204
    body: str = ""
    headers: tuple[tuple[str, str], ...] = ()


class HttpServer:
    """Answers the next of `answers`, when they are used up `standing`."""

    def __init__(self) -> None:
        self.requests: deque[Request] = deque(maxlen=ANSWERS_MAX)
        self.answers: deque[Answer] = deque(maxlen=ANSWERS_MAX)
        self.standing = Answer()
        self.port = 0

    def lines(self) -> list[str]:
        """All lines that were accepted or not, in order."""
        return [line for request in self.requests for line in request.body.decode().splitlines()]

    @contextmanager
    def serving(self, tls: ssl.SSLContext | None = None) -> Iterator[HttpServer]:
        """Serve on a free loopback port."""
        owner = self

        class Handler(BaseHTTPRequestHandler):
            protocol_version = "HTTP/1.1"

            def do_POST(self) -> None:
                body = self.rfile.read(int(self.headers.get("Content-Length") or 0))
                if self.headers.get("Content-Encoding") == "gzip":
                    body = gzip.decompress(body)
                parts = urlsplit(self.path)
                headers = {name.lower(): value for name, value in self.headers.items()}
                owner.requests.append(Request(self.command, parts.path, parse_qs(parts.query), headers, body))
                told = owner.answers.popleft() if owner.answers else owner.standing
                self.send_response(told.status)
                for name, value in told.headers:
                    self.send_header(name, value)
                if told.status != 204:
                    self.send_header("Content-Length", str(len(told.body.encode())))
                self.end_headers()
                if told.status != 204:
                    self.wfile.write(told.body.encode())

            do_GET = do_POST  # noqa: N815

            def log_message(self, format: str, *args: object) -> None:  # noqa: A002
                """Say nothing."""

        with ThreadingHTTPServer(("127.0.0.1", 0), Handler) as server:
            server.daemon_threads = True
            self.port = server.server_address[1]
            if tls is not None:
                server.socket = tls.wrap_socket(server.socket, server_side=True)
            thread = threading.Thread(target=server.serve_forever, args=(0.02,), daemon=True)
            thread.start()
            yield self
            server.shutdown()
            thread.join(5)


def error(status: int, message: str, code: str = "invalid", **headers: str) -> Answer:
    """An error as InfluxDB 2 words it."""
    named = tuple((name.replace("_", "-"), value) for name, value in headers.items())
    return Answer(status, json.dumps({"code": code, "message": message}), named)
