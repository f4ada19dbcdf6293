"""The one place where our code meets the simulated plant: its clocks, its threads, its connections and its disks.

Each module of ours says `time.monotonic()`, `threading.Thread(…)`, `sqlite3.connect(…)`; while a plant runs, these names lead to
the kernel. Nothing but modules of ours is touched, and all of it is put back.
"""

import queue
import sys
import threading
import time
from collections import deque
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from types import ModuleType
from typing import Any

from tests.plant.simulation.kernel import EPOCH_S, Kernel, Signal, Task

PACKAGES = ("sparkplug", "edge", "processors", "cnctwin")


class Stand:
    """A module in which some names are replaced; all others are the module's own."""

    def __init__(self, module: ModuleType, names: Mapping[str, Any]) -> None:
        self.__dict__.update(names)
        self._module = module

    def __getattr__(self, name: str) -> Any:
        return getattr(self._module, name)


class Event:
    """As threading.Event."""

    def __init__(self, kernel: Kernel) -> None:
        self._kernel, self._is_set, self._signal = kernel, False, Signal(kernel)

    def is_set(self) -> bool:
        return self._is_set

    def set(self) -> None:
        self._is_set = True
        self._signal.fire()

    def clear(self) -> None:
        self._is_set = False

    def wait(self, timeout: float | None = None) -> bool:
        until_s = None if timeout is None else self._kernel.now_s + timeout
        while not self._is_set:
            left_s = None if until_s is None else until_s - self._kernel.now_s
            if left_s is not None and left_s <= 0.0:
                break
            self._signal.wait(left_s)
        return self._is_set


class Lock:
    """As threading.Lock and threading.RLock."""

    def __init__(self, kernel: Kernel, *, is_reentrant: bool) -> None:
        self._kernel, self._is_reentrant = kernel, is_reentrant
        self._owner: Task | None = None
        self._depth = 0
        self._free = Signal(kernel)

    def acquire(self, blocking: bool = True, timeout: float = -1) -> bool:
        me = self._kernel.task
        if self._depth and not (self._is_reentrant and self._owner is me):
            if not blocking or self._kernel.is_over:
                return self._kernel.is_over
            while self._depth:
                if not self._free.wait(None if timeout < 0 else timeout) and timeout >= 0:
                    return False
        self._owner = me
        self._depth += 1
        return True

    def release(self) -> None:
        self._depth -= 1
        if not self._depth:
            self._owner = None
            self._free.fire()

    def locked(self) -> bool:
        return self._depth > 0

    def __enter__(self) -> bool:
        return self.acquire()

    def __exit__(self, *_: object) -> None:
        self.release()


class Thread:
    """As threading.Thread."""

    def __init__(
        self,
        kernel: Kernel,
        target: Callable[..., Any],
        name: str = "",
        args: Sequence[Any] = (),
        kwargs: Mapping[str, Any] | None = None,
        daemon: bool | None = None,
    ) -> None:
        self._kernel, self.name, self.daemon = kernel, name, daemon
        self._call = lambda: target(*args, **(kwargs or {}))
        self._task: Task | None = None

    def start(self) -> None:
        self._task = self._kernel.me().process.spawn(self._call, self.name)

    def is_alive(self) -> bool:
        return self._task is not None and not self._task.is_over and self._task.process.is_alive

    def join(self, timeout: float | None = None) -> None:
        until_s = None if timeout is None else self._kernel.now_s + timeout
        while self._task is not None and not self._task.is_over and not self._kernel.is_over:
            left_s = None if until_s is None else until_s - self._kernel.now_s
            if left_s is not None and left_s <= 0.0:
                return
            self._task.ended.wait(left_s)


class Queue:
    """As queue.Queue, as far as it is used."""

    def __init__(self, kernel: Kernel, maxsize: int = 0) -> None:
        self._items: deque[Any] = deque()
        self._maxsize, self._put, self._kernel = maxsize, Signal(kernel), kernel

    def empty(self) -> bool:
        return not self._items

    def full(self) -> bool:
        return 0 < self._maxsize <= len(self._items)

    def qsize(self) -> int:
        return len(self._items)

    def put_nowait(self, item: Any) -> None:
        if self.full():
            raise queue.Full
        self._items.append(item)
        self._put.fire()

    def put(self, item: Any, block: bool = True, timeout: float | None = None) -> None:
        while self.full():
            self._kernel.sleep(0.01)
        self.put_nowait(item)

    def get_nowait(self) -> Any:
        if not self._items:
            raise queue.Empty
        return self._items.popleft()

    def get(self, block: bool = True, timeout: float | None = None) -> Any:
        while not self._items:
            if not self._put.wait(timeout) and timeout is not None:
                raise queue.Empty
        return self._items.popleft()


def _wall_s(kernel: Kernel) -> float:
    return EPOCH_S + kernel.now_s if kernel.task is None else kernel.task.process.wall_s()


def clock_of(kernel: Kernel) -> Stand:
    """Return what stands for the module `time`."""

    def wall_s() -> float:
        kernel.look()
        return _wall_s(kernel)

    return Stand(
        time,
        {
            "monotonic": kernel.look,
            "perf_counter": kernel.look,
            "monotonic_ns": lambda: round(kernel.look() * 1e9),
            "time": wall_s,
            "time_ns": lambda: round(wall_s() * 1e6) * 1_000,
            "process_time": lambda: kernel.look() * 0.1,
            "thread_time": lambda: kernel.look() * 0.1,
            "sleep": kernel.sleep,
        },
    )


def threads_of(kernel: Kernel) -> Stand:
    """Return what stands for the module `threading`."""
    return Stand(
        threading,
        {
            "Thread": lambda group=None, target=None, name="", args=(), kwargs=None, daemon=None: Thread(
                kernel, target, name, args, kwargs, daemon
            ),
            "Event": lambda: Event(kernel),
            "Lock": lambda: Lock(kernel, is_reentrant=False),
            "RLock": lambda: Lock(kernel, is_reentrant=True),
            "get_ident": lambda: id(kernel.task),
            "current_thread": lambda: kernel.task,
        },
    )


@contextmanager
def simulated(kernel: Kernel, others: Sequence[tuple[Any, str, Any]], stands: Mapping[Any, Any]) -> Iterator[None]:
    """Have our code live on the kernel's clock and threads.

    others: names to replace beside, as (object, attribute, value)
    stands: more modules and functions, and what stands for each wherever it was imported
    """
    queues = Stand(queue, {"Queue": lambda maxsize=0: Queue(kernel, maxsize), "SimpleQueue": lambda: Queue(kernel)})
    by_id: dict[int, Any] = {id(time): clock_of(kernel), id(threading): threads_of(kernel), id(queue): queues}
    by_id |= {id(replaced): stand for replaced, stand in stands.items()}
    before: list[tuple[Any, str, Any]] = []
    for name, module in list(sys.modules.items()):
        if name.partition(".")[0] in PACKAGES and module is not None:
            for attribute, value in list(vars(module).items()):
                if id(value) in by_id:
                    before.append((module, attribute, value))
                    setattr(module, attribute, by_id[id(value)])
    for owner, attribute, value in others:
        before.append((owner, attribute, getattr(owner, attribute)))
        setattr(owner, attribute, value)
    try:
        yield
    finally:
        for owner, attribute, value in reversed(before):
            setattr(owner, attribute, value)
