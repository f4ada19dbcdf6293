"""A simulated control with a clock: which state it shows now. One for each server, whatever the protocol."""

import threading
import time
from collections.abc import Callable, Iterable, Iterator

from cnctwin.standins.simulated_control.state import ControlState


class SimulatedControl:
    """Shows the states of a day at its pace; `now` may be asked from any thread.

    machine_s: the machine's own seconds since it was switched on; by default real time, `speed` times as fast
    switched_on_s: what the control's calendar said at second 0, in seconds since 1970; `clock_offset_s` sets it wrong on purpose
    """

    def __init__(
        self,
        shown: Iterable[ControlState],
        *,
        speed: float = 1.0,
        machine_s: Callable[[], float] | None = None,
        switched_on_s: float | None = None,
        clock_offset_s: float = 0.0,
    ) -> None:
        began_s = time.monotonic()
        self._machine_s = machine_s or (lambda: (time.monotonic() - began_s) * speed)
        self._switched_on_s = (time.time() if switched_on_s is None else switched_on_s) + clock_offset_s
        self._shown: Iterator[ControlState] = iter(shown)
        self._lock = threading.Lock()
        self._current = next(self._shown, ControlState())
        self._coming = next(self._shown, None)

    def now(self) -> ControlState:
        """Return what it shows. After the last state of the day it stays at that."""
        with self._lock:
            now_s = self._machine_s()
            while self._coming is not None and self._coming.at_s <= now_s:
                self._current, self._coming = self._coming, next(self._shown, None)
            return self._current

    @property
    def is_over(self) -> bool:
        """True if the last state of the day has been shown."""
        return self._coming is None

    def machine_s(self) -> float:
        """Return the machine's own seconds since it was switched on."""
        return self._machine_s()

    def calendar_s(self) -> float:
        """The control's own date and time, seconds since 1970."""
        return self._switched_on_s + self._machine_s()
