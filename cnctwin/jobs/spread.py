"""Pieces of a job computed here, on some cores, or on a Dask cluster; the answer is the same.

```
with spread_over(workers=4) as spread:
    for answer in spread(evolve, [text of island 1, text of island 2, …]):   # in this order, as soon as they are there
```

A worker that is killed loses nothing but time: its piece runs again on another. What is lost for good is said in one line,
SpreadError. docs/decisions/0014-spread.md says what goes over the wire, and why joblib, which pickles, is let in here only.
"""

import os
import signal
import time
from collections import deque
from collections.abc import Callable, Iterable, Iterator, Sequence
from contextlib import contextmanager, suppress
from functools import cache
from threading import Event, Thread
from typing import Any

from cnctwin.errors import SpreadError, UsageError
from cnctwin.jobs.dask_cluster import DaskCluster, connected
from cnctwin.jobs.piece import PACKAGES, name_of, opened, run_piece

Spread = Callable[[Callable[[str], str], Sequence[str]], Iterable[str]]
"""Runs a function on texts; the answers come in their order."""
DEATHS_MAX = 3
"""A piece at which workers were killed more often than this is given up: it is probably why."""
IDLE_S = 60
"""So long a worker process waits for another piece."""
LOOK_S = 1.0
"""Seconds between a process's looks whether we are still there: it ends so long after us, also where we are killed."""


@contextmanager
def spread_over(workers: int = 1, dask: DaskCluster | None = None, packages: tuple[str, ...] = PACKAGES) -> Iterator[Spread]:
    """Compute pieces in this process (1), in that many processes, or on a Dask cluster, which knows how many it has.

    packages: whose functions may be sent. Raises UsageError where something is missing, SpreadError where the cluster is.
    """
    if dask is not None:
        with connected(dask, packages) as spread:
            yield spread
    elif workers < 1:
        raise UsageError(f"{workers} workers compute nothing; at least 1")
    elif workers == 1:
        yield map
    else:
        with _processes(workers, packages) as spread:
            yield spread


@contextmanager
def _processes(workers: int, packages: tuple[str, ...]) -> Iterator[Spread]:
    """Processes of joblib's own kind (loky), each with one thread of arithmetic; they end with the block."""
    try:
        import joblib  # noqa: PLC0415 — an extra
        from joblib.externals import loky  # noqa: PLC0415
    except ModuleNotFoundError as error:
        raise UsageError(
            f"{error.name} is not installed, which spreads over processes: pip install 'cnctwin[optimise]'"
        ) from None

    def calls(name: str, texts: Sequence[str], enough: Event) -> Iterator[Any]:
        for text in texts:
            if enough.is_set():
                return
            yield joblib.delayed(_in_a_process)(os.getpid(), name, text)

    def spread(function: Callable[[str], str], texts: Sequence[str]) -> Iterator[str]:
        name, done, deaths, enough = name_of(function, packages), 0, 0, Event()
        while done < len(texts):
            with joblib.parallel_config("loky", inner_max_num_threads=1, idle_worker_timeout=IDLE_S):
                parallel = joblib.Parallel(workers, batch_size=1, pre_dispatch=workers + 1, return_as="generator")
                envelopes: Any = parallel(calls(name, texts[done:], enough))
            try:
                for envelope in envelopes:
                    done, deaths = done + 1, 0
                    yield opened(envelope, done)
            except loky.process_executor.BrokenProcessPool:
                deaths += 1
                if deaths > DEATHS_MAX:
                    lost = f"piece {done + 1} of {len(texts)} was lost {deaths} times, since worker processes were killed"
                    raise SpreadError(f"{lost}; is the memory enough for {workers} workers?") from None
            finally:  # where nobody wants the other answers: what has begun is waited for, nothing else begins
                enough.set()
                with suppress(loky.process_executor.BrokenProcessPool):
                    deque(envelopes, maxlen=0)
                enough.clear()

    try:
        yield spread
    finally:
        loky.get_reusable_executor(reuse=True).shutdown(wait=True, kill_workers=True)


def _in_a_process(parent: int, name: str, text: str) -> str:
    """As `run_piece`, in a process that belongs to the one that started it."""
    _belong_to(parent)
    return run_piece(name, text)


@cache
def _belong_to(parent: int) -> None:
    """Do not outlive it, and leave it to it what Ctrl-C, of which a terminal tells us both, is to do."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)

    def watch() -> None:
        while os.getppid() == parent:
            time.sleep(LOOK_S)
        os._exit(1)

    Thread(target=watch, name="parent", daemon=True).start()
