"""The only way by which telegrams reach a control, and the place where writing ends.

pyLSV2 stands on this in place of its own socket. Two things are guarded here, below everything that it may ever want to do:

* Reading only. A telegram leaves if it is on the list below, and no other. Of the settings (C_CC) only those pass that agree
  how long a telegram may be, of the log-ins only those that this edge needs, and T_OK only as the call for the next part of a
  file, of a list of signals or of a recording.
* Bounds. A telegram has at most `PAYLOAD_BYTES_MAX` bytes, whatever its header says; an answer is one that belongs to
  the question; all telegrams of one look together take no longer than the time that `begin` gives them, and are no more than
  `TELEGRAMS_MAX`. After anything else the connection is closed: LSV2 numbers nothing, so an answer that comes late would be
  taken for the next one.
"""

import errno
import os
import select
import socket
import struct
import threading
from collections.abc import Callable, Collection, Mapping
from contextlib import suppress
from enum import Enum
from types import MappingProxyType, ModuleType
from typing import Any

from edge.errors import ConnectionLostError, EdgeError

PAYLOAD_BYTES_MAX = 16_384
TELEGRAMS_MAX = 4096
STEP_S = 0.1
READS = {
    "A_LG": ("T_OK",),
    "A_LO": ("T_OK",),
    "C_CC": ("T_OK",),
    "R_VR": ("S_VR",),
    "R_PR": ("S_PR",),
    "R_CI": ("S_CI",),
    "R_RI": ("S_RI",),
    "R_MB": ("S_MB",),
    "R_DP": ("S_DP",),
    "R_FI": ("S_FI",),
    "R_FL": ("S_FL", "T_FD"),
    "R_DT": ("S_DT",),
    "T_OK": ("S_FL", "T_FD"),
}
SCOPE_READS = {"R_OC": ("S_OC",), "R_OP": ("S_OP",), "R_OD": ("S_OD",), "T_OK": ("S_FL", "S_OC", "S_OD", "T_FD")}
"""The telegrams of the oscilloscope: its signals, the selection of some, their values. Only for a link that is made for it."""
_MORE_COMES = ("S_FL", "S_OC", "S_OD")
_TELEGRAM_SIZES = frozenset(struct.pack("!H", number) for number in (3, 4, 5, 6, 7))
_REFUSALS = ("T_ER", "T_BD")


class WriteRefusedError(EdgeError):
    """Something tried to send a telegram that is not on the list of reads; nothing was sent."""


