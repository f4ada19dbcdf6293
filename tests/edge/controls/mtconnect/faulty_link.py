"""A TCP link between the edge and an agent that does wrong in ways that can be switched: it hangs in the middle of a part, drips,
cuts, changes bytes, or answers in the agent's place.

One thread for each connection; a connection of the edge has one of its own to the agent, made with its first request.
"""

import re
import select
import socket
import struct
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import suppress
from dataclasses import dataclass

READ_BYTES = 65536
WATCH_S = 0.02
Answer = Callable[[str], bytes]
Change = Callable[[bytes], bytes]


@dataclass(frozen=True)
class Fault:
    """What is wrong with the link at the moment.

    answer: in the agent's place, to a path
    change: of what the agent says
    passes: bytes that still get through on each connection; then it hangs, or is cut in the ordinary way, or with a reset
    piece_bytes, delay_s: what comes goes on in such pieces, with such pauses
    """

    answer: Answer | None = None
    change: Change | None = None
    passes: int | None = None
    cuts: bool = False
    resets: bool = False
    piece_bytes: int = READ_BYTES
    delay_s: float = 0.0


class Passing:
    """How much of a fault's `passes` is left on one connection."""

    def __init__(self, fault: Fault) -> None:
        self.fault, self._bytes = fault, fault.passes

    @property
    def is_over(self) -> bool:
        """Return whether nothing gets through any more."""
        return self._bytes == 0

    def take(self, piece: bytes) -> bytes:
        """Return what of it gets through."""
        passed = piece[: self._bytes]
        self._bytes = None if self._bytes is None else self._bytes - len(passed)
        return passed


def http(status: str, body: bytes, kind: str = "text/xml", *, length: int | None = None) -> bytes:
    """An answer with this body; `length` is what its head says in place of the true one."""
    said = len(body) if length is None else length
    return f"HTTP/1.1 {status}\r\nContent-Type: {kind}\r\nContent-Length: {said}\r\nConnection: close\r\n\r\n".encode() + body


class FaultyLink:
    """Listens on loopback, for an agent that may come and go at its port. `is_polled`: the agent is never asked to stream."""

    def __init__(self, agent_port: int, *, is_polled: bool = False) -> None:
        self.fault = Fault()
        self.connections = 0
        self._agent_port, self._is_polled = agent_port, is_polled
        self._closing = threading.Event()
        self._cuts = 0
        self._listener = socket.create_server(("127.0.0.1", 0))
        self._listener.settimeout(WATCH_S)
        self.url = f"http://127.0.0.1:{self._listener.getsockname()[1]}"
        self._threads = [threading.Thread(target=self._accept, name="faulty-link")]

    def start(self) -> None:
        """Take connections."""
        self._threads[0].start()

    def close(self) -> None:
        """End all connections, and take no more."""
        self._closing.set()
        for thread in list(self._threads):
            thread.join(5.0)
            assert not thread.is_alive(), "a connection of the link hangs"
        self._listener.close()

    def cut(self) -> None:
        """End all connections that there are."""
        self._cuts += 1

    def _accept(self) -> None:
        while not self._closing.is_set():
            with suppress(TimeoutError):
                client, _ = self._listener.accept()
                self.connections += 1
                thread = threading.Thread(target=self._serve, args=(client,), name=f"faulty-link-{self.connections}")
                self._threads = [self._threads[0], *(thread for thread in self._threads[1:] if thread.is_alive()), thread]
                thread.start()

    def _serve(self, client: socket.socket) -> None:
        ends = [client]
        client.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
        try:
            self._relay(ends)
        except OSError:
            return  # one side is gone, or the link is cut, and so the other one goes too
        finally:
            for end in ends:
                end.close()

    def _relay(self, ends: list[socket.socket]) -> None:
        client, asked, cuts, left = ends[0], b"", self._cuts, Passing(self.fault)
        while not self._closing.is_set() and cuts == self._cuts:
            if left.fault is not self.fault:
                left = Passing(self.fault)
            ready, _, _ = select.select(ends[:1] if left.is_over else ends, [], [], WATCH_S)
            if client in ready:
                data = client.recv(READ_BYTES)
                if not data:
                    return None
                asked += data
            if left.is_over and left.fault.cuts:
                raise _end(client, left.fault)
            if b"\r\n\r\n" in asked and not left.is_over:
                if left.fault.answer is not None:
                    return client.sendall(left.fault.answer(asked.split(b" ")[1].decode()))
                if len(ends) == 1:
                    ends.append(socket.create_connection(("127.0.0.1", self._agent_port), timeout=5.0))
                ends[1].sendall(self._request(asked))
                asked = b""
            if len(ends) > 1 and ends[1] in ready:
                data = ends[1].recv(READ_BYTES)
                if not data:
                    return None
                self._deliver(client, left, data)
        return None

    def _deliver(self, client: socket.socket, left: "Passing", data: bytes) -> None:
        fault = left.fault
        for piece in _pieces(data if fault.change is None else fault.change(data), fault.piece_bytes):
            passed = left.take(piece)
            client.sendall(passed)
            if len(passed) < len(piece):
                if fault.cuts:
                    raise _end(client, fault)
                while fault is self.fault and not self._closing.is_set():
                    time.sleep(WATCH_S)  # it hangs; when it does not any more, the rest follows
                client.sendall(piece[len(passed) :])
            if fault.delay_s:
                time.sleep(fault.delay_s)

    def _request(self, asked: bytes) -> bytes:
        return re.sub(rb"&(interval|heartbeat)=\d+", b"", asked) if self._is_polled else asked


def _end(client: socket.socket, fault: Fault) -> ConnectionAbortedError:
    if fault.resets:
        client.setsockopt(socket.SOL_SOCKET, socket.SO_LINGER, struct.pack("ii", 1, 0))
    return ConnectionAbortedError("cut")


def _pieces(data: bytes, size: int) -> Iterator[bytes]:
    for begin in range(0, len(data), size):
        yield data[begin : begin + size]
