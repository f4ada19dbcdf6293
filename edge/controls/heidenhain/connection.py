"""The connection to a HEIDENHAIN control: looks at a steady pace, and holes where there was none.

A look takes a handful of questions and answers, and no longer than `timeout_s`; what takes longer, or is no LSV2, ends the
connection. It is made again after a wait that grows, with jitter, so that a plant's edges do not come back in step. Looks that
were due and were not made are a hole in the next frame, whatever the cause; so is the time in which the control answered
slowly.

The text of the selected program is read when another is selected, when it is started, and now and then: a program that was saved
meanwhile is read again.
"""

import random
import threading
import time
from collections.abc import Callable, Iterator
from uuid import uuid4

from edge.controls.heidenhain.config import Config
from edge.controls.heidenhain.control import Control
from edge.controls.heidenhain.cursor import Cursor
from edge.controls.heidenhain.klartext import read_program
from edge.controls.heidenhain.tool_table import read_table
from edge.errors import ConnectionLostError
from edge.sample import ClockReading
from edge.sweep import Fact, Hole, Sweep

BACKOFF_S = 0.25
BACKOFF_S_MAX = 30.0
PROGRAM_INTERVAL_S = 30.0
TRY_AGAIN_S = 2.0
TRY_AGAIN_LOST_S = 15.0  # after a text in whose midst the connection ended
RUNNING = 0
SLOW = "the control answered too slowly"


