"""A reader changes threads with its connection: its own while that blocks, the driver's while it streams."""

import socket
import threading
import time
from collections.abc import Iterator
from typing import Any

from edge.adapter import Connection, Wait
from edge.running.driver import Driver
from edge.running.reader import Reader


class Plain:
    """A connection that blocks, and says nothing of it."""

    def __init__(self, *frames: bytes | BaseException) -> None:
        self.reconnects, self.last_error = 0, ""
        self._frames = frames

    def frames(self) -> Iterator[bytes]:
        for frame in self._frames:
            if isinstance(frame, BaseException):
                raise frame
            yield frame

    def follow(self, cursor: Any) -> None:
        """It sends what it sends."""

    def silent_s(self) -> float:
        return 0.0

    def close(self) -> None:
        """It ends by itself."""


class Stepped(Plain):
    """A connection that connects, streams what its socket gives, and connects again; each part is told with its thread."""

    def __init__(self, sock: socket.socket) -> None:
        super().__init__()
        self._sock = sock
        sock.setblocking(False)

    def steps(self) -> Iterator[bytes | Wait]:
        yield b"connected"
        while (data := self._received()) != b"":
            yield Wait(self._sock, 60.0) if data is None else data
        yield Wait(None)
        yield b"connected again"

    def _received(self) -> bytes | None:
        try:
            return self._sock.recv(100)
        except BlockingIOError:
            return None


class Notes:
    """The frames with their threads, and the end."""

    def __init__(self) -> None:
        self.frames: list[tuple[bytes, str]] = []
        self.errors: list[BaseException | None] = []
        self.is_over = threading.Event()

    def take(self, raw: bytes) -> None:
        if raw == b"bug":
            raise RuntimeError("a bug")
        self.frames.append((raw, threading.current_thread().name))

    def ended(self, error: BaseException | None) -> None:
        self.errors.append(error)
        self.is_over.set()


def read(connection: Connection, driver: Driver) -> tuple[Notes, Reader]:
    notes = Notes()
    reader = Reader("x", connection, driver, notes.take, notes.ended)
    reader.start()
    return notes, reader


def test_a_connection_that_blocks_is_read_in_a_thread_of_its_own(driver: Driver) -> None:
    notes, reader = read(Plain(b"a", b"b"), driver)
    assert notes.is_over.wait(20)
    reader.join(20)
    assert notes.frames == [(b"a", "x-reader"), (b"b", "x-reader")]
    assert notes.errors == [None]


def test_an_error_ends_it_and_is_told_once(driver: Driver) -> None:
    notes, _ = read(Plain(b"a", OSError("gone"), b"b"), driver)
    assert notes.is_over.wait(20)
    assert (len(notes.frames), [str(error) for error in notes.errors]) == (1, ["gone"])


def test_a_stream_is_read_in_the_drivers_thread_and_what_blocks_is_not(driver: Driver) -> None:
    ours, theirs = socket.socketpair()
    with ours, theirs:
        notes, reader = read(Stepped(ours), driver)
        while (b"part", "edges") not in notes.frames:  # the first may come before its own thread has to wait
            theirs.send(b"part")
            time.sleep(0.01)
        theirs.close()
        assert notes.is_over.wait(20)
        reader.join(20)
    assert (notes.frames[0], notes.frames[-1]) == ((b"connected", "x-reader"), (b"connected again", "x-reader"))
    parts = [thread for raw, thread in notes.frames if raw == b"part"]
    assert parts == sorted(parts, reverse=True), "and from the first wait on it is the driver's"
    assert notes.errors == [None]


def test_an_error_of_ours_in_the_drivers_thread_ends_this_reader_only(driver: Driver) -> None:
    ours, theirs = socket.socketpair()
    with ours, theirs:
        notes, _ = read(Stepped(ours), driver)
        while not notes.frames:
            time.sleep(0.005)
        time.sleep(0.05)
        theirs.send(b"bug")
        assert notes.is_over.wait(20)
        assert [str(error) for error in notes.errors] == ["a bug"]
        other, _ = read(Plain(b"a"), driver)
        assert other.is_over.wait(20)


class Flood(Plain):
    """A connection whose socket gives more than can be taken."""

    def __init__(self, sock: socket.socket) -> None:
        super().__init__()
        self._sock, self.is_closed = sock, False

    def steps(self) -> Iterator[bytes | Wait]:
        yield Wait(self._sock, 60.0)
        while not self.is_closed:
            time.sleep(0.001)
            yield b"more"


def test_a_control_that_floods_does_not_keep_the_driver_from_the_others(driver: Driver) -> None:
    """It goes on all the while, and its neighbour's messages are taken as they come."""
    pairs = [socket.socketpair() for _ in range(2)]
    (flooded, floods), (ours, theirs) = pairs
    flood = Flood(flooded)
    try:
        floods.send(b"x")
        flood_notes, flood_reader = read(flood, driver)
        while len(flood_notes.frames) < 5:
            time.sleep(0.01)
        notes, reader = read(Stepped(ours), driver)
        for number in range(1, 20):
            before = len(flood_notes.frames)
            theirs.send(b"part")
            deadline_s = time.monotonic() + 20
            while len(notes.frames) <= number or len(flood_notes.frames) == before:
                assert time.monotonic() < deadline_s, "the neighbour waits for a flood that has no end"
                time.sleep(0.001)
        theirs.close()
        flood.is_closed = True
        assert notes.is_over.wait(20) and flood_notes.is_over.wait(20)
        reader.join(20)
        flood_reader.join(20)
    finally:
        flood.is_closed = True
        for pair in pairs:
            for sock in pair:
                sock.close()