class ReadOnlyLink:
    """Takes the place of `pyLSV2.low_level_com.LSV2TCP`. `patience_s` is the longest wait for a byte in real time."""

    def __init__(
        self,
        host: str,
        port: int,
        *,
        logins: Collection[str],
        patience_s: float,
        clock: Callable[[], float],
        pylsv2: ModuleType,
        more_reads: Mapping[str, tuple[str, ...]] = MappingProxyType({}),
    ) -> None:
        self._address = host, port
        self._reads = READS | dict(more_reads)
        self._logins = frozenset(logins)
        self._patience_s, self._clock = patience_s, clock
        self._pylsv2: Any = pylsv2
        self._socket: socket.socket | None = None
        self._closed = threading.Event()
        self._deadline_s = clock() + patience_s
        self._telegrams = 0
        self._more_comes = False
        self.buffer_size = 256
        self.last_response: Any = self._pylsv2.const.RSP.NONE
        self.last_error: Any = self._pylsv2.dat_cls.LSV2Error()

    def begin(self, within_s: float) -> None:
        """Give what follows so long, all in all."""
        self._deadline_s = self._clock() + within_s
        self._telegrams = 0

    def connect(self) -> None:
        """Open the connection; OSError where there is none. It can be woken while it waits."""
        family, kind, protocol, _, address = socket.getaddrinfo(*self._address, type=socket.SOCK_STREAM)[0]
        opened = socket.socket(family, kind, protocol)
        try:
            opened.setblocking(False)
            _connect(opened, address, self._patience_s, self._closed)
            opened.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
        except OSError:
            opened.close()
            raise
        self._socket = opened
        if self._closed.is_set():  # it was called while the connection came about
            self.disconnect()

    def disconnect(self) -> None:
        """Close the connection, from the thread that uses it."""
        opened, self._socket = self._socket, None
        if opened is not None:
            opened.close()

    def wake(self) -> None:
        """End whatever is being waited for, from any thread."""
        self._closed.set()
        opened = self._socket
        if opened is not None:
            with suppress(OSError):
                opened.shutdown(socket.SHUT_RDWR)

    def telegram(self, command: str, payload: bytes | bytearray | None = b"", wait_for_response: bool = True) -> bytearray:
        """One question and its answer. This is the method that pyLSV2 calls."""
        word, data = str(command.value if isinstance(command, Enum) else command), bytes(payload or b"")
        self._check(word, data)
        opened = self._socket
        if opened is None:
            raise ConnectionLostError("the connection is not open")
        self._telegrams += 1
        try:
            if self._telegrams > TELEGRAMS_MAX:
                raise ConnectionLostError(f"more than {TELEGRAMS_MAX} telegrams in one look")
            answer, content = self._exchange(opened, word, data)
        except (OSError, ConnectionLostError) as error:
            self.disconnect()
            if isinstance(error, ConnectionLostError):
                raise
            why = f"no answer to {word}" if isinstance(error, TimeoutError) else f"{word}: {error}"
            raise ConnectionLostError(why) from error
        self._more_comes = answer in _MORE_COMES
        self._note(answer, content)
        return bytearray(content)

    def _check(self, word: str, data: bytes) -> None:
        passes = word in self._reads
        if word == "C_CC":
            passes = data in _TELEGRAM_SIZES
        elif word == "A_LG":
            passes = data.split(b"\x00")[0].decode("latin-1") in self._logins
        elif word == "T_OK":
            passes = self._more_comes and not data
        if not passes:
            raise WriteRefusedError(f"{word} {data[:8].hex()} is not on the list of telegrams that only read; it was not sent")
        if len(data) + 8 > self.buffer_size:
            raise ConnectionLostError(f"{word} of {len(data) + 8} bytes is above the {self.buffer_size} that were agreed")

    def _exchange(self, opened: socket.socket, word: str, data: bytes) -> tuple[str, bytes]:
        self._wait_at_most(opened)
        opened.sendall(struct.pack("!L", len(data)) + word.encode("ascii") + data)
        header = self._exactly(opened, 8)
        (length,) = struct.unpack_from("!L", header)
        answer = header[4:].decode("latin-1")
        if answer not in self._reads[word] and answer not in _REFUSALS:
            raise ConnectionLostError(f"answers {answer!r} to {word}, which is no LSV2")
        if length > PAYLOAD_BYTES_MAX:
            raise ConnectionLostError(f"announces {length} bytes in answer to {word}; the limit is {PAYLOAD_BYTES_MAX}")
        return answer, self._exactly(opened, length)

    def _exactly(self, opened: socket.socket, count: int) -> bytes:
        data = b""
        while len(data) < count:
            self._wait_at_most(opened)
            part = opened.recv(count - len(data))
            if not part:
                raise ConnectionLostError("the control closed the connection")
            data += part
        return data

    def _wait_at_most(self, opened: socket.socket) -> None:
        left_s = self._deadline_s - self._clock()
        if left_s <= 0:
            raise TimeoutError
        opened.settimeout(min(left_s, self._patience_s))

    def _note(self, answer: str, content: bytes) -> None:
        """Keep what pyLSV2 asks for after a telegram."""
        self.last_response = self._pylsv2.const.RSP(answer)
        self.last_error = self._pylsv2.dat_cls.LSV2Error()
        if answer in _REFUSALS:
            self.last_error.e_type, self.last_error.e_code = content if len(content) == 2 else (1, -1)


def _connect(opened: socket.socket, address: Any, patience_s: float, closed: threading.Event) -> None:
    """Connect in short steps, since nothing wakes a thread that waits for an address where nobody answers."""
    code = opened.connect_ex(address)
    steps = max(1, round(patience_s / STEP_S))
    while code in (errno.EINPROGRESS, errno.EWOULDBLOCK, errno.EALREADY):
        if steps <= 0 or closed.is_set():
            raise TimeoutError("timed out")
        steps -= 1
        if select.select((), (opened,), (), STEP_S)[1]:
            code = opened.getsockopt(socket.SOL_SOCKET, socket.SO_ERROR)
    if code:
        raise OSError(code, os.strerror(code))
