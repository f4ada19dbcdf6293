"""The connection to an agent: thin I/O, which asks for what `edge.controls.mtconnect.cursor.next_request` says.

Where the agent streams (multipart, either kind) one request lasts until something goes wrong; where it answers with a single
document the same request is polled. The agent's heartbeat is the liveness timer: no whole part within three heartbeats, and the
connection is made again. After a failure it waits, longer each time, with jitter, so that a plant's edges do not come back in
step. No call blocks for longer than the configured timeout, and `close` wakes a blocked read.

The agent is not trusted. Its answer is read as it comes (`edge.controls.mtconnect.stream`), and where it is waited for, the
caller can see it (`steps`). A single document is whole after ANSWER_TIMEOUTS_MAX timeouts and has at most DOCUMENT_BYTES_MAX
bytes; an agent that drips a byte a second is left like one that hangs, and one that sends us back to the start again and again
is asked less and less often.
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
from xml.sax.saxutils import escape

from edge.adapter import Wait
from edge.controls.mtconnect.cursor import Config, Request, next_request
from edge.controls.mtconnect.multipart import MultipartParser
from edge.controls.mtconnect.state import Cursor, Phase
from edge.controls.mtconnect.stream import Stream, target_of
from edge.controls.mtconnect.xml import DOCUMENT_BYTES_MAX
from edge.errors import ConfigError, ConnectionLostError

BACKOFF_S = 0.25
BACKOFF_S_MAX = 30.0
HEARTBEATS_MAX = 3
ANSWER_TIMEOUTS_MAX = 6
SETBACKS_MAX = 2  # in a row; an agent that was restarted needs one
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
        self._failures = self._setbacks = 0
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
                socket.socket.shutdown(open_socket, socket.SHUT_RDWR)  # TLS is not asked: another thread reads
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
        """Documents, and the waits between the pieces of those that are on their way."""
        agent = Agent(self._config)
        while not self._closed.is_set():
            asked = self._cursor
            try:
                yield from self._answer(agent, next_request(self._config, asked, streams=self._streams))
            except (ConnectionLostError, OSError) as error:
                if asked.phase is Phase.ASSET and self._cursor == asked:  # told to the parser, which goes on without it
                    yield error_document(str(error) or type(error).__name__)
                    yield Wait(None)
                    continue
                yield Wait(None)  # what comes next connects again
                if not self._closed.is_set():
                    self._lost(error)
                continue
            yield Wait(None)
            self._setbacks = self._setbacks_after(asked)
            if self._cursor.attempt:
                self._wait(self._backoff_s(self._cursor.attempt))
            elif self._setbacks > SETBACKS_MAX:
                self._wait(self._backoff_s(self._setbacks - SETBACKS_MAX))
            elif asked.phase is Phase.SAMPLE and self._cursor == asked:
                self._wait(self._config.source.poll_ms / 1000)

    def _setbacks_after(self, asked: Cursor) -> int:
        """Return how often in a row the agent has sent us back, as one does that is another instance in each document."""
        phase = self._cursor.phase
        if Phase.ASSET in (asked.phase, phase):
            return self._setbacks
        if asked.phase is Phase.SAMPLE and phase is Phase.SAMPLE:
            return 0
        return self._setbacks + (list(Phase).index(phase) < list(Phase).index(asked.phase))

    def _lost(self, error: Exception) -> None:
        self.reconnects += 1
        self._failures += 1
        self.last_error = f"{self._config.source.url}: {str(error) or type(error).__name__}"
        self._wait(self._backoff_s(self._failures))

    def _backoff_s(self, failures: int) -> float:
        longest = min(BACKOFF_S_MAX, BACKOFF_S * 2.0 ** min(failures, 16))
        return longest * self._chance.uniform(0.5, 1.0)

    def _answer(self, agent: "Agent", request: Request) -> Iterator[bytes | Wait]:
        with agent.asked(request) as stream:
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
        body = Body(self._config, self._clock)
        for data in pieces:
            body.take(data)
            if data is None:
                yield self._pause()
        if _ERROR_ROOT not in body.data[:4096]:
            if status[0] >= 400:
                raise ConnectionLostError(f"HTTP {status[0]} {status[1]} for {request.path}")
            if request.path.endswith("/sample") and _STREAMS_ROOT in body.data[:4096]:
                self._streams = False  # anything else is somebody who stands between us and the agent
        yield self._heard(bytes(body.data))

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


def error_document(why: str) -> bytes:
    """The answer that the agent would have given, had it answered."""
    return (
        f'<MTConnectError><Header/><Errors><Error errorCode="NO_ANSWER">{escape(why)}</Error></Errors></MTConnectError>'.encode()
    )


def _await(sock: socket.socket, seconds: float) -> None:
    """Wait until the socket can be read; not by `select`, which knows no descriptor above 1023."""
    poll = select.poll()
    poll.register(sock, select.POLLIN)
    poll.poll(seconds * 1000)


def _alive_s(config: Config) -> float:
    """For how long an agent may be silent at most."""
    return max(config.source.timeout_s, HEARTBEATS_MAX * config.source.heartbeat_ms / 1000)


class Body:
    """The body of a single document, bounded in bytes and in time."""

    def __init__(self, config: Config, clock: Callable[[], float] = time.monotonic) -> None:
        self.data = bytearray()
        self._clock = clock
        self._seconds_max = ANSWER_TIMEOUTS_MAX * config.source.timeout_s
        self._until_s = clock() + self._seconds_max

    def take(self, data: bytes | None) -> None:
        """Take what has come, or None for nothing. Raises ConnectionLostError where that is too much, or too late."""
        self.data += data or b""
        if len(self.data) > DOCUMENT_BYTES_MAX:
            raise ConnectionLostError(f"document of more than {DOCUMENT_BYTES_MAX} bytes")
        if self._clock() > self._until_s:
            raise ConnectionLostError(f"no whole document within {self._seconds_max:g} s, {len(self.data)} bytes of one")


class Agent:
    """The address of the configured agent, and how it lets us in. Proxies of the environment are not used: it is in the plant."""

    def __init__(self, config: Config) -> None:
        self._config, source = config, config.source
        self._url = urlsplit(source.url)
        self._login = (source.username, _password(config)) if source.username else None
        try:
            trusted = ssl.create_default_context(cafile=source.ca_file or None)
        except OSError as error:
            raise ConfigError(f"{config.path}: mtconnect.ca_file = {source.ca_file!r}: cannot be used: {error}") from error
        self._tls = trusted if self._url.scheme == "https" else None

    def asked(self, request: Request) -> Stream:
        """Return the answer to a request, of which the head has come. Raises ConnectionLostError or OSError."""
        target, timeout_s = target_of(request.path, request.parameters), self._config.source.timeout_s
        alive_s = _alive_s(self._config)
        return Stream(self._url, target, login=self._login, timeout_s=timeout_s, head_s=alive_s, tls=self._tls)


def fetch(config: Config, request: Request) -> bytes:
    """One document, for `check` and `discover`; ConnectionLostError where the agent has none."""
    where = f"{config.source.url}{request.path}"
    try:
        with Agent(config).asked(request) as stream:
            body = Body(config)
            while (data := stream.read()) != b"":
                body.take(data)
                if data is None:
                    _await(stream.socket, 1.0)
    except ConnectionLostError as error:
        raise ConnectionLostError(f"{where}: {error}") from error
    except OSError as error:
        raise ConnectionLostError(f"{where}: {error}; is the agent running, and the address right?") from error
    if stream.status >= 400 and _ERROR_ROOT not in body.data[:4096]:
        raise ConnectionLostError(f"{where}: HTTP {stream.status} {stream.reason}; {_way_out(stream.status)}")
    return bytes(body.data)


def _way_out(status: int) -> str:
    return "it wants mtconnect.username and password_env" if status == 401 else "is this the address of an MTConnect agent?"


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
