"""One answer of an agent over HTTP/1.1, read as it comes and never waited for: RFC 9112, by h11, which does no I/O.

The head is awaited, for it decides what the answer is. From then on `read` gives what has come, so that one thread reads the
streams of many agents. The agent is not trusted: the head has a deadline and at most HEAD_BYTES_MAX bytes, and a body that is
compressed is refused unread, since 5 kB of it can unfold into gigabytes.
"""

import base64
import socket
import ssl
import time
from types import TracebackType
from urllib.parse import SplitResult, urlencode

import h11

from edge.errors import ConnectionLostError

READ_BYTES = 64 * 1024
HEAD_BYTES_MAX = 16 * 1024


class Stream:
    """The answer to one GET. Raises ConnectionLostError or OSError.

    url: the agent's address; target: path and parameters below it; tls: for https
    timeout_s: for connecting; head_s: for the head
    """

    def __init__(
        self,
        url: SplitResult,
        target: str,
        *,
        login: tuple[str, str] | None,
        timeout_s: float,
        head_s: float,
        tls: ssl.SSLContext | None = None,
    ) -> None:
        self._http = h11.Connection(h11.CLIENT, max_incomplete_event_size=HEAD_BYTES_MAX)
        self._is_over = self._is_answered = False
        self.socket = socket.create_connection((url.hostname or "", url.port or (80 if tls is None else 443)), timeout_s)
        try:
            self.socket.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
            if tls is not None:
                self.socket = tls.wrap_socket(self.socket, server_hostname=url.hostname)
            headers = [("Host", url.netloc), ("Accept", "multipart/*, text/xml, application/xml"), ("Connection", "close")]
            headers.append(("Accept-Encoding", "identity"))
            if login is not None:
                headers.append(("Authorization", "Basic " + base64.b64encode(":".join(login).encode()).decode()))
            request = h11.Request(method="GET", target=url.path + target, headers=headers)
            self.socket.sendall(self._sent(request) + self._sent(h11.EndOfMessage()))
            self._head = self._awaited(time.monotonic() + head_s)
            self._refuse_encoded()
            self.socket.setblocking(False)
        except BaseException:
            self.socket.close()
            raise

    def __enter__(self) -> "Stream":
        return self

    def __exit__(self, _kind: type[BaseException] | None, _error: BaseException | None, _at: TracebackType | None) -> None:
        self.socket.close()

    @property
    def status(self) -> int:
        """The status code."""
        return self._head.status_code

    @property
    def reason(self) -> str:
        """The words after the code."""
        return bytes(self._head.reason).decode("latin-1")

    @property
    def content_type(self) -> str:
        """The type of the content, "" where none is named."""
        return self._header(b"content-type")

    def read(self) -> bytes | None:
        """Return what has come of the body; None where nothing has, b"" at its end."""
        body = self._body()
        if body is None:
            try:
                self._receive(self.socket.recv(READ_BYTES))
            except (BlockingIOError, ssl.SSLWantReadError, ssl.SSLWantWriteError):
                return None
            body = self._body()
        return body

    def _header(self, wanted: bytes) -> str:
        return ", ".join(value.decode("latin-1") for name, value in self._head.headers if name == wanted)

    def _refuse_encoded(self) -> None:
        encoding = self._header(b"content-encoding")
        if encoding.strip().lower() not in ("", "identity"):
            raise ConnectionLostError(
                f"the agent sends Content-Encoding: {encoding[:40]!r}, which was not asked for and is not decoded; "
                "have it, or the proxy before it, send plain XML"
            )

    def _awaited(self, deadline_s: float) -> h11.Response:
        while True:
            event = self._event()
            if isinstance(event, h11.Response):
                self._is_answered = True
                return event
            if event is h11.NEED_DATA:
                if (left_s := deadline_s - time.monotonic()) <= 0:
                    raise TimeoutError("timed out")
                self.socket.settimeout(left_s)
                self._receive(self.socket.recv(READ_BYTES))
            elif not isinstance(event, h11.InformationalResponse):
                raise ConnectionLostError("the agent sends no answer")

    def _body(self) -> bytes | None:
        """Return all of the body that was received and not given yet; None for nothing, b"" at the end."""
        parts: list[bytes] = []
        while not self._is_over:
            event = self._event()
            if isinstance(event, h11.Data):
                parts.append(bytes(event.data))
            elif event is h11.NEED_DATA:
                return b"".join(parts) or None
            else:
                self._is_over = True
        return b"".join(parts)

    def _event(self) -> object:
        try:
            return self._http.next_event()
        except h11.RemoteProtocolError as error:
            raise self._not_http(error) from error

    def _receive(self, data: bytes) -> None:
        try:
            self._http.receive_data(data)
        except h11.RemoteProtocolError as error:
            raise self._not_http(error) from error

    def _not_http(self, error: h11.RemoteProtocolError) -> ConnectionLostError:
        if self._is_answered:
            return ConnectionLostError(f"the answer is no whole HTTP message: {error}")
        return ConnectionLostError("what answers there is not HTTP; is it the agent's port?")

    def _sent(self, event: h11.Request | h11.EndOfMessage) -> bytes:
        return self._http.send(event) or b""


def target_of(path: str, parameters: tuple[tuple[str, str | int], ...]) -> str:
    """Return path and parameters as a request names them.

    >>> target_of("/vmc/sample", (("from", 11), ("count", 100)))
    '/vmc/sample?from=11&count=100'
    """
    return f"{path}?{urlencode(parameters)}" if parameters else path
