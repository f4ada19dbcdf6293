"""HTTP on loopback: one thread for each connection, a bounded number of connections, streams as multipart."""

import secrets
import socket
import threading
import time
from collections.abc import Iterator
from contextlib import suppress
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer

from cnctwin.standins.mtconnect_agent.agent import Agent
from cnctwin.standins.mtconnect_agent.documents import error_document, streams_document
from cnctwin.standins.mtconnect_agent.errors import ReplayError
from cnctwin.standins.mtconnect_agent.observation import Observation
from cnctwin.standins.mtconnect_agent.request import Answer, CurrentStream, SampleStream, answer, current_body

LOOPBACK = "127.0.0.1"
IDLE_S_MAX = 60.0
"""A connection that sends nothing, or takes nothing, for so long is closed."""


class AgentServer:
    """Serves one agent. `port` 0 takes any free one; beyond `clients_max` connections a new one is turned away.

    `sampled` is set once a client has asked for samples: from then on somebody listens.
    """

    def __init__(self, agent: Agent, *, port: int, clients_max: int, sampled: threading.Event | None = None) -> None:
        try:
            self._http = _HttpServer(agent, port, clients_max, sampled or threading.Event())
        except OSError as error:
            raise ReplayError(f"can't listen on {LOOPBACK} port {port}: {error}; give another port, or 0") from error
        self._thread = threading.Thread(
            target=self._http.serve_forever, kwargs={"poll_interval": 0.02}, name="mtconnect-http", daemon=True
        )

    @property
    def url(self) -> str:
        return f"http://{LOOPBACK}:{self._http.server_address[1]}"

    @property
    def turned_away(self) -> int:
        """Connections refused because there were too many."""
        return self._http.turned_away

    def start(self) -> None:
        self._thread.start()

    def stop(self, timeout_s: float = 5.0) -> None:
        """End every stream and connection."""
        if self._thread.is_alive():
            self._http.shutdown()
            self._thread.join(timeout_s)
        self._http.close_connections(timeout_s)
        self._http.server_close()


class _HttpServer(ThreadingHTTPServer):
    daemon_threads = True
    request_queue_size = 32

    def __init__(self, agent: Agent, port: int, clients_max: int, sampled: threading.Event) -> None:
        self.agent = agent
        self.turned_away = 0
        self.sampled = sampled
        self._places = threading.BoundedSemaphore(clients_max)
        self._open: set[socket.socket] = set()
        self._open_lock = threading.Lock()
        super().__init__((LOOPBACK, port), _Handler)

    def process_request(self, request: socket.socket | tuple[bytes, socket.socket], client_address: object) -> None:
        assert isinstance(request, socket.socket)
        if not self._places.acquire(blocking=False):
            self.turned_away += 1
            self.shutdown_request(request)
            return
        with self._open_lock:
            self._open.add(request)
        super().process_request(request, client_address)

    def process_request_thread(self, request: socket.socket | tuple[bytes, socket.socket], client_address: object) -> None:
        assert isinstance(request, socket.socket)
        try:
            super().process_request_thread(request, client_address)
        finally:
            with self._open_lock:
                self._open.discard(request)
            self._places.release()

    def handle_error(self, request: object, client_address: object) -> None:
        """A client that goes away in the middle of an answer is nothing to write about."""

    def close_connections(self, timeout_s: float) -> None:
        """Shut the connections down and wait for their threads."""
        with self._open_lock:
            for connection in self._open:
                with suppress(OSError):  # it is closed already
                    connection.shutdown(socket.SHUT_RDWR)
        until = time.monotonic() + timeout_s
        while self._open and time.monotonic() < until:
            time.sleep(0.005)


