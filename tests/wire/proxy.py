"""A recording, fault-injecting TCP proxy between MQTT clients and a real broker, on loopback only.

with Proxy(upstream=("127.0.0.1", port)) as proxy:
    ...                                     # clients connect to proxy.port
    proxy.cut()                             # both sides see a TCP reset, so the will fires at once
    packets = proxy.packets("up", Connect)
"""

from __future__ import annotations

import contextlib
import queue
import select
import socket
import struct
import threading
import time
from collections.abc import Callable
from types import TracebackType
from typing import NamedTuple

from tests.wire.link import Direction, Link
from tests.wire.mqtt_packets import Connect, Packet
from tests.wire.recording import Recording

READ_BYTES = 65536
CONNECTIONS_MAX = 256
COMMAND_S_MAX = 60.0
# A reset may overtake what the receiver has not read yet, so bytes that a rule lets through get this head start.
HEAD_START_S = 0.05
CLOSING_S_MAX = 1.0
BOTH: tuple[Direction, Direction] = ("up", "down")


class CutRule(NamedTuple):
    """Cut where the `nth` packet of a direction `matches`, after `bytes_passed` of its bytes (None: all)."""

    direction: Direction
    matches: Callable[[Packet], bool]
    bytes_passed: int | None
    nth: int


class Connection:
    """A client and its own connection to the broker."""

    def __init__(self, number: int, client: socket.socket, broker: socket.socket) -> None:
        self.number = number
        self.links = (Link("up", client, broker), Link("down", broker, client))
        self.cut_at_s: float | None = None
        self.close_at_s: float | None = None

    def is_over(self) -> bool:
        """Return whether both sides have ended; the second one gets some time, since closing on unread bytes would reset the
        first."""
        for link in self.links:
            if link.ended and link.due_s is None and self.close_at_s is None:
                self.close_at_s = time.monotonic() + CLOSING_S_MAX
                with contextlib.suppress(OSError):
                    link.target.shutdown(socket.SHUT_WR)
        both = all(link.ended and link.due_s is None for link in self.links)
        return both or (self.close_at_s is not None and self.close_at_s <= time.monotonic())

    def close(self) -> None:
        """End both sides in the ordinary way."""
        for link in self.links:
            link.source.close()

    def abort(self) -> None:
        """End both sides with a reset: whatever is on its way is lost."""
        for link in self.links:
            link.source.setsockopt(socket.SOL_SOCKET, socket.SO_LINGER, struct.pack("ii", 1, 0))
        self.close()


