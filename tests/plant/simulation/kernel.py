"""One thread and one clock for a whole plant: every thread of every process is a greenlet, and time passes only while all wait.

Our code blocks where it always does (`sleep`, `Event.wait`, `poll`); `seams` has that end up here. The task that is due first
runs until it blocks again. What is due at the same moment comes in an order that the seed draws, since each pause ends up to
JITTER_S later. A process that is killed is never resumed: nothing of it runs any more, no `finally` either, as with kill -9.
"""

import hashlib
import heapq
import itertools
from collections import Counter
from collections.abc import Callable
from contextlib import suppress
from random import Random
from typing import Any

from greenlet import GreenletExit, getcurrent, greenlet

EPOCH_S = 1_795_000_000.0
JITTER_S = 0.002
SHOWN_MAX = 3  # violations of one invariant
LOOKS_MAX = 2_000_000
"""Looks at the clock without a pause: who looks more often waits for what never comes."""


class StuckError(Exception):
    """A task runs for ever without waiting for anything."""


class Process:
    """A process of the plant: its tasks, its clock, and whatever has to be told when it dies."""

    def __init__(self, kernel: "Kernel", name: str, wall_offset_s: float = 0.0) -> None:
        self.kernel, self.name, self.wall_offset_s = kernel, name, wall_offset_s
        self.is_alive = True
        self.life = 0
        self.tasks: list[Task] = []
        self.at_death: list[Callable[[], None]] = []

    def wall_s(self) -> float:
        """Return the time on this process's wall."""
        return EPOCH_S + self.kernel.now_s + self.wall_offset_s

    def spawn(self, target: Callable[[], Any], name: str = "") -> "Task":
        """Begin a thread of this process."""
        task = Task(self, target, name)
        self.tasks.append(task)
        self.kernel.wake_at(self.kernel.now_s + self.kernel.jitter_s(), task)
        return task

    def kill(self) -> None:
        """End it as kill -9 does. Where one of its own tasks calls this, the call never returns."""
        if not self.is_alive:
            return
        self.is_alive = False
        for told in self.at_death:
            told()
        self.kernel.bury(self)
        if self.kernel.task is not None and self.kernel.task.process is self:
            self.kernel.hub.switch()


class Task:
    """A thread of a process."""

    def __init__(self, process: Process, target: Callable[[], Any], name: str) -> None:
        self.process, self.name = process, name
        self.turn = 0  # of its waits: what wakes an earlier one comes too late
        self.is_over = False
        self.error: BaseException | None = None
        self.ended = Signal(process.kernel)
        self._target = target
        self.greenlet = greenlet(self._run, parent=process.kernel.hub)

    def _run(self, *_: Any) -> None:
        try:
            self._target()
        except GreenletExit:
            raise
        except BaseException as error:  # a thread that fails ends alone; who joins it may look
            self.error = error
        self.is_over = True
        self.ended.fire()


class Signal:
    """Tasks that wait for something."""

    def __init__(self, kernel: "Kernel") -> None:
        self._kernel = kernel
        self._waiting: list[tuple[Task, int]] = []

    def wait(self, timeout_s: float | None = None) -> bool:
        """Wait; False where the time was over first."""
        task = self._kernel.me()
        self._waiting.append((task, task.turn + 1))
        return self._kernel.block(timeout_s)

    def fire(self) -> None:
        """Wake all that wait."""
        waiting, self._waiting = self._waiting, []
        for task, turn in waiting:
            if task.turn == turn:
                self._kernel.wake_at(self._kernel.now_s, task, woken=True)


class Kernel:
    """See the module. `digest` is a hash over all that was noted: two runs of one seed have the same."""

    def __init__(self, seed: int) -> None:
        self.chance = Random(f"kernel {seed}")
        self.now_s = 0.0
        self.hub = getcurrent()
        self.task: Task | None = None
        self.is_over = False
        self.violations: list[str] = []
        self.notes = 0
        self._violated: Counter[str] = Counter()
        self._hash = hashlib.sha256()
        self._due: list[tuple[float, int, Any, int, bool]] = []
        self._numbers = itertools.count()
        self._grave: list[Process] = []
        self._looks = 0

    @property
    def digest(self) -> str:
        """Return the hash over all that has happened."""
        return self._hash.hexdigest()[:16]

    def note(self, *what: object) -> None:
        """Note something that has happened."""
        self.notes += 1
        self._hash.update(repr((round(self.now_s, 6), what)).encode("utf-8", "backslashreplace"))

    def jitter_s(self) -> float:
        """Return a small pause by chance."""
        return self.chance.random() * JITTER_S

    def violated(self, invariant: str, detail: str) -> None:
        """Note that an invariant does not hold."""
        self._violated[invariant] += 1
        if self._violated[invariant] <= SHOWN_MAX:
            self.violations.append(f"{self.now_s:.3f} s: {invariant}: {detail}"[:600])

    # What happens when.

    def at(self, at_s: float, call: Callable[[], None]) -> None:
        """Have `call` called at a moment. It must not wait."""
        heapq.heappush(self._due, (at_s, next(self._numbers), call, -1, False))

    def wake_at(self, at_s: float, task: Task, *, woken: bool = False) -> None:
        """Resume a task at a moment, unless something wakes it before."""
        heapq.heappush(self._due, (at_s, next(self._numbers), task, task.turn, woken))

    def run(self, until_s: float) -> None:
        """Let the plant live until a moment."""
        assert self.task is None, "the hub runs the plant"
        due = self._due
        while due and due[0][0] <= until_s:
            at_s, _, what, turn, woken = heapq.heappop(due)
            if turn < 0:
                self._pass(at_s)
                what()
            elif what.turn == turn and what.process.is_alive and not what.is_over:
                self._pass(at_s)
                self.task = what
                what.greenlet.switch(woken)
                self.task = None
        self._pass(until_s)

    def _pass(self, at_s: float) -> None:
        self._looks = 0
        self.now_s = max(self.now_s, at_s)

    # What a task calls.

    def me(self) -> Task:
        """Return the task that runs."""
        if self.is_over or self.task is None:
            raise GreenletExit
        return self.task

    def look(self) -> float:
        """Return the time; who asks all the time without waiting is stuck."""
        self._looks += 1
        if self._looks > LOOKS_MAX:
            self._looks = 0
            raise StuckError(f"{'nobody' if self.task is None else self.task.name} looks at the clock and never waits")
        return self.now_s

    def block(self, timeout_s: float | None) -> bool:
        """Wait until woken, or for so long; True where somebody woke us."""
        task = self.me()
        task.turn += 1
        if timeout_s is not None:
            self.wake_at(self.now_s + max(timeout_s, 0.0) + self.jitter_s(), task)
        woken = bool(self.hub.switch())
        if self.is_over:
            raise GreenletExit
        task.turn += 1
        return woken

    def sleep(self, seconds: float) -> None:
        """Wait for so long."""
        self.block(seconds)

    # The end.

    def bury(self, process: Process) -> None:
        """Keep what is left of a process until the end, so that nothing of it runs on the way out."""
        self._grave.append(process)

    def close(self, processes: list[Process]) -> None:
        """Unwind every task; what they still try to do reaches nobody."""
        self.is_over = True
        for process in [*self._grave, *processes]:
            for task in process.tasks:
                if not task.is_over:
                    with suppress(BaseException):
                        task.greenlet.throw(GreenletExit)
            process.tasks.clear()
        self._grave.clear()
        self._due.clear()
