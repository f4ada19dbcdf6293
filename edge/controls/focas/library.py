"""The backend that uses the user's own FOCAS library, in a process of its own.

A library that crashes takes its process with it and not the gateway of all other machines; one that hangs is killed when its time
is over. Both count as EW_SOCKET: the handle is made again. Between the two processes go frames of u32 length and JSON.
"""

import json
import os
import select
import struct
import subprocess
import sys
import threading
import time
from collections.abc import Callable, Sequence
from contextlib import suppress
from typing import Any

from edge.controls.focas.calls import Answer, FocasValue, Identity, Opened, Request
from edge.controls.focas.config import FocasConfig
from edge.controls.focas.policy import PROTOCOL, SOCKET

FRAME_BYTES_MAX = 1024 * 1024
START_S = 5.0  # for the process itself, besides the library's own timeout
_LENGTH = struct.Struct(">I")


class LibraryBackend:
    """A child process with the library in it."""

    def __init__(self, config: FocasConfig, *, clock: Callable[[], float] = time.monotonic) -> None:
        self._config = config
        self._clock = clock  # of the pipes: real seconds
        self._child: subprocess.Popen[bytes] | None = None
        self._busy = threading.Lock()  # held while the pipes are in use, so that nobody closes one under a reader

    def open(self) -> Opened:
        """Start the process, load the library, make a handle."""
        self.close()
        config = self._config
        command = [sys.executable, "-m", "edge.controls.focas.library_process"]
        try:
            self._child = subprocess.Popen(command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, bufsize=0)
            wanted = {
                "library": config.library,
                "host": config.host,
                "port": config.port,
                "path": config.path,
                "timeout_s": max(1, round(config.timeout_s)),
            }
            told = self._exchange({"open": wanted}, START_S + config.timeout_s)
            code = int(told["code"])
            if code != 0:
                self.close()
                return Opened(code, why=str(told.get("why", "")))
            identity = told["identity"]
            cnc_type, mt_type, series, version = (str(word) for word in identity[:4])
            return Opened(0, Identity(cnc_type, mt_type, series, version, tuple(str(axis) for axis in identity[4])))
        except OSError as error:
            return Opened(SOCKET, why=self._ended(error))
        except (ValueError, TypeError, KeyError, IndexError) as error:
            self.close()
            return Opened(PROTOCOL, why=f"the library's process answers wrongly: {error}")

    def ask(self, requests: Sequence[Request]) -> tuple[Answer, ...]:
        """All calls, one after the other in the other process, within one timeout."""
        try:
            told = self._exchange({"ask": requests}, self._config.timeout_s)
            return tuple(Answer(int(code), tuple(_found(*one) for one in found)) for code, found in told["answers"])
        except OSError:
            self.close()
            return tuple(Answer(SOCKET) for _ in requests)
        except (ValueError, TypeError, KeyError):
            self.close()
            return tuple(Answer(PROTOCOL) for _ in requests)

    def close(self) -> None:
        """End the process, and with it the handle. It is given a moment to free it."""
        child, self._child = self._child, None
        if child is None:
            return
        if child.stdin is not None:
            child.stdin.close()  # it frees the handle and ends
        try:
            child.wait(0.3)
        except subprocess.TimeoutExpired:
            child.kill()
            child.wait()
        with self._busy:
            if child.stdout is not None:
                child.stdout.close()

    def _ended(self, error: OSError) -> str:
        child = self._child
        code = None
        if child is not None and isinstance(error, ConnectionError):  # its pipe ended a moment before it does
            with suppress(subprocess.TimeoutExpired):
                code = child.wait(1.0)
        self.close()
        if code is None:
            return str(error)
        return f"the library's process ended by signal {-code}" if code < 0 else f"the library's process ended with {code}"

    def _exchange(self, message: Any, timeout_s: float) -> Any:
        child = self._child
        if child is None or child.stdin is None or child.stdout is None:
            raise ConnectionResetError("the library's process is closed")
        until_s = self._clock() + timeout_s
        with self._busy:
            child.stdin.write(packed(message))
            length = _LENGTH.unpack(self._read(child.stdout.fileno(), _LENGTH.size, until_s))[0]
            if length > FRAME_BYTES_MAX:
                raise ValueError(f"a frame of {length} bytes is above the limit of {FRAME_BYTES_MAX}")
            return json.loads(self._read(child.stdout.fileno(), length, until_s))

    def _read(self, pipe: int, length: int, until_s: float) -> bytes:
        data = b""
        while len(data) < length:
            left_s = until_s - self._clock()
            if left_s <= 0 or not select.select([pipe], [], [], left_s)[0]:
                raise TimeoutError("the library did not come back in time")
            more = os.read(pipe, length - len(data))
            if not more:
                raise ConnectionResetError("the library's process ended")
            data += more
        return data


def packed(message: Any) -> bytes:
    """A frame for the pipe.

    >>> packed({"ask": []})
    b'\\x00\\x00\\x00\\x0b{"ask": []}'
    """
    body = json.dumps(message).encode()
    return _LENGTH.pack(len(body)) + body


def _found(key: Any, value: Any, code: Any) -> FocasValue:
    if not isinstance(key, str) or not isinstance(value, str | int | float | bool | None):
        raise TypeError(f"no fact: {key!r}")
    return FocasValue(key, value, int(code))