class Proxy(Recording):
    """One thread moves all bytes; the methods hand it commands and return when they are done."""

    def __init__(self, upstream: tuple[str, int]) -> None:
        super().__init__()
        self.upstream = upstream
        # A socket that is bound and never listens keeps the port while connections are refused.
        self._holder = _bound(0)
        self.port: int = self._holder.getsockname()[1]
        self._listener = _bound(self.port)
        self._wake, self._woken = socket.socketpair()
        self._commands: queue.SimpleQueue[tuple[Callable[[], None], threading.Event]] = queue.SimpleQueue()
        self._connections: list[Connection] = []
        self._accepted = 0
        self._accepting = True
        self._delay_s: dict[Direction, float] = {"up": 0.0, "down": 0.0}
        self._stalled: set[Direction] = set()
        self._rules: list[CutRule] = []
        self._bytes_left: dict[Direction, int] = {}
        self._stopping = False
        self._failure: BaseException | None = None
        self._thread = threading.Thread(target=self._run, name="wire-proxy", daemon=True)

    def __enter__(self) -> Proxy:
        self._listener.listen(CONNECTIONS_MAX)
        self._thread.start()
        return self

    def __exit__(self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None) -> None:
        self._stopping = True
        with contextlib.suppress(OSError):
            self._wake.send(b"x")
        self._thread.join(COMMAND_S_MAX)
        assert not self._thread.is_alive(), "the proxy's thread hangs"
        if self._failure is not None and error is None:
            raise self._failure

    @property
    def address(self) -> tuple[str, int]:
        """Return where clients connect."""
        return ("127.0.0.1", self.port)

    @property
    def connections(self) -> int:
        """Return how many connections came in so far."""
        return self._accepted

    def cut(self) -> None:
        """Abort every connection with a TCP reset on both sides."""
        self._do(self._cut_all)

    def cut_when(
        self,
        matches: Callable[[Packet], bool],
        direction: Direction = "up",
        *,
        bytes_passed: int | None = None,
        count: int = 1,
    ) -> None:
        """Cut, once, at the `count`-th packet that matches from now on: behind it, or after `bytes_passed` of its bytes."""
        self._do(lambda: self._rules.append(CutRule(direction, matches, bytes_passed, count)))

    def cut_after_packets(self, count: int, direction: Direction = "up") -> None:
        """Cut, once, behind the `count`-th packet from now on."""
        self.cut_when(lambda _: True, direction, count=count)

    def cut_after_bytes(self, count: int, direction: Direction = "up") -> None:
        """Cut, once, after `count` more bytes, wherever in a packet that is."""
        self._do(lambda: self._bytes_left.__setitem__(direction, count))

    def delay(self, seconds: float, direction: Direction | None = None) -> None:
        """Let everything that arrives from now on wait before it goes on; 0 ends it."""
        self._do(lambda: self._delay_s.update(dict.fromkeys(_directions(direction), seconds)))

    def stall(self, direction: Direction | None = None) -> None:
        """Move no more bytes, as a network that has died without telling."""
        self._do(lambda: self._stalled.update(_directions(direction)))

    def resume(self) -> None:
        """Move bytes again."""
        self._do(self._stalled.clear)

    def refuse(self) -> None:
        """Let new connections be refused, as where no broker runs."""
        self._do(lambda: self._listen(accepting=False))

    def accept(self) -> None:
        """Take new connections again, on the same port."""
        self._do(lambda: self._listen(accepting=True))

    def _do(self, command: Callable[[], None]) -> None:
        done = threading.Event()
        self._commands.put((command, done))
        self._wake.send(b"x")
        if not done.wait(COMMAND_S_MAX):
            raise self._failure or TimeoutError("the proxy's thread did not take the command")

    def _listen(self, *, accepting: bool) -> None:
        if accepting and not self._accepting:
            self._listener = _bound(self.port)
            self._listener.listen(CONNECTIONS_MAX)
        elif self._accepting and not accepting:
            self._listener.close()
        self._accepting = accepting

    def _cut_all(self) -> None:
        for connection in self._connections:
            connection.abort()
        self._connections.clear()

    def _run(self) -> None:
        try:
            while not self._stopping:
                self._step()
        except BaseException as error:
            # Raised in the test's thread, where it can be seen.
            self._failure = error
        finally:
            for connection in self._connections:
                connection.abort()
            for other in (self._listener, self._holder, self._wake, self._woken):
                other.close()

    def _step(self) -> None:
        interest, timeout_s = self._interest()
        poller = select.poll()
        for fd, events in interest.items():
            poller.register(fd, events)
        ready = dict(poller.poll(None if timeout_s is None else timeout_s * 1000))
        if self._woken.fileno() in ready:
            self._woken.recv(READ_BYTES)
        while not self._commands.empty():
            command, done = self._commands.get()
            command()
            done.set()
        if self._accepting and self._listener.fileno() in ready:
            self._open()
        for connection in list(self._connections):
            if not self._advance(connection, ready):
                self._connections.remove(connection)

    def _interest(self) -> tuple[dict[int, int], float | None]:
        """The sockets to watch, and how long at most."""
        now_s = time.monotonic()
        interest = {self._woken.fileno(): select.POLLIN}
        if self._accepting and len(self._connections) < CONNECTIONS_MAX:
            interest[self._listener.fileno()] = select.POLLIN
        times_s = [at_s for c in self._connections for at_s in (c.cut_at_s, c.close_at_s) if at_s is not None]
        for connection in self._connections:
            for link in connection.links:
                if link.direction in self._stalled:
                    continue
                if link.wants_more and connection.cut_at_s is None:
                    interest[link.source.fileno()] = interest.get(link.source.fileno(), 0) | select.POLLIN
                if link.due_s is not None and link.due_s <= now_s:
                    interest[link.target.fileno()] = interest.get(link.target.fileno(), 0) | select.POLLOUT
                elif link.due_s is not None:
                    times_s.append(link.due_s)
        return interest, max(0.0, min(times_s) - now_s) + 0.001 if times_s else None

    def _open(self) -> None:
        client, _ = self._listener.accept()
        try:
            broker = socket.create_connection(self.upstream, timeout=COMMAND_S_MAX)
        except OSError:
            # The broker is down: the client learns it as it would without us.
            client.close()
            return
        for end in (client, broker):
            end.setblocking(False)
            end.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
        self._connections.append(Connection(self._accepted, client, broker))
        self._accepted += 1

    def _advance(self, connection: Connection, ready: dict[int, int]) -> bool:
        """Move the bytes of one connection; False when it is over."""
        if connection.cut_at_s is not None and connection.cut_at_s <= time.monotonic():
            connection.abort()
            return False
        for link in connection.links:
            if link.direction in self._stalled:
                continue
            reads = link.wants_more and connection.cut_at_s is None
            if reads and ready.get(link.source.fileno(), 0) & ~select.POLLOUT:
                self._read(connection, link)
            link.send_due()
        if connection.cut_at_s is None and connection.is_over():
            connection.close()
            return False
        return True

    def _read(self, connection: Connection, link: Link) -> None:
        try:
            data = link.source.recv(READ_BYTES)
        except BlockingIOError:
            return
        except OSError:
            # One side has reset the connection: the other one learns it the same way, behind what was said before.
            connection.cut_at_s = max(time.monotonic() + HEAD_START_S, link.last_due_s)
            return
        if data:
            self.add_bytes(connection.number, link.direction, data)
            pieces = link.take(data)
        else:
            link.ended = True
            pieces = link.rest()
        due_s = time.monotonic() + self._delay_s[link.direction]
        for packet, piece in pieces:
            passed = self._passed(link.direction, packet, piece)
            link.send_later(piece[:passed], due_s)
            if packet is not None:
                if isinstance(packet, Connect):
                    connection.links[1].reader.version = packet.version
                self.add_packet(connection.number, link.direction, packet)
            if passed is not None:
                connection.cut_at_s = due_s + HEAD_START_S
                return

    def _passed(self, direction: Direction, packet: Packet | None, piece: bytes) -> int | None:
        """Return how many bytes of a piece go on before a rule cuts the connection; None where no rule does."""
        for index, rule in enumerate(self._rules):
            if packet is not None and rule.direction == direction and rule.matches(packet):
                if rule.nth > 1:
                    self._rules[index] = rule._replace(nth=rule.nth - 1)
                    continue
                del self._rules[index]
                return len(piece) if rule.bytes_passed is None else rule.bytes_passed
        if direction in self._bytes_left:
            self._bytes_left[direction] -= len(piece)
            if self._bytes_left[direction] <= 0:
                return len(piece) + self._bytes_left.pop(direction)
        return None


def _bound(port: int) -> socket.socket:
    bound = socket.socket()
    bound.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
    bound.bind(("127.0.0.1", port))
    return bound


def _directions(direction: Direction | None) -> tuple[Direction, ...]:
    return BOTH if direction is None else (direction,)
