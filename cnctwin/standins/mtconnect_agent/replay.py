"""The pace of a replay: how long to wait before each line, and the thread that does it."""

import math
import threading
import time
from collections.abc import Callable, Iterator

from cnctwin.standins.mtconnect_agent.recording import Recording
from cnctwin.standins.mtconnect_agent.shdr import Command, Line, Unusable

PAUSE_S_MAX = 5.0
"""Longer pauses of the recording are cut to this: a night without work is no demo."""


class Pace:
    """Seconds of recorded time between lines. The recorded sections need not be in the order of their stamps.

    A step back by no more than `pause_s_max` is jitter and costs nothing; one further back begins a new section. A step
    forward costs its length, at most `pause_s_max`. Asset lines carry the stamps of their tools and don't count.
    """

    def __init__(self, pause_s_max: float = PAUSE_S_MAX) -> None:
        if not pause_s_max >= 0:
            raise ValueError(f"the longest pause {pause_s_max} s is negative")
        self._pause_s_max = pause_s_max
        self._furthest_s: float | None = None

    def pause_s(self, line: Line | Command | Unusable) -> float:
        """Return how much recorded time passes before this line.

        >>> from cnctwin.standins.mtconnect_agent.shdr import parse_line
        >>> pace = Pace(pause_s_max=5.0)
        >>> [pace.pause_s(parse_line(f"1970-01-01T00:{t}Z|a|1")) for t in ("00:00", "00:02", "00:01", "09:00", "00:30")]
        [0.0, 2.0, 0.0, 5.0, 0.0]
        """
        if not isinstance(line, Line) or line.fields[0].startswith("@"):
            return 0.0
        now_s = line.stamp.seconds
        if self._furthest_s is None or now_s < self._furthest_s - self._pause_s_max:
            self._furthest_s = now_s
            return 0.0
        step_s = max(0.0, now_s - self._furthest_s)
        self._furthest_s = max(self._furthest_s, now_s)
        return min(step_s, self._pause_s_max)


class Replay:
    """Plays a recording into `sink`. Speed 1 is the recorded pace, 20 is twenty times it, `inf` knows no pause;
    at speed 0 nothing moves but by `step`. It begins when `begin` is set, at once where there is none."""

    def __init__(
        self,
        recording: Recording,
        sink: Callable[[Line | Command | Unusable], None],
        *,
        speed: float,
        pause_s_max: float = PAUSE_S_MAX,
        loop: bool = False,
        on_loop: Callable[[], None] = lambda: None,
        begin: threading.Event | None = None,
    ) -> None:
        if not speed >= 0:
            raise ValueError(f"the speed {speed} is negative; 1 is the recorded pace, 0 plays by steps")
        self._recording = recording
        self._sink = sink
        self._speed = speed
        self._pause_s_max = pause_s_max
        self._pace = Pace(pause_s_max)
        self._loop = loop
        self._on_loop = on_loop
        self._begin = begin
        self._stop = threading.Event()
        self._finished = threading.Event()
        self._lines: Iterator[Line | Command | Unusable] | None = None
        self._thread = threading.Thread(target=self._run, name="mtconnect-replay", daemon=True)

    @property
    def finished(self) -> bool:
        """The end of the recording is reached; never, in a loop."""
        return self._finished.is_set()

    def wait_finished(self, timeout_s: float | None = None) -> bool:
        return self._finished.wait(timeout_s)

    def start(self) -> None:
        if self._speed > 0:
            self._thread.start()

    def stop(self, timeout_s: float = 5.0) -> None:
        self._stop.set()
        if self._thread.is_alive():
            self._thread.join(timeout_s)

    def step(self, lines: int = 1) -> int:
        """Play the next lines now, at speed 0; return how many there were."""
        if self._speed != 0:
            raise RuntimeError(f"stepping is for speed 0, this replay runs at {self._speed}")
        self._lines = self._lines or self._endless()
        for played in range(lines):
            line = next(self._lines, None)
            if line is None:
                self._finished.set()
                return played
            self._sink(line)
        return lines

    def _endless(self) -> Iterator[Line | Command | Unusable]:
        for number, lines in enumerate(self._recording.passes(self._loop)):
            self._pace = Pace(self._pause_s_max)
            if number:
                self._on_loop()
            yield from lines

    def _run(self) -> None:
        """Keep to a schedule from the start on, so that waits that come out too long don't add up."""
        while self._begin is not None and not self._begin.wait(0.1):
            if self._stop.is_set():
                return
        due_s = time.monotonic()
        for line in self._endless():
            if not math.isinf(self._speed):
                due_s += self._pace.pause_s(line) / self._speed
                wait_s = due_s - time.monotonic()
                if wait_s > 0 and self._stop.wait(wait_s):
                    return
            if self._stop.is_set():
                return
            self._sink(line)
        self._finished.set()
