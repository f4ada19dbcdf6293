"""paho's client with a socket that reads ahead and closes in order, and a TLS handshake that cleans up after itself.

The two methods that are overridden are paho's own seams: its websockets wrap the socket in `_create_socket` too.
"""

import select
import socket
import ssl
import time
from collections.abc import Sequence
from contextlib import suppress
from typing import Any

import paho.mqtt.client as paho

CONNECT_TIMEOUT_S = 5.0
LINGER_S_MAX = 0.5
_READ_BYTES = 64 * 1024


def ready(readers: Sequence[Any], writers: Sequence[Any], wait_s: float) -> set[int]:
    """Wait until something can be read or written; the descriptors to read, broken ones among them. ValueError for a closed one.

    Not by `select`, which knows no descriptor above 1023: a process with 150 machines has more.
    """
    poll = select.poll()
    wanted: dict[int, int] = {}
    for sockets, event in ((readers, select.POLLIN), (writers, select.POLLOUT)):
        for sock in sockets:
            wanted[sock.fileno()] = wanted.get(sock.fileno(), 0) | event
    for descriptor, events in wanted.items():
        poll.register(descriptor, events)
    return {descriptor for descriptor, events in poll.poll(wait_s * 1000) if events & ~select.POLLOUT}


class BufferedSocket:
    """Reads ahead: paho asks for one byte, then for some, then for the rest, and each would be a system call."""

    def __init__(self, sock: Any) -> None:
        self._sock = sock
        self._buffer = b""
        self._start = 0
        self.failure: OSError | None = None  # what ended it, which paho keeps to itself

    def recv(self, size: int) -> bytes:
        available = len(self._buffer) - self._start
        if not available:
            self._buffer, self._start = self._received(), 0
            available = len(self._buffer)
        end = self._start + min(size, available)
        data: bytes = self._buffer[self._start : end]
        self._start = end
        return data

    def send(self, data: Any) -> int:
        """As the socket's. Where it fails, what the other side has said before it hung up is worth more than the failure."""
        try:
            sent: int = self._sock.send(data)
        except (BlockingIOError, ssl.SSLWantReadError, ssl.SSLWantWriteError):
            raise
        except OSError as error:
            self.failure = error
            with suppress(OSError):
                self._received()
            raise
        return sent

    def _received(self) -> bytes:
        try:
            data: bytes = self._sock.recv(_READ_BYTES)
        except (BlockingIOError, ssl.SSLWantReadError, ssl.SSLWantWriteError):
            raise
        except OSError as error:
            self.failure = error
            raise
        return data

    def pending(self) -> int:
        """Bytes that can be read without waiting; TLS keeps some of its own, which `select` does not see."""
        inner = getattr(self._sock, "pending", None)
        return len(self._buffer) - self._start + (inner() if inner is not None else 0)

    def close(self) -> None:
        """Say that nothing more comes and take what is still on its way, then close.

        A close with unread data is a reset, and a reset can destroy a death and a DISCONNECT before the broker has read them.
        """
        deadline_s = time.monotonic() + LINGER_S_MAX
        with suppress(OSError):
            self._sock.shutdown(socket.SHUT_WR)
            self._sock.settimeout(LINGER_S_MAX)
            while self._sock.recv(_READ_BYTES) and time.monotonic() < deadline_s:
                pass
        self._sock.close()

    def abort(self) -> None:
        """Close at once."""
        self._sock.close()

    def __getattr__(self, name: str) -> Any:
        return getattr(self._sock, name)


class ReadingAheadClient(paho.Client):
    """A paho client on such a socket."""

    _buffered: BufferedSocket | None = None

    @property
    def failure(self) -> OSError | None:
        """What ended the connection while it was read, if that was an error."""
        return None if self._buffered is None else self._buffered.failure

    def _ssl_wrap_socket(self, tcp_sock: Any) -> Any:
        """As paho's, but a handshake that fails leaves no open socket behind, and one that hangs ends with CONNECT_TIMEOUT_S."""
        context: ssl.SSLContext = self._ssl_context  # type: ignore[assignment]
        wrapped = context.wrap_socket(tcp_sock, server_hostname=self._host, do_handshake_on_connect=False)
        wrapped.settimeout(CONNECT_TIMEOUT_S)
        try:
            wrapped.do_handshake()
        except BaseException:
            wrapped.close()
            raise
        return wrapped

    def _create_socket(self) -> Any:
        sock: Any = super()._create_socket()
        sock.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
        self._buffered = BufferedSocket(sock)
        return self._buffered
