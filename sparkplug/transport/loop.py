"""One thread for many connections.

A thread that only waits for messages may as well fetch them: whoever calls `turn` does the loop's work itself, for all
connections, and what it sends between two turns goes out at the next one, with one call for each connection. Where nobody has
turned for DRIVEN_S the loop's own thread takes over, until somebody does again.
"""

import logging
import selectors
import socket
import threading
import time
from contextlib import suppress
from typing import Protocol

TICK_S = 0.2
DRIVEN_S = 0.05
_log = logging.getLogger(__name__)


class Served(Protocol):
    """A connection, as the loop sees it. The loop holds its lock in each call."""

    def ready(self, *, readable: bool, writable: bool) -> None:
        """Read or write what the socket has or takes."""

    def flush(self) -> None:
        """Write what is to be sent. Called by any thread that sends; it ends no connection."""

    def serve(self) -> None:
        """Write what is to be sent, and see whether the connection goes on."""

    def tick(self, now_s: float) -> None:
        """Do what is due."""


class Loop:
    """Serves connections from the first that is added to the last that is removed; it has a thread meanwhile."""

    def __init__(self, name: str = "mqtt") -> None:
        self.lock = threading.RLock()  # held by whoever calls a connection or paho
        self.due: set[Served] = set()  # they have something to send, or to end
        self._name = name
        self._served: dict[Served, None] = {}
        self._turning = threading.Lock()  # held by whoever turns, also while it waits
        self._in_charge = 0  # the thread that will turn next; what it sends can wait until then
        self._thread: threading.Thread | None = None
        self._asleep = self._is_driven = False
        self._driven_s = self._read_s = self._tick_s = 0.0
        self._rest = threading.Event()
        self._selector: selectors.BaseSelector | None = None
        self._wake_reader: socket.socket | None = None
        self._wake_writer: socket.socket | None = None

    # What a driver calls.

    def turn(self, timeout_s: float, gather_s: float = 0.0) -> bool:
        """Send what waits, wait until something comes, handle all that has come; False where another thread does it.

        gather_s: the least time between two readings; what comes meanwhile is handled together
        """
        if not self._claim():
            return False
        self._is_driven = True
        try:
            self._in_charge = threading.get_ident()
            if self._selector is None:
                return False
            self._serve_due()
            pause_s = min(self._read_s + gather_s - time.monotonic(), timeout_s)
            if gather_s > 0.0 and pause_s > 0.0:
                time.sleep(pause_s)
                timeout_s -= pause_s
            self._turn(timeout_s)
        finally:
            self._driven_s = time.monotonic()
            self._is_driven = False
            self._turning.release()
        return True

    def _claim(self) -> bool:
        if self._turning.acquire(blocking=False):
            return True
        if self._is_driven:
            return False
        self._driven_s = time.monotonic()  # has the loop's own thread step aside
        self._wake()
        return self._turning.acquire(timeout=DRIVEN_S)

    # What connections call.

    def add(self, served: Served) -> None:
        """Serve this connection from now on."""
        with self.lock:
            if self._selector is None:
                self._selector = selectors.DefaultSelector()
                self._wake_reader, self._wake_writer = socket.socketpair()
                self._wake_reader.setblocking(False)
                self._wake_writer.setblocking(False)
                self._selector.register(self._wake_reader, selectors.EVENT_READ, None)
            self._served[served] = None
            if self._thread is None:
                self._rest.clear()
                self._thread = threading.Thread(target=self._run, name=self._name, daemon=True)
                self._thread.start()

    def remove(self, served: Served) -> None:
        """Serve it no longer."""
        with self.lock:
            self._served.pop(served, None)
            self.due.discard(served)
            if not self._served:
                self._rest.set()
                self.nudge()

    def join(self, timeout_s: float) -> None:
        """Wait until the loop has ended, if it has nobody left to serve."""
        with self.lock:
            thread = None if self._served else self._thread
        if thread is not None and thread is not threading.current_thread():
            thread.join(timeout_s)

    def watch(self, descriptor: int, served: Served, *, for_writing: bool) -> None:
        """Tell a connection when this socket can be read, and written too where `for_writing`."""
        assert self._selector is not None, "a connection that is served has a selector"
        events = selectors.EVENT_READ | (selectors.EVENT_WRITE if for_writing else 0)
        if descriptor in self._selector.get_map():
            self._selector.modify(descriptor, events, served)
        else:
            self._selector.register(descriptor, events, served)
            self.nudge()

    def unwatch(self, descriptor: int) -> None:
        """Forget a socket that will be closed."""
        assert self._selector is not None, "a connection that is served has a selector"
        with suppress(KeyError):
            self._selector.unregister(descriptor)

    def push(self, served: Served, *, now: bool) -> None:
        """Have a connection write what it was given: at the next turn, or `now`, unless this thread turns next anyway.

        Where the loop's thread just waits, the caller writes to the socket itself: that saves waking a thread for each message.
        Where it does not, it finds the connection in `due` before it waits again.
        """
        self.due.add(served)
        if not now and self._in_charge == threading.get_ident():
            return
        if self.lock.acquire(blocking=False):
            try:
                self.due.discard(served)
                served.flush()
            finally:
                self.lock.release()
        if self.due:
            self.nudge()

    def at(self, due_s: float) -> None:
        """Have `tick` called then, at the latest."""
        self._tick_s = min(self._tick_s, due_s)

    def nudge(self) -> None:
        """Wake whoever waits for sockets, if that is another thread."""
        if self._asleep:
            self._wake()

    def _wake(self) -> None:
        writer = self._wake_writer
        if writer is not None:
            with suppress(OSError):  # the pipe is full or closed: the thread is awake or gone
                writer.send(b"w")

    # The work.

    def _run(self) -> None:
        while True:
            if self._turning.locked() or time.monotonic() - self._driven_s < DRIVEN_S:
                if not self._rest.wait(DRIVEN_S):
                    continue
                self._rest.clear()
            with self._turning:
                with self.lock:
                    if not self._served:
                        self._shut()
                        return
                self._in_charge = threading.get_ident()
                try:
                    self._serve_due()
                    self._turn(TICK_S)
                except Exception:
                    _log.exception("%s: the loop failed", self._name)  # a bug of ours; each connection guards its own
                    time.sleep(TICK_S)

    def _shut(self) -> None:
        assert self._selector and self._wake_reader and self._wake_writer
        self._selector.close()
        self._wake_reader.close()
        self._wake_writer.close()
        self._selector = self._wake_reader = self._wake_writer = self._thread = None

    def _serve_due(self) -> None:
        if self.due:
            with self.lock:
                while self.due:
                    self.due.pop().serve()

    def _turn(self, wait_s: float) -> None:
        assert self._selector is not None
        self._asleep = True
        try:
            # Whoever comes due before `_asleep` is set is seen here; who comes later wakes us.
            until_tick_s = max(self._tick_s - time.monotonic(), 0.0)
            ready = self._selector.select(0.0 if self.due else min(wait_s, until_tick_s))
        finally:
            self._asleep = False
        now_s = time.monotonic()
        with self.lock:
            for key, events in ready:
                if key.data is None:
                    self._quiet()
                else:
                    self._read_s = now_s
                    readable, writable = events & selectors.EVENT_READ, events & selectors.EVENT_WRITE
                    key.data.ready(readable=bool(readable), writable=bool(writable))
            if now_s >= self._tick_s:
                self._tick_s = now_s + TICK_S
                for served in list(self._served):
                    served.tick(now_s)

    def _quiet(self) -> None:
        assert self._wake_reader is not None
        with suppress(BlockingIOError):
            while self._wake_reader.recv(4096):
                pass
