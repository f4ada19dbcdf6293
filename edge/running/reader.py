"""The reader of one control: in a thread of its own while the connection blocks, in the driver's while it streams."""

import math
import threading
import time
from collections.abc import Callable, Iterator

from edge.adapter import Connection, SteppedConnection, Wait
from edge.running.driver import Driver

SHARE_S = 0.02


class Reader:
    """Hands each frame to `take`. `ended` is called once, with what ended it that was not asked for."""

    def __init__(
        self,
        name: str,
        connection: Connection,
        driver: Driver,
        take: Callable[[bytes], None],
        ended: Callable[[BaseException | None], None],
    ) -> None:
        self._driver, self._take, self._ended = driver, take, ended
        self._steps: Iterator[bytes | Wait] = (
            connection.steps() if isinstance(connection, SteppedConnection) else connection.frames()
        )
        self._last = Wait(None)
        self._is_back = threading.Event()
        self._is_over = False
        self._error: BaseException | None = None
        self._thread = threading.Thread(target=self._run, name=f"{name}-reader", daemon=True)

    def start(self) -> None:
        """Begin to read."""
        self._thread.start()

    def join(self, timeout_s: float) -> None:
        """Wait until it has ended, after its connection was closed."""
        self._thread.join(timeout_s)

    def resume(self) -> Wait | None:
        """Go on in the driver's thread, for a while: a control that floods us has its turn again after the others."""
        wait = self._advance(time.monotonic() + SHARE_S)
        if wait is not None and wait.sock is not None:
            return wait
        self._is_back.set()
        return None

    def _run(self) -> None:
        while not self._is_over:
            wait = self._advance()
            if wait is not None and wait.sock is not None:
                self._is_back.clear()
                self._driver.watch(self, wait)
                self._is_back.wait()
        self._ended(self._error)

    def _advance(self, until_s: float = math.inf) -> Wait | None:
        """Take what has come, up to the next wait, or for so long; None at the end."""
        try:
            for step in self._steps:
                if isinstance(step, Wait):
                    self._last = step
                    return step
                self._take(step)
                if time.monotonic() > until_s:
                    return Wait(self._last.sock)  # there is more: it waits for nothing
        except BaseException as error:
            self._error = error
        self._is_over = True
        return None
