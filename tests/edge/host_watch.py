"""A host application that is read by a thread of its own, for tests that look at what comes out of an edge."""

import threading
import time
from collections.abc import Callable
from typing import Any, Self

from sparkplug.broker import BrokerAddress
from sparkplug.host import HostApplication
from sparkplug.host_session import HostEvent


class HostWatch:
    """Between enter and exit, `take` is called with each event, from the thread."""

    def __init__(self, address: BrokerAddress, host_id: str, **options: Any) -> None:
        self.host = HostApplication(address, host_id, **options)
        self._stop = threading.Event()
        self._thread = threading.Thread(target=self._watch, daemon=True)

    def __enter__(self) -> Self:
        self.host.start()
        self._thread.start()
        return self

    def __exit__(self, *_: object) -> None:
        self._stop.set()
        self._thread.join(5)
        self.host.stop()

    def take(self, event: HostEvent) -> None:
        """What a test looks at."""
        raise NotImplementedError

    def _watch(self) -> None:
        while not self._stop.is_set():
            for event in self.host.poll(0.02):
                self.take(event)


def wait(condition: Callable[[], bool], what: str, timeout_s: float = 60.0) -> None:
    """Until the condition holds; fails saying what did not come."""
    deadline = time.monotonic() + timeout_s
    while not condition():
        assert time.monotonic() < deadline, f"waited {timeout_s} s for {what}"
        time.sleep(0.02)
