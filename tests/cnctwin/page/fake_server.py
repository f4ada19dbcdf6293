"""A small HTTP server that speaks the interface's JSON and its stream, for a shop that is made up.

It can be stopped and started again on the same port, take machines offline, be told other values, and refuse.
"""

import json
import re
import threading
import time
from collections.abc import Callable, Mapping
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from pathlib import Path
from typing import Any
from urllib.parse import parse_qs, unquote, urlsplit

from cnctwin.page import WEB
from tests.cnctwin.page.simulated_shop import FLEET, SignalValue, fleet_item, row, signals, value_object
from tests.wire.mosquitto import free_port

POLICY = (
    "default-src 'self'; img-src 'self' data:; object-src 'none'; base-uri 'none'; form-action 'self'; frame-ancestors 'none'"
)
TYPES = {".html": "text/html; charset=utf-8", ".js": "text/javascript", ".css": "text/css", ".svg": "image/svg+xml"}
KEYS = {*FLEET.values(), "twin/gap_spindle_temp_c", "twin/gap_spindle_load_pct"}
Answer = tuple[int, Any]
Values = Mapping[str, SignalValue]


def now_ms() -> int:
    return round(time.time() * 1000)


class Shop:
    """The machines, and what is changed of them by a test."""

    def __init__(self, machines: list[str], period_s: float = 0.1) -> None:
        self.numbers = {name: number for number, name in enumerate(machines)}
        self.period_s = period_s
        self.offline_since: dict[str, int] = {}
        self.ahead_ms: dict[str, int] = {}  # by machine: by how much its stamps run ahead, as those of a time lapse
        self.other: dict[str, dict[str, SignalValue]] = {}
        self.without: dict[str, re.Pattern[str]] = {}  # by machine: the signals that it does not have
        self.answers: dict[str, Callable[[str, dict[str, Any] | None], Answer]] = {}
        self.token: str | None = None
        self.me: dict[str, Any] = {"user": None, "role": "administrator", "logs_out": False}
        self.broker = True
        self.behind: str | None = None
        self.described: str | None = None
        self.posted: list[tuple[str, Any]] = []

    def told(self, machine: str, t_ms: int) -> tuple[dict[str, SignalValue], int]:
        """Return what a machine says at a moment, and of when that is."""
        t_ms = min(t_ms, self.offline_since.get(machine, t_ms))
        all_of_it = {**signals(self.numbers[machine], t_ms / 1000.0), **self.other.get(machine, {})}
        without = self.without.get(machine)
        told = {name: one for name, one in all_of_it.items() if without is None or not without.fullmatch(name)}
        return told, t_ms + self.ahead_ms.get(machine, 0)

    def fleet(self) -> dict[str, Any]:
        """As the stream begins."""
        now = now_ms()
        items = [fleet_item(name, *self.told(name, now), online=name not in self.offline_since) for name in self.numbers]
        return {"now": now, "behind": self.behind, "described": self.described, "machines": items}

    def state(self, machine: str) -> dict[str, Any]:
        """All of a machine."""
        now = now_ms()
        told, t_ms = self.told(machine, now)
        online = machine not in self.offline_since
        sides: dict[str, dict[str, Any]] = {"measured": {}, "twin": {}}
        for name, one in told.items():
            said = value_object(one, t_ms)
            sides["twin" if name.startswith("twin/") else "measured"][name] = said if online else {**said, "quality": "stale"}
        notices = {"behind": self.behind, "described": self.described}
        return {"machine": machine, "now": now, "online": online, **notices, **sides}

    def history(self, machine: str, names: list[str], start: int, end: int, every: int) -> dict[str, Any]:
        """Columns, from the same function of time as the stream."""
        end = min(end, now_ms() + self.ahead_ms.get(machine, 0), self.offline_since.get(machine, end))
        times = list(range(start // every * every + every, end, every))
        rows = [self.told(machine, t)[0] for t in times]
        columns = []
        for name in names:
            kept = [(t, told[name]) for t, told in zip(times, rows, strict=True) if name in told]
            values = [one.value for _, one in kept]
            quality, reason = ["bad" if one.reason else "good" for _, one in kept], [one.reason for _, one in kept]
            unit = kept[0][1].unit if kept else None
            columns.append(
                {
                    "signal": name,
                    "unit": unit,
                    "t": [t for t, _ in kept],
                    "value": values,
                    "low": [],
                    "high": [],
                    "quality": quality,
                    "reason": reason,
                }
            )
        return {"machine": machine, "from": start, "to": end, "every_ms": every, "source": "memory", "columns": columns}


class FakeServer:
    """The server, in threads of its own; `stop` ends every stream."""

    def __init__(self, shop: Shop) -> None:
        self.shop = shop
        self.port = free_port()  # of its own, also while it is stopped
        self._stop = threading.Event()
        self._server: ThreadingHTTPServer | None = None
        self._thread: threading.Thread | None = None

    @property
    def url(self) -> str:
        return f"http://127.0.0.1:{self.port}"

    def start(self) -> "FakeServer":
        self._stop = threading.Event()
        shop, stop = self.shop, self._stop

        class Handler(_Handler):
            pass

        Handler.shop, Handler.stop = shop, stop
        ThreadingHTTPServer.allow_reuse_address = True
        self._server = ThreadingHTTPServer(("127.0.0.1", self.port), Handler)
        self._server.daemon_threads = True
        self.port = self._server.server_address[1]
        self._thread = threading.Thread(target=self._server.serve_forever, args=(0.05,), daemon=True)
        self._thread.start()
        return self

    def stop(self) -> None:
        if self._server is None or self._thread is None:
            return
        self._stop.set()
        self._server.shutdown()
        self._server.server_close()
        self._thread.join(5.0)
        self._server = None

    def __enter__(self) -> "FakeServer":
        return self.start()

    def __exit__(self, *_: object) -> None:
        self.stop()


class _Handler(BaseHTTPRequestHandler):
    shop: Shop
    stop: threading.Event
    protocol_version = "HTTP/1.1"
    timeout = 20

    def log_message(self, *_: object) -> None:
        """Quiet."""

    def handle(self) -> None:
        try:
            super().handle()
        except (ConnectionError, TimeoutError):
            self.close_connection = True

    def do_GET(self) -> None:
        if self.stop.is_set():  # a connection that was kept alive is not to outlive the server
            raise ConnectionAbortedError
        url = urlsplit(self.path)
        asked = {name: values[0] for name, values in parse_qs(url.query).items()}
        path = unquote(url.path)
        if path == "/" or path.startswith("/page/"):
            self._file(WEB / ("index.html" if path == "/" else path.removeprefix("/page/")))
        elif (
            self.shop.token
            and f"session={self.shop.token}" not in self.headers.get("Cookie", "")
            and path not in ("/livez", "/readyz")
        ):
            self._json(401, {"error": "log in first"})
        elif path == "/stream":
            self._stream(asked.get("machine"))
        else:
            self._json(*self._asked(path, asked))

    def do_POST(self) -> None:
        body = json.loads(self.rfile.read(int(self.headers.get("Content-Length", 0))) or b"null")
        path = unquote(urlsplit(self.path).path)
        if path == "/login":
            right = body.get("token") == self.shop.token
            headers = {"Set-Cookie": f"session={self.shop.token}; HttpOnly; SameSite=Strict; Path=/"} if right else {}
            self._json(204 if right else 401, None if right else {"error": "that is not the token"}, headers)
            return
        self.shop.posted.append((path, body))
        self._json(*self._other(path, body))

    def _asked(self, path: str, asked: dict[str, str]) -> Answer:
        shop = self.shop
        if path in shop.answers:
            return shop.answers[path](path, dict(asked))
        if path == "/machines":
            return 200, shop.fleet()["machines"]
        if path == "/livez":
            return 200, {"alive": True}
        if path == "/whoami":
            return 200, shop.me
        if path == "/health":
            parts = [
                {"part": "broker", "state": "ok" if shop.broker else "missing", "reason": "mqtt://127.0.0.1:1883", "do": ""},
                {"part": "store", "state": "missing", "reason": "no store: history is that of the last minutes", "do": ""},
            ]
            return 200, {"status": "degraded", "now": now_ms(), "parts": parts}
        if found := re.fullmatch(r"/(state|history)/(.+)", path):
            what, machine = found.groups()
            if machine not in shop.numbers:
                return 404, {"error": f"machine {machine!r} is not known"}
            if what == "state":
                return 200, shop.state(machine)
            every = int(asked.get("every_ms", "100"))
            return 200, shop.history(machine, asked["signals"].split(","), int(asked["from"]), int(asked["to"]), every)
        return self._other(path, dict(asked))

    def _other(self, path: str, body: Any) -> Answer:
        if path == "/alerts" and path not in self.shop.answers:
            return 200, {
                "now": now_ms(),
                "available": True,
                "reason": None,
                "alerts": [],
                "silences": [],
                "receivers": {},
                "commands": [],
            }
        for pattern, answer in self.shop.answers.items():
            if re.fullmatch(pattern, path):
                return answer(path, body)
        return 404, {"error": f"{path}: there is no such thing here"}

    def _stream(self, machine: str | None) -> None:
        shop = self.shop
        if machine is not None and machine not in shop.numbers:
            self._json(404, {"error": f"machine {machine!r} is not known"})
            return
        self.send_response(200)
        self.send_header("Content-Type", "text/event-stream")
        self.send_header("Cache-Control", "no-store")
        self.send_header("Connection", "close")
        self.end_headers()
        self.close_connection = True
        self._event("fleet" if machine is None else "state", shop.fleet() if machine is None else shop.state(machine))
        before: dict[tuple[str, str], SignalValue] = {}
        offline, notices = dict(shop.offline_since), (shop.behind, shop.described)
        while not self.stop.wait(shop.period_s):
            now = now_ms()
            if notices != (shop.behind, shop.described):
                notices = shop.behind, shop.described
                self._event("processors", {"now": now, "behind": shop.behind, "described": shop.described})
            if offline != shop.offline_since:
                offline = dict(shop.offline_since)
                self._event("fleet" if machine is None else "state", shop.fleet() if machine is None else shop.state(machine))
            names = [machine] if machine is not None else list(shop.numbers)
            rows: list[list[Any]] = []
            for name in names:
                if name in offline:
                    continue
                told, t_ms = shop.told(name, now)
                for signal, one in told.items():
                    if (machine is None and signal not in KEYS) or before.get((name, signal)) == one:
                        continue
                    before[name, signal] = one
                    rows.append([name, *row(signal, one, t_ms)[:4]] if machine is None else row(signal, one, t_ms))
            said = {"now": now, "rows": rows}
            if machine is None:
                self._event("fleet_rows", said)
            else:
                self._event("rows", {**said, "online": machine not in offline})

    def _event(self, name: str, value: Any) -> None:
        self.wfile.write(f"event: {name}\ndata: {json.dumps(value)}\n\n".encode())
        self.wfile.flush()

    def _file(self, path: Path) -> None:
        if not path.resolve().is_relative_to(WEB.resolve()) or not path.is_file():
            self._json(404, {"error": f"{self.path}: no such file"})
            return
        self._send(200, path.read_bytes(), TYPES.get(path.suffix, "text/plain"), {})

    def _json(self, status: int, value: Any, headers: Mapping[str, str] | None = None) -> None:
        self._send(status, b"" if value is None else json.dumps(value).encode(), "application/json", headers or {})

    def _send(self, status: int, body: bytes, kind: str, headers: Mapping[str, str]) -> None:
        self.send_response(status)
        self.send_header("Content-Type", kind)
        self.send_header("Content-Security-Policy", POLICY)
        self.send_header("X-Content-Type-Options", "nosniff")
        if status != 204:
            self.send_header("Content-Length", str(len(body)))
        for name, value in headers.items():
            self.send_header(name, value)
        self.end_headers()
        self.wfile.write(body)
