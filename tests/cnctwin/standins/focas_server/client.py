"""A client that only moves bytes: it sends frames as they are, and takes whole frames apart by their lengths."""

import socket
import struct
from dataclasses import dataclass
from types import TracebackType
from typing import Self

from tests.cnctwin.standins.focas_server import captured


@dataclass(frozen=True)
class Block:
    """One block of an answer."""

    device: int
    command: int
    code: int
    data: bytes


class RawClient:
    """A connection; open for commands unless told otherwise."""

    def __init__(self, port: int, *, is_opened: bool = True, timeout_s: float = 30.0) -> None:
        self.socket = socket.create_connection(("127.0.0.1", port), timeout=timeout_s)
        try:
            self.opened = self.exchange(captured.OPEN_FOR_COMMANDS) if is_opened else b""
        except OSError:
            self.socket.close()
            raise

    def __enter__(self) -> Self:
        return self

    def __exit__(self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None) -> None:
        self.socket.close()

    def exchange(self, raw: bytes) -> bytes:
        """Send a frame and take the one that comes; empty where the connection ends."""
        self.socket.sendall(raw)
        return self.take()

    def take(self) -> bytes:
        head = self._read(10)
        return head + self._read(int.from_bytes(head[8:10], "big")) if len(head) == 10 else b""

    def is_hung_up(self) -> bool:
        """Return whether the server has closed the connection."""
        try:
            return self.socket.recv(1) == b""
        except ConnectionResetError:
            return True

    def _read(self, length: int) -> bytes:
        taken = b""
        while len(taken) < length:
            part = self.socket.recv(length - len(taken))
            if not part:
                return taken
            taken += part
        return taken


def command(*asked: tuple[int, ...]) -> bytes:
    """A frame that asks for these: (class, function, arguments…)."""
    blocks = b""
    for device, function, *arguments in asked:
        a, b, c, d = (*arguments, 0, 0, 0, 0)[:4]
        blocks += struct.pack(">HHHHiiiiHH", 28, device, 1, function, a, b, c, d, 0, 0)
    body = struct.pack(">H", len(asked)) + blocks
    return b"\xa0\xa0\xa0\xa0" + struct.pack(">HHH", 1, 0x2101, len(body)) + body


def blocks(raw: bytes) -> list[Block]:
    """The blocks of an answer, by their lengths."""
    number, at = struct.unpack(">H", raw[10:12])[0], 12
    found: list[Block] = []
    for _ in range(number):
        length, device, _path, function, code, _, _, size = struct.unpack_from(">HHHHhhhH", raw, at)
        assert length == 16 + size
        found.append(Block(device, function, code, raw[at + 16 : at + length]))
        at += length
    assert at == len(raw)
    return found


def ask(client: RawClient, *asked: tuple[int, ...]) -> list[Block]:
    """Ask for these in one frame."""
    return blocks(client.exchange(command(*asked)))
