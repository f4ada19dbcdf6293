"""One client of the server: its frames are read, answered from one moment each, and spoiled where a fault is switched on."""

import random
import socket
import threading
from collections.abc import Callable
from dataclasses import dataclass, field

from cnctwin.standins.focas_server import functions
from cnctwin.standins.focas_server.faults import Faults, spoiled
from cnctwin.standins.focas_server.frames import (
    ANSWER_BLOCK_BYTES,
    BODY_BYTES_MAX,
    HEADER_BYTES,
    Code,
    FrameError,
    FrameType,
    Request,
    answer,
    answer_block,
    frame,
    header,
    requests,
)
from cnctwin.standins.focas_server.ledger import ServerLedger
from cnctwin.standins.focas_server.shown import Moment

IDLE_S_MAX = 300.0
HANG_LOOK_S = 0.01
COMMANDS = 2
"""A client's word at the open that wants to send commands; 1 wants to transfer files, which this server does not have."""


@dataclass
class Session:
    """A connection. `is_admitted` says whether a session is free, when the client opens one."""

    connection: socket.socket
    moment: Callable[[], Moment]
    faults: Faults
    ledger: ServerLedger
    stop: threading.Event
    is_admitted: Callable[["Session"], bool]
    chance: random.Random = field(default_factory=lambda: random.Random(0))  # noqa: S311 - which wrong bytes, not a secret
    is_open: bool = False
    takes_commands: bool = False

    def run(self) -> None:
        """Serve until the client closes, breaks off or sends what is no frame, or the server stops."""
        with self.connection:
            try:
                self.connection.settimeout(IDLE_S_MAX)
                self.connection.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
                while not self.stop.is_set() and self._once():
                    pass
            except FrameError:
                self.ledger.count("malformed")
            except OSError:
                self.ledger.count("broken off")
            finally:
                self.is_open = False

    def _once(self) -> bool:
        """Take and answer one frame; whether there may be another."""
        head = self._read(HEADER_BYTES)
        if head is None:
            return False
        kind, length = header(head)
        body = self._read(length)
        if body is None:
            return False
        self.ledger.count("frames")
        if kind == FrameType.OPEN and not self.is_open:
            return self._open(body)
        if kind == FrameType.CLOSE:
            self._send(frame(FrameType.CLOSED))
            return False
        if kind != FrameType.COMMAND or not self.takes_commands:
            raise FrameError(f"a frame of type {kind:04x} is not served")
        raw = answer(self._answers(requests(body)))
        self._send(raw if self.faults.wrong is None else spoiled(raw, self.faults.wrong, self.chance))
        return True

    def _open(self, body: bytes) -> bool:
        if not self.is_admitted(self):
            self.ledger.count("sessions refused")
            self._send(frame(FrameType.OPEN_REFUSED, bytes.fromhex("0000000200000000")))
            return False
        self.is_open = True
        self.takes_commands = int.from_bytes(body, "big") >= COMMANDS
        self._send(frame(FrameType.OPENED, _opened(self.moment())))
        return True

    def _answers(self, asked: list[Request]) -> list[bytes]:
        """The blocks of the answer; one that has no room left in the frame says that the length is wrong."""
        moment, blocks, room = self.moment(), list[bytes](), BODY_BYTES_MAX - 2 - ANSWER_BLOCK_BYTES * len(asked)
        for request in asked:
            data, code = self._answer(moment, request)
            if len(data) > room:
                data, code = b"", Code.LENGTH
            room -= len(data)
            blocks.append(answer_block(request, data, code))
            self._count(request, code)
        return blocks

    def _answer(self, moment: Moment, request: Request) -> tuple[bytes, int]:
        failed = self.faults.failing.get((request.device, request.command))
        if failed is not None:
            return b"", failed
        given = functions.answer(moment, request)
        return (b"", given) if isinstance(given, Code) else (given, Code.OK)

    def _count(self, request: Request, code: int) -> None:
        if code == Code.OK:
            self.ledger.count("asked", "answered")
        elif (request.device, request.command) in functions.WRITES:
            self.ledger.count("asked", "refused", f"refused/{code}", "refused/write")
        else:
            self.ledger.count("asked", "refused", f"refused/{code}")

    def _read(self, length: int) -> bytes | None:
        """So many bytes; None where the client has gone."""
        taken = bytearray()
        while len(taken) < length:
            part = self.connection.recv(length - len(taken))
            if not part:
                return None
            taken += part
        return bytes(taken)

    def _send(self, raw: bytes) -> None:
        faults = self.faults
        while faults.hang and not self.stop.wait(HANG_LOOK_S):
            pass
        if faults.delay_s:
            self.stop.wait(faults.delay_s)
        if self.stop.is_set():
            raise ConnectionAbortedError("the server stops")
        if faults.drop_after_bytes is not None:
            self.connection.sendall(raw[: faults.drop_after_bytes])
            raise ConnectionAbortedError("the answer was broken off on purpose")
        self.connection.sendall(raw)


def _opened(moment: Moment) -> bytes:
    """Return a 0i-M's answer to an open request (captured; 40 bytes, then 10 records of 32, one for each path), with our axes."""
    axes = len(moment.description.axis_names)
    head = bytes.fromhex("000600050001002000 08000a0003000300020002 00000001000100000001 00000000000000000000")
    path = moment.description.mt_type.encode("ascii") + b"".join(n.to_bytes(2, "big") for n in (1, 0, axes, axes, 0, 1, 1))
    return head + path.ljust(320, b"\0")