class HeidenhainConnection:
    """One frame for each look, until `close`. `patience_s` is the longest wait for a byte in real time."""

    reconnects: int
    last_error: str

    def __init__(
        self,
        config: Config,
        *,
        clock: Callable[[], float] = time.monotonic,
        wall_s: Callable[[], float] = time.time,
        wait: Callable[[float], object] | None = None,
        patience_s: float | None = None,
        chance: random.Random | None = None,
    ) -> None:
        self._config, self._clock, self._wall_s = config, clock, wall_s
        self._patience_s = config.source.timeout_s if patience_s is None else patience_s
        self._chance = chance or random.Random()  # noqa: S311  jitter, not a secret
        self._closed = threading.Event()
        self._wait = wait or self._closed.wait
        self._control: Control | None = None
        self._life = uuid4().hex
        self._number = 0
        self._heard_s = clock()
        self._looked_ms: int | None = None  # when the last look was made, by the wall clock
        self._facts = 1  # in the last look
        self._failures = 0
        self._is_new = True  # nothing was asked on this connection yet
        self._why = ""
        self._clock_due_s = clock()
        self._programs: dict[str, str] = {}  # path → its size and time when it was read
        self._programs_seen_s = 0.0
        self._try_again_s = clock()
        self._was_running = False
        self._table_stamp, self._table_due_s, self._slow_due_s = "", clock(), clock()
        self.reconnects = 0
        self.last_error = ""

    def follow(self, cursor: Cursor) -> None:
        """Nothing that is asked for next depends on the parser."""

    def silent_s(self) -> float:
        """Seconds since the last whole look."""
        return self._clock() - self._heard_s

    def close(self) -> None:
        """End `frames`; a read that is blocked in another thread is woken."""
        self._closed.set()
        control = self._control
        if control is not None:
            control.link.wake()

    def frames(self) -> Iterator[bytes]:
        """Looks until `close`."""
        interval_s = self._config.source.interval_ms / 1000
        due_s = self._clock()
        try:
            while not self._closed.is_set():
                try:
                    frame = self.look()
                except (OSError, ConnectionLostError) as error:
                    if not self._closed.is_set():
                        self._lost(error)
                    continue
                yield frame
                now_s = self._clock()
                due_s = due_s + interval_s if due_s + interval_s > now_s else now_s
                self._wait(max(0.0, due_s - now_s))
        finally:
            self.hang_up()

    def look(self) -> bytes:
        """One look, as a frame; OSError or ConnectionLostError where there is none."""
        control = self._control or self._connected()
        began_ms = self._now_ms()
        control.link.begin(self._config.source.timeout_s)
        now_s = self._clock()
        is_slow = self._is_new or now_s >= self._slow_due_s
        if is_slow:
            self._slow_due_s = now_s + self._config.source.slow_interval_ms / 1000 - self._config.source.interval_ms / 2000
        facts = control.look(is_slow=is_slow)
        t_ms, asked = (began_ms + self._now_ms()) // 2, len(facts)
        if self._is_new:
            facts.append(Fact("control", control.name))
        if self._config.source.program_text:
            facts += self._texts(control, facts)
        if self._config.source.tool_table:
            facts += self._table(control)
        control.link.begin(self._config.source.timeout_s)
        clock = self._clock_reading(control)
        holes = self._hole(t_ms)
        self._looked_ms, self._facts, self._is_new = t_ms, asked, False
        self._heard_s, self._failures, self._why = self._clock(), 0, ""
        sweep = Sweep(
            self._life,
            self._number,
            t_ms,
            tuple(facts),
            holes,
            self._config.source.interval_ms,
            clock,
            available=True,
        )
        self._number += 1
        return sweep.encode()

    def _hole(self, t_ms: int) -> tuple[Hole, ...]:
        """The looks that were due since the last one and were not made; a look that takes long leaves out those after it."""
        interval_ms = self._config.source.interval_ms
        if self._looked_ms is None or t_ms - self._looked_ms < 2 * interval_ms:
            return ()
        missed = (t_ms - self._looked_ms) // interval_ms
        return (Hole(self._why or SLOW, self._looked_ms, t_ms, missed * self._facts),)

    def _connected(self) -> Control:
        control = Control(self._config, clock=self._clock, patience_s=self._patience_s)
        self._control = control
        if self._closed.is_set():
            raise ConnectionLostError("closed")
        control.open()
        self._programs.clear()
        self._is_new, self._table_stamp, self._table_due_s = True, "", self._clock()
        return control

    def _lost(self, error: Exception) -> None:
        self.hang_up()
        self.reconnects += 1
        self._failures += 1
        self._why = str(error) or type(error).__name__
        self.last_error = f"{self._config.source.url}: {self._why}"
        longest = min(BACKOFF_S_MAX, BACKOFF_S * 2.0 ** min(self._failures - 1, 16))
        self._wait(longest * self._chance.uniform(0.5, 1.0))

    def hang_up(self) -> None:
        """Close the connection, from the thread that looks."""
        control, self._control = self._control, None
        if control is not None:
            control.close()

    def _clock_reading(self, control: Control) -> ClockReading | None:
        """Now and then, at another phase of its second each time: so it gets known to better than a second."""
        interval_s, now_s = self._config.source.clock_interval_s, self._clock()
        if not interval_s or now_s < self._clock_due_s:
            return None
        self._clock_due_s = now_s + interval_s + self._chance.uniform(-1.0, 1.0)
        return control.clock(self._now_ms)

    def _texts(self, control: Control, facts: list[Fact]) -> list[Fact]:
        """The programs that are selected and called, where they are not known yet or were saved since."""
        told = {fact.key: fact.value for fact in facts}
        paths = [str(told[key]) for key in ("program", "current_program") if told.get(key)]
        is_running = told.get("program_state") == RUNNING
        began, self._was_running = is_running and not self._was_running, is_running
        now_s = self._clock()
        is_due = began or now_s - self._programs_seen_s >= PROGRAM_INTERVAL_S
        if is_due:
            self._programs_seen_s = now_s
        self._programs = {path: stamp for path, stamp in self._programs.items() if path in paths}
        texts: list[Fact] = []
        for path in dict.fromkeys(paths):
            known = self._programs.get(path)
            if (known is None and now_s >= self._try_again_s) or (known is not None and is_due):
                stamp = control.file_stamp(path)
                if known is None or stamp not in ("", known):
                    texts.append(self._text(control, path, stamp))
        return texts

    def _table(self, control: Control) -> list[Fact]:
        """The tool table, where it was saved since it was read. Looks wait for it."""
        now_s, path = self._clock(), self._config.source.tool_table
        if now_s < self._table_due_s:
            return []
        self._table_due_s = now_s + self._config.source.tool_table_interval_s
        control.link.begin(self._config.source.timeout_s)
        stamp = control.file_stamp(path)
        if stamp and stamp == self._table_stamp:
            return []
        table = control.tool_table(path)
        self._table_stamp = stamp if isinstance(table.value, str) and not read_table(table.value).fault else ""
        return [table]

    def _text(self, control: Control, path: str, stamp: str) -> Fact:
        """The text of a program. One that did not come whole is asked for again after a while."""
        control.link.begin(self._config.source.timeout_s)
        self._try_again_s = self._clock() + TRY_AGAIN_LOST_S
        text = control.program(path)
        self._try_again_s = self._clock()
        if isinstance(text.value, str) and (read_program(text.value).blocks or not path.upper().endswith(".H")):
            self._programs[path] = stamp
        else:
            self._programs.pop(path, None)
            self._try_again_s = self._clock() + TRY_AGAIN_S
        return text

    def _now_ms(self) -> int:
        return round(self._wall_s() * 1000)
