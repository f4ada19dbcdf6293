"""Machine time that passes only when somebody waits: an hour of it takes as long as the telegrams of an hour take."""

import threading
from collections.abc import Callable

SWITCHED_ON_S = 1_772_438_400.0


class MachineTime:
    """Seconds of the machine. `plan`: what happens at which second, done by whoever waits beyond it in the main thread."""

    def __init__(self) -> None:
        self._now_s = 0.0
        self._lock = threading.Lock()
        self.plan: list[tuple[float, Callable[[], None]]] = []

    def now_s(self) -> float:
        """The machine's seconds; also the clock of the edge."""
        with self._lock:
            return self._now_s

    def wall_s(self) -> float:
        """The same as seconds since 1970."""
        return SWITCHED_ON_S + self.now_s()

    def pass_by(self, seconds: float) -> None:
        """Time passes, from any thread."""
        with self._lock:
            self._now_s += seconds

    def wait(self, seconds: float) -> None:
        """The edge waits; what is planned for that time happens first."""
        until_s = self.now_s() + seconds
        while self.plan and self.plan[0][0] <= until_s:
            _, happens = self.plan.pop(0)
            happens()
        self.pass_by(max(0.0, until_s - self.now_s()))
