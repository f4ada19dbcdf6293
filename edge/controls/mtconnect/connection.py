"""The connection to an agent: thin I/O, which asks for what `edge.controls.mtconnect.cursor.next_request` says.

Where the agent streams (multipart, either kind) one request lasts until something goes wrong; where it answers with a single
document the same request is polled. The agent's heartbeat is the liveness timer: no whole part within three heartbeats, and the
connection is made again. After a failure it waits, longer each time, with jitter, so that a plant's edges do not come back in
step. No call blocks for longer than the configured timeout, and `close` wakes a blocked read.

A stream over plain HTTP waits where its caller can see it (`steps`, `edge.controls.mtconnect.stream`). All else is httpx, and
blocks: descriptions, single documents, and streams over TLS.
"""

import os
import random
import select
import socket
import ssl
import threading
import time
from collections.abc import Callable, Iterable, Iterator
from urllib.parse import urlsplit

import httpx

from edge.adapter import Wait
from edge.controls.mtconnect.cursor import Config, Cursor, Phase, Request, next_request
from edge.controls.mtconnect.multipart import MultipartParser
from edge.controls.mtconnect.stream import Stream, target_of
from edge.controls.mtconnect.xml import DOCUMENT_BYTES_MAX
from edge.errors import ConfigError, ConnectionLostError

BACKOFF_S = 0.25
BACKOFF_S_MAX = 30.0
HEARTBEATS_MAX = 3
_ERROR_ROOT, _STREAMS_ROOT = b"MTConnectError", b"MTConnectStreams"


class MtconnectConnection:
    """Raw documents of one agent, in order, reconnecting by itself."""

    def __init__(
        self,
        config: Config,
        *,
        clock: Callable[[], float] = time.monotonic,
        wait: Callable[[float], object] | None = None,
        chance: random.Random | None = None,
    ) -> None:
        self._config = config
        self._clock = clock
        self._chance = chance or random.Random()  # noqa: S311  jitter, not a secret
        self._cursor = Cursor()
        self._closed = threading.Event()
        self._wait = wait or self._closed.wait
        self._socket: socket.socket | None = None
        self._streams = True
        self._heard_s = clock()
        self._failures = 0
        self.reconnects = 0
        self.last_error = ""

    def follow(self, cursor: Cursor) -> None:
        """Take over where the parser stands now."""
        self._cursor = cursor

    def silent_s(self) -> float:
        """Seconds since the agent sent a document."""
        return self._clock() - self._heard_s

    def close(self) -> None:
        """End `frames`; a read that is blocked in another thread is woken."""
        self._closed.set()
        open_socket = self._socket
        if open_socket is not None:
            try:
                open_socket.shutdown(socket.SHUT_RDWR)
            except OSError:
                return  # closed already

    def frames(self) -> Iterator[bytes]:
        """Documents until `close`. The caller tells `follow` after each of them."""
        for step in self.steps():
            if not isinstance(step, Wait):
                yield step
            elif step.sock is not None:
                _await(step.sock, step.seconds)

    def steps(self) -> Iterator[bytes | Wait]:
        """Documents, and the waits between those of a stream over plain HTTP."""
        with client_of(self._config) as client:
            while not self._closed.is_set():
                asked = self._cursor
                try:
                    yield from self._answer(client, next_request(self._config, asked, streams=self._streams))
                except (httpx.HTTPError, httpx.InvalidURL, httpx.StreamError, ConnectionLostError, OSError) as error:
                    yield Wait(None)  # what comes next connects anew
                    if not self._closed.is_set():
                        self._lost(error)
                    continue
                yield Wait(None)
                if self._cursor.attempt:
                    self._wait(self._backoff_s(self._cursor.attempt))
                elif asked.phase is Phase.SAMPLE and self._cursor == asked:
                    self._wait(self._config.source.poll_ms / 1000)

    def _lost(self, error: Exception) -> None:
        self.reconnects += 1
        self._failures += 1
        self.last_error = f"{self._config.source.url}: {str(error) or type(error).__name__}"
        self._wait(self._backoff_s(self._failures))

    def _backoff_s(self, failures: int) -> float:
        longest = min(BACKOFF_S_MAX, BACKOFF_S * 2.0 ** min(failures, 16))
        return longest * self._chance.uniform(0.5, 1.0)

    def _answer(self, client: httpx.Client, request: Request) -> Iterator[bytes | Wait]:
        streams = any(name == "interval" for name, _ in request.parameters)
        if streams and self._config.source.url.startswith("http://"):
            yield from self._streamed(request)
            return
        with client.stream("GET", request.path, params=list(request.parameters)) as response:
            self._socket = response.extensions["network_stream"].get_extra_info("socket")
            try:
                content_type = response.headers.get("content-type", "")
                status = response.status_code, response.reason_phrase
                yield from self._content(request, status, content_type, response.iter_bytes())
            finally:
                self._socket = None

    def _streamed(self, request: Request) -> Iterator[bytes | Wait]:
        source = self._config.source
        url, target = urlsplit(source.url), target_of(request.path, request.parameters)
        login = (source.username, _password(self._config)) if source.username else None
        with Stream(url, target, login=login, timeout_s=source.timeout_s, head_s=_alive_s(self._config)) as stream:
            self._socket = stream.socket
            try:
                yield from self._content(request, (stream.status, stream.reason), stream.content_type, self._pieces(stream))
            finally:
                self._socket = None

    def _pieces(self, stream: Stream) -> Iterator[bytes | None]:
        """Yield the pieces of the body; None where the next one has to be waited for."""
        alive_s, came_s = _alive_s(self._config), self._clock()
        while (data := stream.read()) != b"":
            if data is not None:
                came_s = self._clock()
            elif self._clock() - came_s > alive_s:
                raise TimeoutError("timed out")
            yield data

    def _content(
        self, request: Request, status: tuple[int, str], content_type: str, pieces: Iterable[bytes | None]
    ) -> Iterator[bytes | Wait]:
        if content_type.lower().startswith("multipart/"):
            yield from self._parts(pieces, content_type)
            return
        body = bytearray()
        for data in pieces:
            if data is None:
                yield self._pause()
                continue
            body += data
            if len(body) > DOCUMENT_BYTES_MAX:
                raise ConnectionLostError(f"document of more than {DOCUMENT_BYTES_MAX} bytes")
        if _ERROR_ROOT not in body[:4096]:
            if status[0] >= 400:
                raise ConnectionLostError(f"HTTP {status[0]} {status[1]} for {request.path}")
            if request.path.endswith("/sample") and _STREAMS_ROOT in body[:4096]:
                self._streams = False  # anything else is somebody who stands between us and the agent
        yield self._heard(bytes(body))

    def _parts(self, pieces: Iterable[bytes | None], content_type: str) -> Iterator[bytes | Wait]:
        parser = MultipartParser(content_type)
        alive_s = HEARTBEATS_MAX * self._config.source.heartbeat_ms / 1000
        instance, begun_s = self._cursor.instance_id, self._clock()
        for data in pieces:
            for part in () if data is None else parser.feed(data):
                yield self._heard(part)
                cursor = self._cursor
                if self._closed.is_set() or cursor.attempt or cursor.phase is not Phase.SAMPLE or cursor.instance_id != instance:
                    return
            if parser.closed:
                break
            if data is None:
                yield self._pause()
            if min(self.silent_s(), self._clock() - begun_s) > alive_s:  # what was before this stream is not its fault
                raise ConnectionLostError(f"no document within {alive_s:g} s")
        if not self._closed.is_set():
            raise ConnectionLostError("the agent ended the stream")

    def _pause(self) -> Wait:
        return Wait(self._socket, HEARTBEATS_MAX * self._config.source.heartbeat_ms / 1000)

    def _heard(self, document: bytes) -> bytes:
        self._heard_s = self._clock()
        self._failures = 0
        return document


