"""The byte stream of one connection: what is to be sent gathers in it, and goes out with one call.

paho takes it for its socket. It reads from it only what it is given, and what it writes joins the rest in order.
"""

import socket
import ssl
from contextlib import suppress
from typing import Any

READ_BYTES = 64 * 1024
_NOT_NOW = (BlockingIOError, ssl.SSLWantReadError, ssl.SSLWantWriteError)


class Stream:
    """Wraps a connected socket that does not block."""

    def __init__(self, sock: Any) -> None:
        self.failure: OSError | None = None  # what ended it, which paho keeps to itself
        self.has_ended = False
        self.size = 0  # bytes that wait to be sent
        self._sock = sock
        self._for_paho = b""
        self._start = 0
        self._pieces: list[bytes] = []
        self._is_begun = False  # the first piece is the rest of a packet
        self._pending = getattr(sock, "pending", None)

    # What paho calls.

    def recv(self, size: int) -> bytes:
        """Read what was given to paho."""
        end = min(self._start + size, len(self._for_paho))
        data = self._for_paho[self._start : end]
        if data:
            self._start = end
            return data
        if self.failure is not None:
            raise self.failure
        if self.has_ended:
            return b""
        raise BlockingIOError

    def send(self, data: bytes) -> int:
        """Take all of it."""
        self.add(bytes(data))
        return len(data)

    def setblocking(self, flag: bool) -> None:
        """Change the socket."""
        self._sock.setblocking(flag)

    def fileno(self) -> int:
        """Return the descriptor of the socket."""
        descriptor: int = self._sock.fileno()
        return descriptor

    def close(self) -> None:
        """Do nothing: the connection closes the socket, when what paho has written is sent."""

    # What the connection calls.

    def give(self, data: bytes) -> None:
        """Have paho read these bytes next."""
        self._for_paho = self._for_paho[self._start :] + data
        self._start = 0

    @property
    def given(self) -> bool:
        """True if paho has bytes to read."""
        return self._start < len(self._for_paho)

    def receive(self) -> bytes:
        """Return what can be read now; nothing where nothing has come, or where the stream has ended."""
        try:
            data: bytes = self._sock.recv(READ_BYTES)
        except _NOT_NOW:
            return b""
        except OSError as error:
            self.failure, self.has_ended = error, True
            return b""
        self.has_ended = not data
        return data

    def may_hold_more(self, data: bytes) -> bool:
        """Return True if there may be more to read after `data`; TLS keeps some that no selector sees."""
        return len(data) == READ_BYTES or (self._pending is not None and self._pending() > 0)

    def add(self, packet: bytes) -> None:
        """Have this packet sent next."""
        self._pieces.append(packet)
        self.size += len(packet)

    def add_all(self, packets: list[bytes]) -> None:
        """Have these packets sent next."""
        self._pieces += packets
        self.size += sum(map(len, packets))

    def flush(self) -> bool:
        """Send what has gathered with one call; False where something is left."""
        pieces = self._pieces
        if not pieces:
            return True
        if self.has_ended:
            return False
        data = pieces[0] if len(pieces) == 1 else b"".join(pieces)
        try:
            sent: int = self._sock.send(data)
        except _NOT_NOW:
            return False
        except OSError as error:
            # What the other side has said before it hung up is worth more than the failure.
            self.failure = error
            self.receive()
            self.has_ended = True
            return False
        self.size -= sent
        if sent == len(data):
            pieces.clear()
            self._is_begun = False
            return True
        self._keep_from(sent)
        return False

    def _keep_from(self, sent: int) -> None:
        whole = 0
        for piece in self._pieces:
            if sent < len(piece):
                break
            sent -= len(piece)
            whole += 1
        del self._pieces[:whole]
        self._is_begun = sent > 0 or (self._is_begun and whole == 0)
        self._pieces[0] = self._pieces[0][sent:]

    @property
    def unsent(self) -> int:
        """The number of QoS 0 messages of which no byte was sent."""
        return sum(piece[0] & 0xF6 == 0x30 for piece in self._pieces[self._is_begun :])

    def finish(self) -> None:
        """Say that nothing more comes. What is still on its way has to be read before the socket is closed.

        A close with unread data is a reset, and a reset can destroy a death and a DISCONNECT before the broker has read them.
        """
        with suppress(OSError):
            self._sock.shutdown(socket.SHUT_WR)

    def abort(self) -> None:
        """Close the socket at once."""
        self._sock.close()
