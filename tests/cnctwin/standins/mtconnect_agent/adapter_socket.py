"""The recording as an SHDR adapter: a socket that sends its lines, at speed, to every agent that connects.

One thread serves all clients. A client that connects late is first sent the present values, as a real adapter does;
one that takes nothing while `pending_bytes_max` pile up is disconnected, which it notices, rather than fed with holes.
"""

import math
import selectors
import socket
import threading
import time
from collections.abc import Iterator
from dataclasses import dataclass, field
from pathlib import Path

from cnctwin.standins.mtconnect_agent.device_model import Device
from cnctwin.standins.mtconnect_agent.errors import ReplayError
from cnctwin.standins.mtconnect_agent.recording import Recording
from cnctwin.standins.mtconnect_agent.replay import PAUSE_S_MAX, Pace
from cnctwin.standins.mtconnect_agent.shdr import Command, Line, Unusable, entries

LOOPBACK = "127.0.0.1"
HEARTBEAT_MS = 10_000
PENDING_BYTES_MAX = 4_000_000
REQUEST_BYTES_MAX = 4096
CLIENTS_MAX = 8
LINES_A_TURN_MAX = 200
IDLE_S = 0.1
LATE_S_MAX = 0.2
"""A schedule that is later than this is given up, not caught up with in a burst."""


@dataclass
class _Client:
    connection: socket.socket
    pending: bytearray = field(default_factory=bytearray)
    asked: bytearray = field(default_factory=bytearray)


