"""The backend that speaks the Ethernet protocol itself: one TCP connection, several calls in one frame. Experimental.

What goes into one frame is one moment of the control. It only ever sends the commands of `edge.controls.focas.answers`, all of
which read.
"""

import socket
import time
from collections.abc import Callable, Sequence

from edge.controls.focas import answers, wire
from edge.controls.focas.answers import Exchange
from edge.controls.focas.calls import Answer, Identity, Opened, Request
from edge.controls.focas.config import FocasConfig
from edge.controls.focas.policy import HANDLE, NUMBER, PROTOCOL, SOCKET
from edge.controls.focas.wire import Block, Reply
from edge.errors import DocumentError

CONNECT_S_MAX = 0.9  # nothing wakes a connect, and `close` has to end within a second
ANSWER_BYTES_MAX = 1400  # older controls do not answer with more than 1450 bytes in one frame


class _RefusedError(DocumentError):
    """The control answers that it will not answer this frame."""


class EthernetBackend:
    """A client of one control."""

    def __init__(self, config: FocasConfig, *, clock: Callable[[], float] = time.monotonic) -> None:
        self._config = config
        self._clock = clock  # of the sockets: real seconds
        self._socket: socket.socket | None = None
        self._identity = Identity()
        self._alone: frozenset[Block] = frozenset()  # blocks for which the control refuses the whole frame

    def open(self) -> Opened:
        """Connect, take a session, ask who is there."""
        self.close()
        config = self._config
        try:
            self._socket = socket.create_connection((config.host, config.port), min(config.timeout_s, CONNECT_S_MAX))
            self._socket.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
            head, _ = self._exchange(wire.frame(wire.OPEN, b"\x00\x02"))
            if head.type == wire.REFUSED:
                self.close()
                return Opened(HANDLE, why="the control refuses the session: all of its sessions are in use")
            if head.type != wire.OPENED:
                raise DocumentError(f"a frame of type {head.type:04x} in place of the session")
            self._identity = answers.identity(self._asked(answers.IDENTITY_BLOCKS))
            return Opened(0, self._identity)
        except OSError as error:
            self.close()
            return Opened(SOCKET, why=str(error) or type(error).__name__)
        except DocumentError as error:
            self.close()
            return Opened(PROTOCOL, why=str(error))

    def ask(self, requests: Sequence[Request]) -> tuple[Answer, ...]:
        """All of them, in as few frames as the control can answer."""
        plans = [answers.exchange(request, self._config.path) for request in requests]
        found: dict[int, Answer] = {}
        try:
            for group in _packed([(at, plan) for at, plan in enumerate(plans) if plan is not None], self._alone):
                found |= self._group(requests, group)
        except OSError:
            return self._gone(requests, SOCKET)
        except DocumentError:
            return self._gone(requests, PROTOCOL)
        return tuple(found.get(at, answers.unknown()) for at in range(len(requests)))

    def close(self) -> None:
        """End the session and the connection; a read that is blocked in another thread is woken."""
        open_socket, self._socket = self._socket, None
        if open_socket is None:
            return
        try:
            open_socket.settimeout(0.2)
            open_socket.sendall(wire.frame(wire.CLOSE))
            open_socket.shutdown(socket.SHUT_RDWR)
        except OSError:
            pass  # it is gone already
        finally:
            open_socket.close()

    def _gone(self, requests: Sequence[Request], code: int) -> tuple[Answer, ...]:
        self.close()
        return tuple(Answer(code) for _ in requests)

    def _group(self, requests: Sequence[Request], group: Sequence[tuple[int, Exchange]]) -> dict[int, Answer]:
        try:
            replies = self._asked(tuple(block for _, plan in group for block in plan.blocks))
        except _RefusedError:
            if len(group) == 1:
                self._alone |= frozenset(group[0][1].blocks)
                return {group[0][0]: Answer(NUMBER)}
            return {at: one for entry in group for at, one in self._group(requests, [entry]).items()}
        done, first = dict[int, Answer](), 0
        for at, plan in group:
            own = replies[first : first + len(plan.blocks)]
            done[at] = answers.answer(requests[at], plan, own, self._identity)
            first += len(plan.blocks)
        return done

    def _asked(self, blocks: Sequence[Block]) -> tuple[Reply, ...]:
        head, body = self._exchange(wire.request(blocks, self._config.path))
        if head.type == wire.ANSWER_REFUSED:
            raise _RefusedError(f"refused with {wire.refusal(body)}")
        if head.type != wire.ANSWER:
            raise DocumentError(f"a frame of type {head.type:04x} in place of an answer")
        return wire.replies(blocks, body, self._config.path)

    def _exchange(self, frame: bytes) -> tuple[wire.Header, bytes]:
        """One question and its answer, all within the timeout."""
        open_socket = self._socket
        if open_socket is None:
            raise OSError("the connection is closed")
        until_s = self._clock() + self._config.timeout_s
        open_socket.settimeout(self._config.timeout_s)
        open_socket.sendall(frame)
        head = wire.header(self._read(open_socket, wire.HEADER_BYTES, until_s))
        return head, self._read(open_socket, head.length, until_s)

    def _read(self, open_socket: socket.socket, length: int, until_s: float) -> bytes:
        data = b""
        while len(data) < length:
            left_s = until_s - self._clock()
            if left_s <= 0:
                raise TimeoutError(f"no answer within {self._config.timeout_s:g} s")
            open_socket.settimeout(left_s)
            more = open_socket.recv(length - len(data))
            if not more:
                raise ConnectionResetError("the control closed the connection")
            data += more
        return data


def _packed(plans: Sequence[tuple[int, Exchange]], alone: frozenset[Block]) -> list[list[tuple[int, Exchange]]]:
    """The calls in groups that fit into one answer, in their order; those that stand alone come last."""
    groups: list[list[tuple[int, Exchange]]] = []
    size = ANSWER_BYTES_MAX
    for entry in plans:
        if alone & set(entry[1].blocks):
            continue
        if not groups or size + entry[1].answer_bytes > ANSWER_BYTES_MAX:
            groups.append([])
            size = 2
        groups[-1].append(entry)
        size += entry[1].answer_bytes
    return groups + [[entry] for entry in plans if alone & set(entry[1].blocks)]
