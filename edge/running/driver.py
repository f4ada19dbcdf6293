"""The thread that all edges of a process share: it reads what their controls stream, and gives each edge its turns.

    streams ──readable──► the edge that watches it: frames → … → store → broker
    clock ────each tenth of a second──► each edge's turn: what is due in the store, the sensor, the health
    brokers ◄── `loop`: the connections of all edges, once in each round

Threads that hand the interpreter to each other cost more than the work that they do: fifty machines at 10 Hz in a hundred threads
took a core where one thread takes a fifth. So a frame goes all its way in this thread. It waits `GATHER_S` after each look, and
takes what several machines have sent meanwhile at once. It never blocks: what blocks (connecting, controls that have to be asked)
is in threads of the edges' own.
"""

import logging
import select
import socket
import threading
import time
from collections import deque
from collections.abc import Callable
from contextlib import suppress
from functools import partial
from typing import Protocol

from edge.adapter import Wait
from sparkplug.transport.loop import Loop

TURN_S = 0.1
GATHER_S = 0.02
STOP_S_MAX = 5.0
_log = logging.getLogger(__name__)


class Turning(Protocol):
    """An edge that has turns. It raises nothing."""

    def turn(self) -> float:
        """Do what is due; the seconds until the next turn."""


class Watching(Protocol):
    """A reader that goes on when its socket can be read. It raises nothing."""

    def resume(self) -> Wait | None:
        """Go on; the next wait, of no seconds where there is more, None where the reader goes on by itself."""


class Driver:
    """Between `start` and `stop` it serves whoever was added. `loop`: for the edges' connections to their brokers."""

    def __init__(self) -> None:
        self._asked: deque[Callable[[], None]] = deque()  # by other threads; done by ours, which alone touches the tables
        self._turns: dict[Turning, float] = {}  # and when each is due
        self._watched: dict[int, tuple[Watching, float]] = {}  # by descriptor; and until when each waits
        self._next_s = 0.0
        self._poll = select.epoll()
        self._wake_reader, self._wake_writer = socket.socketpair()
        self._wake_reader.setblocking(False)
        self._wake_writer.setblocking(False)
        self._poll.register(self._wake_reader, select.EPOLLIN)
        self.loop = Loop("edges mqtt")
        self._is_over = self._has_more = False
        self._thread = threading.Thread(target=self._run, name="edges", daemon=True)

    def start(self) -> None:
        """Begin."""
        self._thread.start()

    def stop(self) -> None:
        """End the thread; the edges have to be removed before."""
        self._is_over = True
        self._wake()
        self._thread.join(STOP_S_MAX)
        if self._thread.is_alive():
            _log.warning("the thread of the edges does not end; it is left behind")
            return
        self._poll.close()
        self._wake_reader.close()
        self._wake_writer.close()

    def add(self, edge: Turning) -> None:
        """Give this edge turns from now on."""
        self._ask(partial(self._add, edge))

    def remove(self, edge: Turning) -> None:
        """No more turns; none is under way when this returns."""
        is_done = threading.Event()

        def removed() -> None:
            self._turns.pop(edge, None)
            is_done.set()

        self._ask(removed)
        while self._thread.is_alive() and not is_done.wait(TURN_S):
            pass

    def watch(self, reader: Watching, wait: Wait) -> None:
        """Resume this reader when its socket can be read."""
        self._ask(partial(self._watch, reader, wait))

    def _run(self) -> None:
        while not self._is_over:
            now_s = time.monotonic()
            events = self._poll.poll(0.0 if self._has_more else min(max(self._next_s - now_s, 0.0), TURN_S))
            self._has_more = False
            while self._asked:
                self._asked.popleft()()
            for descriptor, _ in events:
                self._resume(descriptor)
            self._take_turns()
            self.loop.turn(0.0)  # what was sent goes out, and what the brokers say is heard
            if events and not self._has_more:
                time.sleep(GATHER_S)

    def _add(self, edge: Turning) -> None:
        # Not all at one moment: what an edge does once a second would hold up the others.
        self._turns[edge] = time.monotonic() + GATHER_S * (len(self._turns) % round(TURN_S / GATHER_S))

    def _watch(self, reader: Watching, wait: Wait) -> None:
        assert wait.sock is not None
        descriptor = wait.sock.fileno()
        self._poll.register(descriptor, select.EPOLLIN)
        self._watched[descriptor] = reader, time.monotonic() + wait.seconds

    def _resume(self, descriptor: int) -> None:
        watched = self._watched.get(descriptor)
        if watched is None:  # somebody wakes us
            with suppress(BlockingIOError):
                while self._wake_reader.recv(4096):
                    pass
            return
        wait = watched[0].resume()
        if wait is not None:
            self._has_more |= wait.seconds <= 0.0
            self._watched[descriptor] = watched[0], time.monotonic() + wait.seconds
            return
        del self._watched[descriptor]
        with suppress(OSError):  # who closes a socket takes it out
            self._poll.unregister(descriptor)

    def _take_turns(self) -> None:
        now_s = time.monotonic()
        for edge, due_s in list(self._turns.items()):
            if due_s <= now_s:
                self._turns[edge] = now_s + edge.turn()
        self._next_s = min(self._turns.values(), default=now_s + TURN_S)
        for descriptor, (_, until_s) in list(self._watched.items()):
            if until_s <= now_s:
                self._resume(descriptor)

    def _ask(self, what: Callable[[], None]) -> None:
        self._asked.append(what)
        self._wake()

    def _wake(self) -> None:
        with suppress(OSError):  # full: it is awake
            self._wake_writer.send(b"w")