def _await(sock: socket.socket, seconds: float) -> None:
    """Wait until the socket can be read; not by `select`, which knows no descriptor above 1023."""
    poll = select.poll()
    poll.register(sock, select.POLLIN)
    poll.poll(seconds * 1000)


def _alive_s(config: Config) -> float:
    """For how long an agent may be silent at most."""
    return max(config.source.timeout_s, HEARTBEATS_MAX * config.source.heartbeat_ms / 1000)


def client_of(config: Config) -> httpx.Client:
    """An HTTP client for the configured agent. Proxies of the environment are not used: the agent is in the plant."""
    source = config.source
    authentication = httpx.BasicAuth(source.username, _password(config)) if source.username else None
    verify: ssl.SSLContext | bool = True
    if source.ca_file:
        try:
            verify = ssl.create_default_context(cafile=source.ca_file)
        except OSError as error:
            raise ConfigError(f"{config.path}: mtconnect.ca_file = {source.ca_file!r}: cannot be used: {error}") from error
    return httpx.Client(
        base_url=source.url,
        auth=authentication,
        verify=verify,
        timeout=httpx.Timeout(source.timeout_s, read=_alive_s(config)),
        trust_env=False,
        headers={"Accept": "text/xml, application/xml, multipart/*"},
    )


def fetch(config: Config, request: Request) -> bytes:
    """One document, for `check` and `discover`; ConnectionLostError where the agent has none."""
    with client_of(config) as client:
        try:
            with client.stream("GET", request.path, params=list(request.parameters)) as response:
                body = _body(response)
                if response.status_code >= 400 and _ERROR_ROOT not in body[:4096]:
                    refusal = f"HTTP {response.status_code} {response.reason_phrase}"
                    raise ConnectionLostError(f"{config.source.url}{request.path}: {refusal}; {_way_out(response.status_code)}")
                return body
        except (httpx.HTTPError, httpx.InvalidURL, OSError) as error:
            raise ConnectionLostError(
                f"{config.source.url}{request.path}: {error}; is the agent running, and the address right?"
            ) from error


def _way_out(status: int) -> str:
    return "it wants mtconnect.username and password_env" if status == 401 else "is this the address of an MTConnect agent?"


def _body(response: httpx.Response) -> bytes:
    body = bytearray()
    for data in response.iter_bytes():
        body += data
        if len(body) > DOCUMENT_BYTES_MAX:
            raise ConnectionLostError(f"document of more than {DOCUMENT_BYTES_MAX} bytes")
    return bytes(body)


def _password(config: Config) -> str:
    name = config.source.password_env
    if not name:
        raise ConfigError(
            f"{config.path}: mtconnect.username needs mtconnect.password_env: the environment variable that holds the password"
        )
    if name not in os.environ:
        raise ConfigError(
            f"{config.path}: mtconnect.password_env = {name!r}: no such environment variable; set it to the password"
        )
    return os.environ[name]
