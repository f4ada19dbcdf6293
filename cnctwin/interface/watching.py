"""The rows of a machine as they come from the broker, for a `for` or an `async for`.

A thread polls the host session (`cnctwin.plant.watch.viewer`, as the page and `cnctwin watch` have it) and puts rows into a queue
of limited length. Whoever reads too slowly loses the oldest ones, and the count of them stands in `counts`.
"""

import asyncio
import threading
import time
from collections import deque
from contextlib import suppress
from types import TracebackType
from typing import Self

from cnctwin.errors import UsageError
from cnctwin.interface.errors import BrokerError, one_tree
from cnctwin.interface.row import Row, Rows
from cnctwin.plant.watch import viewer
from cnctwin.processes.given_broker import BROKER_VARIABLE, address
from sparkplug.broker import BrokerAddress

POLL_S = 0.1
Waiter = tuple[asyncio.AbstractEventLoop, asyncio.Future[None]]


class Watch:
    """The rows of a machine, from now on; `close`, or the end of a `with`, ends the connection and every loop over it."""

    def __init__(self, broker: BrokerAddress, machine: str, group: str, queue_max: int, patience_s: float | None) -> None:
        self.machine, self.broker = machine, broker.url
        self._patience_s, self._queue_max = patience_s, queue_max
        self._rows = Rows(machine)
        self._queue: deque[Row] = deque()
        self._received = self._emitted = self._dropped = 0
        self._changed = threading.Condition()
        self._waiting: list[Waiter] = []
        self._seen: set[str] = set()
        self._stop = threading.Event()
        self._failure: Exception | None = None
        with one_tree():
            self._host = viewer(broker, group)
            self._host.start()
        self._thread = threading.Thread(target=self._run, name=f"watch-{machine}", daemon=True)
        self._thread.start()

    @property
    def counts(self) -> dict[str, int]:
        """received = emitted + dropped + buffered, in rows; lost: messages of any machine that were never read."""
        with self._changed:
            told = {"received": self._received, "emitted": self._emitted, "dropped": self._dropped, "buffered": len(self._queue)}
        return told | {"lost": self._host.dropped}

    @property
    def trouble(self) -> str:
        """Why there is no connection; empty while there is one."""
        return "" if self._host.online else self._host.last_error or f"no connection to {self.broker} yet"

    def read(self, timeout_s: float | None = None) -> Row | None:
        """The next row; None where none came in time, or it is closed. Raises what has ended the connection."""
        with self._changed:
            self._changed.wait_for(self._has_news, timeout_s)
            return self._taken()

    def close(self) -> None:
        """Disconnect; rows that wait are dropped and counted. Twice does no harm."""
        self._stop.set()
        self._thread.join()
        with self._changed:
            self._dropped += len(self._queue)
            self._queue.clear()

    def __enter__(self) -> Self:
        return self

    def __exit__(self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None) -> None:
        self.close()

    def __iter__(self) -> Self:
        return self

    def __next__(self) -> Row:
        row = self.read(self._patience_s)
        if row is not None:
            return row
        if self._stop.is_set():
            raise StopIteration
        raise self._silent()

    async def __aenter__(self) -> Self:
        return self

    async def __aexit__(self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None) -> None:
        await asyncio.to_thread(self.close)

    def __aiter__(self) -> Self:
        return self

    async def __anext__(self) -> Row:
        deadline_s = None if self._patience_s is None else time.monotonic() + self._patience_s
        loop = asyncio.get_running_loop()
        while True:
            waiter = loop, loop.create_future()
            with self._changed:
                if (row := self._taken()) is not None:
                    return row
                if self._stop.is_set():
                    raise StopAsyncIteration
                self._waiting.append(waiter)
            try:
                await asyncio.wait_for(waiter[1], None if deadline_s is None else deadline_s - time.monotonic())
            except TimeoutError:
                raise self._silent() from None
            finally:
                with self._changed, suppress(ValueError):
                    self._waiting.remove(waiter)

    def _has_news(self) -> bool:
        return bool(self._queue) or self._failure is not None or self._stop.is_set()

    def _taken(self) -> Row | None:
        """Take the oldest row; with the lock held."""
        if self._queue and not self._stop.is_set():
            self._emitted += 1
            return self._queue.popleft()
        if self._failure is not None:
            raise self._failure
        return None

    def _silent(self) -> BrokerError:
        why = self.trouble or f"machines that were heard of: {', '.join(sorted(self._seen)) or 'none'}"
        return BrokerError(f"{self.machine}: no row from {self.broker} for {self._patience_s:g} s; {why}")

    def _run(self) -> None:
        try:
            while not self._stop.is_set():
                for event in self._host.poll(POLL_S):
                    if event.device is not None:
                        self._seen.add(event.device)
                    if (row := self._rows.after(event)) is not None:
                        self._put(row)
        except Exception as error:
            with self._changed:
                self._failure = error
        finally:
            self._host.stop()
            self._wake()

    def _put(self, row: Row) -> None:
        with self._changed:
            self._received += 1
            if len(self._queue) >= self._queue_max:
                self._queue.popleft()
                self._dropped += 1
            self._queue.append(row)
        self._wake()

    def _wake(self) -> None:
        with self._changed:
            self._changed.notify_all()
            waiting, self._waiting = self._waiting, []
        for loop, future in waiting:
            with suppress(RuntimeError):  # its loop is closed
                loop.call_soon_threadsafe(_done, future)


def _done(future: "asyncio.Future[None]") -> None:
    if not future.done():
        future.set_result(None)


def watch(
    broker: str | None,
    machine: str,
    *,
    group: str = "cnc",
    password: str | None = None,
    queue_max: int = 10_000,
    patience_s: float | None = None,
) -> Watch:
    """Subscribe to a machine's row; the connection is made meanwhile, and again where it breaks.

    broker: mqtt[s]://[user@]host[:port][?ca_file=…&certificate_file=…&key_file=…], None = $CNCTWIN_BROKER
    password: None = $CNCTWIN_PASSWORD; group: the plant; queue_max: rows that wait for the reader, the oldest are dropped first
    patience_s: a loop over it ends with BrokerError where no row came for so long; None = it waits

    Raises BrokerError where the address or a file of it cannot be used, UsageError where there is none.
    """
    with one_tree():
        where = address(broker)
    if where is None:
        raise UsageError(f"no broker is given; name one, as mqtt://broker:1883, or set {BROKER_VARIABLE}")
    if queue_max < 1:
        raise UsageError(f"queue_max is {queue_max}; it has to be at least 1")
    return Watch(where if password is None else where.with_password(password), machine, group, queue_max, patience_s)
