"""A receiver of notifications on loopback that a test tells how to behave: it answers, refuses, is slow or hangs up."""

import json
import socket
import threading
import time
from collections import Counter, deque
from dataclasses import dataclass
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from typing import Any
from urllib.parse import parse_qs, urlsplit


@dataclass(frozen=True)
class Received:
    """One request."""

    method: str
    path: str
    query: dict[str, str]
    headers: dict[str, str]
    body: bytes
    at_s: float

    @property
    def id(self) -> str:
        """The notification that it is."""
        return self.headers.get("x-cnctwin-notification", "")

    @property
    def json(self) -> Any:
        return json.loads(self.body)

    @property
    def form(self) -> dict[str, str]:
        return {name: values[0] for name, values in parse_qs(self.body.decode()).items()}


@dataclass(frozen=True)
class Answer:
    """How to behave: status and body; `wait_s` before, or when `hold` is set; `drop`: take it and close; `drip`: byte by byte."""

    status: int = 200
    body: bytes = b"{}"
    headers: tuple[tuple[str, str], ...] = ()
    wait_s: float = 0.0
    hold: threading.Event | None = None
    drop: bool = False
    drip: bool = False


class ReceivingServer:
    """See the module. `answers` are used up one by one, then `usual`."""

    def __init__(self) -> None:
        self.received: list[Received] = []
        self.answers: deque[Answer] = deque()
        self.usual = Answer()
        self.by_path: dict[str, Answer] = {}
        outer = self

        class Handler(BaseHTTPRequestHandler):
            def log_message(self, *_: Any) -> None:
                pass

            def do_GET(self) -> None:
                outer._answer(self)

            def do_POST(self) -> None:
                outer._answer(self)

        class Server(ThreadingHTTPServer):
            daemon_threads = True

            def handle_error(self, *_: Any) -> None:
                pass  # a client that was killed

        self._server = Server(("127.0.0.1", 0), Handler)
        self.port = int(self._server.server_address[1])
        self._thread = threading.Thread(target=self._server.serve_forever, kwargs={"poll_interval": 0.02})
        self._lock = threading.Lock()

    def __enter__(self) -> "ReceivingServer":
        self._thread.start()
        return self

    def __exit__(self, *_: object) -> None:
        self._server.shutdown()
        self._server.server_close()
        self._thread.join()

    @property
    def url(self) -> str:
        return f"http://127.0.0.1:{self.port}"

    def ids(self) -> Counter[str]:
        """Return how often each notification came."""
        with self._lock:
            return Counter(one.id for one in self.received)

    def _answer(self, handler: BaseHTTPRequestHandler) -> None:
        parts = urlsplit(handler.path)
        body = handler.rfile.read(int(handler.headers.get("content-length") or 0))
        headers = {name.lower(): value for name, value in handler.headers.items()}
        query = {name: values[0] for name, values in parse_qs(parts.query).items()}
        with self._lock:
            self.received.append(Received(handler.command, parts.path, query, headers, body, time.monotonic()))
            answer = self.by_path.get(parts.path) or (self.answers.popleft() if self.answers else self.usual)
        time.sleep(answer.wait_s)
        if answer.hold is not None:
            answer.hold.wait(60)
        if answer.drop:
            handler.connection.shutdown(socket.SHUT_RDWR)
            handler.close_connection = True
            return
        text = f"HTTP/1.1 {answer.status} X\r\nContent-Length: {len(answer.body)}\r\nConnection: close\r\n"
        raw = (text + "".join(f"{name}: {value}\r\n" for name, value in answer.headers) + "\r\n").encode() + answer.body
        handler.close_connection = True
        if not answer.drip:
            handler.wfile.write(raw)
            return
        for byte in raw:
            handler.wfile.write(bytes([byte]))
            time.sleep(0.4)