class _Handler(BaseHTTPRequestHandler):
    server: _HttpServer
    protocol_version = "HTTP/1.1"
    server_version = "cnctwin-replay"
    timeout = IDLE_S_MAX
    wbufsize = -1
    disable_nagle_algorithm = True

    def do_GET(self) -> None:
        self._respond()

    do_POST = do_PUT = do_DELETE = do_GET  # noqa: N815

    def log_message(self, *args: object) -> None:
        """Requests are not logged: at streaming rates that would be the main work."""

    def _respond(self) -> None:
        agent = self.server.agent
        with agent.changed:
            reply = answer(agent, self.command, self.path)
        if isinstance(reply, Answer):
            if "/sample" in self.path:
                self.server.sampled.set()
            self._send_whole(reply)
            return
        self.server.sampled.set()
        parts = _sample_parts(agent, reply) if isinstance(reply, SampleStream) else _current_parts(agent, reply)
        self._send_parts(agent, parts)

    def _send_whole(self, reply: Answer) -> None:
        body = reply.body.encode()
        self.send_response(reply.status)
        self.send_header("Content-Type", "text/xml")
        self.send_header("Content-Length", str(len(body)))
        self.send_header("Cache-Control", "private, max-age=0")
        if self.headers.get("Content-Length") or self.headers.get("Transfer-Encoding"):
            self.send_header("Connection", "close")  # what a POST carries is not read
        self.end_headers()
        self.wfile.write(body)

    def _send_parts(self, agent: Agent, parts: Iterator[str]) -> None:
        boundary = secrets.token_hex(16)
        self.close_connection = True
        self.send_response(200)
        self.send_header("Content-Type", f"{agent.dialect.multipart_type};boundary={boundary}")
        self.send_header("Transfer-Encoding", "chunked")
        self.send_header("Cache-Control", "private, max-age=0")
        self.send_header("Connection", "close")
        self.end_headers()
        try:
            for part in parts:
                body = part.encode()
                head = f"--{boundary}\r\nContent-type: text/xml\r\nContent-length: {len(body)}\r\n\r\n"
                chunk = head.encode() + body + b"\r\n"
                self.wfile.write(b"%x\r\n%b\r\n" % (len(chunk), chunk))
                self.wfile.flush()
        except OSError:
            return  # the client is gone, or takes nothing any more


def _sample_parts(agent: Agent, stream: SampleStream) -> Iterator[str]:
    """Yield a document at once, then one whenever something wanted has come, and an empty one as heartbeat.

    A client whose next observation has left the buffer is disconnected; agent 1.4 tells it so in a last part.
    """
    position, instance_id = stream.start, agent.instance_id
    due_s = time.monotonic()
    while True:
        with agent.changed:
            observations: list[Observation] = []
            while not agent.has_ended(instance_id) and position >= agent.buffer.first_sequence:
                observations, position = agent.buffer.since(position, stream.count, stream.wanted)
                left_s = due_s - time.monotonic()
                if observations or left_s <= 0:
                    break
                agent.changed.wait(left_s)
            if agent.has_ended(instance_id):
                return
            is_behind = position < agent.buffer.first_sequence
            part = _farewell(agent) if is_behind else streams_document(agent, observations, position)
        if part:
            yield part
        if is_behind:
            return
        due_s = time.monotonic() + stream.heartbeat_ms / 1000
        _pause(agent, stream.interval_ms)


def _farewell(agent: Agent) -> str:
    text = "Client can't keep up with event stream, disconnecting"
    return "" if agent.dialect.is_modern else error_document(agent, "OUT_OF_RANGE", text)


def _current_parts(agent: Agent, stream: CurrentStream) -> Iterator[str]:
    instance_id = agent.instance_id
    while True:
        with agent.changed:
            if agent.has_ended(instance_id):
                return
            part = current_body(agent, stream.wanted)
        yield part
        _pause(agent, stream.interval_ms)


def _pause(agent: Agent, interval_ms: int) -> None:
    """Wait between two parts; a stop of the agent ends the wait."""
    until = time.monotonic() + interval_ms / 1000
    while not agent.is_closed and (left_s := until - time.monotonic()) > 0:
        time.sleep(min(left_s, 0.1))