class ShdrAdapter:
    """Sends a recording over a socket. Playing begins with the first client, so that it misses nothing."""

    def __init__(
        self,
        recording: Path,
        devices: Path | None = None,
        *,
        speed: float = 1.0,
        device: str | None = None,
        port: int = 0,
        pause_s_max: float = PAUSE_S_MAX,
        loop: bool = False,
        heartbeat_ms: int = HEARTBEAT_MS,
        clients_max: int = CLIENTS_MAX,
        pending_bytes_max: int = PENDING_BYTES_MAX,
    ) -> None:
        if not speed > 0:
            raise ValueError(f"the speed {speed} isn't above 0; 1 is the recorded pace")
        self._recording = Recording(recording)
        self._device: Device = self._recording.device_model(devices, device, (2, 3))[1]
        self._speed, self._loop = speed, loop
        self._pause_s_max = pause_s_max
        self._pace = Pace(pause_s_max)
        self._heartbeat_ms = heartbeat_ms
        self._clients_max, self._pending_bytes_max = clients_max, pending_bytes_max
        self._clients: dict[socket.socket, _Client] = {}
        self._present: dict[str, str] = {}
        self._ahead: Line | Command | Unusable | None = None
        self._due_s = 0.0
        self._stop = threading.Event()
        self._finished = threading.Event()
        self.lines_sent = 0
        self.lines_unusable = 0
        self.clients_dropped = 0
        try:
            self._listener = socket.create_server((LOOPBACK, port), backlog=clients_max)
        except OSError as error:
            raise ReplayError(f"can't listen on {LOOPBACK} port {port}: {error}; give another port, or 0") from error
        self._listener.setblocking(False)
        self._thread = threading.Thread(target=self._run, name="shdr-adapter", daemon=True)

    @property
    def address(self) -> tuple[str, int]:
        return LOOPBACK, int(self._listener.getsockname()[1])

    @property
    def finished(self) -> bool:
        """The whole recording has been played."""
        return self._finished.is_set()

    @property
    def clients(self) -> int:
        return len(self._clients)

    def start(self) -> None:
        self._thread.start()

    def stop(self, timeout_s: float = 5.0) -> None:
        self._stop.set()
        if self._thread.is_alive():
            self._thread.join(timeout_s)
        else:
            self._listener.close()

    def _run(self) -> None:
        with selectors.DefaultSelector() as selector, self._listener:
            selector.register(self._listener, selectors.EVENT_READ)
            lines = self._endless()
            while not self._stop.is_set():
                self._serve(selector, self._play_due(lines))
            for client in list(self._clients.values()):
                self._drop(selector, client, counted=False)

    def _play_due(self, lines: Iterator[Line | Command | Unusable]) -> float:
        """Play the lines whose time has come; return the seconds until there is something to do again."""
        if not self._clients or self.finished:
            return IDLE_S
        now_s = time.monotonic()
        self._due_s = max(self._due_s or now_s, now_s - LATE_S_MAX)
        for _ in range(LINES_A_TURN_MAX):
            if math.isinf(self._speed) and self._most_pending() > self._pending_bytes_max // 2:
                return IDLE_S / 10  # as fast as possible means: as fast as the slowest client takes it
            if self._ahead is None:
                self._ahead = next(lines, None)
                if self._ahead is None:
                    self._finished.set()
                    return 0.0
                self._due_s += self._pace.pause_s(self._ahead) / self._speed
            if self._due_s > now_s:
                return min(self._due_s - now_s, IDLE_S)
            self._play(self._ahead)
            self._ahead = None
        return 0.0

    def _most_pending(self) -> int:
        return max(len(client.pending) for client in self._clients.values())

    def _endless(self) -> Iterator[Line | Command | Unusable]:
        for lines in self._recording.passes(self._loop):
            self._pace = Pace(self._pause_s_max)
            yield from lines

    def _play(self, line: Line | Command | Unusable) -> None:
        if isinstance(line, Unusable):
            self.lines_unusable += 1  # sent all the same: the recording is dirty, and so is the wire
        if isinstance(line, Line) and not line.fields[0].startswith("@"):
            for entry in entries(line.fields, self._width_of):
                if entry.key in self._device.by_key:
                    self._present[entry.key] = "|".join((line.stamp.text, entry.key, *entry.values))
        self.lines_sent += 1
        data = (line.text + "\n").encode()
        for client in self._clients.values():
            client.pending += data

    def _width_of(self, key: str) -> int:
        item = self._device.by_key.get(key)
        return item.width if item else 0

    def _serve(self, selector: selectors.BaseSelector, timeout_s: float) -> None:
        for client in list(self._clients.values()):
            if len(client.pending) > self._pending_bytes_max:
                self._drop(selector, client)
                continue
            events = selectors.EVENT_READ | (selectors.EVENT_WRITE if client.pending else 0)
            selector.modify(client.connection, events, client)
        for key, events in selector.select(timeout_s):
            if key.data is None:
                self._accept(selector)
            else:
                self._exchange(selector, key.data, events)

    def _accept(self, selector: selectors.BaseSelector) -> None:
        try:
            connection, _ = self._listener.accept()
        except OSError:
            return  # it gave up before we came to it
        if len(self._clients) >= self._clients_max:
            self.clients_dropped += 1
            connection.close()
            return
        connection.setblocking(False)
        client = _Client(connection)
        client.pending += "".join(f"{text}\n" for text in self._present.values()).encode()
        self._clients[connection] = client
        selector.register(connection, selectors.EVENT_READ, client)

    def _exchange(self, selector: selectors.BaseSelector, client: _Client, events: int) -> None:
        try:
            if events & selectors.EVENT_READ and not self._read(client):
                self._drop(selector, client, counted=False)
                return
            if client.pending:
                sent = client.connection.send(client.pending)
                del client.pending[:sent]
        except BlockingIOError:
            return
        except OSError:
            self._drop(selector, client, counted=False)

    def _read(self, client: _Client) -> bool:
        """Answer pings; False where the client is gone or talks without end."""
        data = client.connection.recv(REQUEST_BYTES_MAX)
        client.asked += data
        *whole, rest = bytes(client.asked).split(b"\n")
        client.asked = bytearray(rest)
        for request in whole:
            if request.strip().upper().startswith(b"* PING"):
                client.pending += f"* PONG {self._heartbeat_ms}\n".encode()
        return bool(data) and len(rest) < REQUEST_BYTES_MAX

    def _drop(self, selector: selectors.BaseSelector, client: _Client, *, counted: bool = True) -> None:
        self.clients_dropped += counted
        selector.unregister(client.connection)
        client.connection.close()
        del self._clients[client.connection]
