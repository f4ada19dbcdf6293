"""Questions to the store, in a few threads beside the event loop, with a limit on how many wait and how long one may take."""

import asyncio
import threading
import time
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from typing import TypeVar

from cnctwin.api.errors import ApiError
from cnctwin.memory.store.contract import Status, Store, StoreError

THREADS = 3
THREADS_BESIDE = 2
WAITING_MAX = 24
QUERY_S_MAX = 20.0
TRY_AGAIN_S = 2.0
STATUS_S = 5.0
T = TypeVar("T")


class _Desk:
    """A few threads, and how many wait for them."""

    def __init__(self, threads: int, name: str) -> None:
        self.pool = ThreadPoolExecutor(threads, thread_name_prefix=name)
        self._asked = 0

    def take(self, job: Callable[[], T]) -> "asyncio.Future[T]":
        """Begin a job, in its turn. Raises ApiError where too many wait."""
        if self._asked >= WAITING_MAX:
            raise ApiError(503, f"{self._asked} questions wait already; ask again in a moment", {"Retry-After": "2"})
        self._asked += 1
        answer = asyncio.get_running_loop().run_in_executor(self.pool, job)
        answer.add_done_callback(self._done)
        return answer

    def _done(self, answer: "asyncio.Future[T]") -> None:
        self._asked -= 1
        if not answer.cancelled():
            answer.exception()  # nobody may be waiting for it any more


class StoreReader:
    """A store that is opened when it is first asked, and tried again while it is not there."""

    def __init__(self, where: str = "", *, query_s_max: float = QUERY_S_MAX) -> None:
        self.where = where
        self._query_s_max = query_s_max
        self._questions = _Desk(THREADS, "store")
        self._other_work = _Desk(THREADS_BESIDE, "beside-store")  # so that slow questions hold up nothing else
        self._opening = threading.Lock()
        self._store: Store | None = None
        self._trouble = "" if where else "no store was named; give `cnctwin serve --store WHERE`"
        self._tried_s = float("-inf")
        self._status: tuple[float, Status] | None = None

    @property
    def configured(self) -> bool:
        """True if a store was named."""
        return bool(self.where)

    async def ask(self, question: Callable[[Store], T]) -> T:
        """The answer, from a thread. Raises ApiError: no store, too busy, too slow; StoreError as the store says it."""
        return await self._wait(self._questions, lambda: question(self._opened()))

    async def work(self, job: Callable[[], T]) -> T:
        """The same for what need not be asked of the store, but would hold up the event loop."""
        return await self._wait(self._other_work, job)

    async def _wait(self, desk: "_Desk", job: Callable[[], T]) -> T:
        answer = desk.take(job)
        try:
            return await asyncio.wait_for(asyncio.shield(answer), self._query_s_max)
        except TimeoutError:
            raise ApiError(503, f"no answer within {self._query_s_max:g} s; ask for a shorter stretch or wider windows") from None

    async def status(self) -> Status:
        """Return the state of the store, at most five seconds old."""
        if self._status is None or time.monotonic() - self._status[0] > STATUS_S:
            status = await self.ask(lambda store: store.status())
            self._status = (time.monotonic(), status)
        return self._status[1]

    def close(self) -> None:
        """Let the threads go, and the store."""
        for desk in (self._questions, self._other_work):
            desk.pool.shutdown(wait=False, cancel_futures=True)
        with self._opening:
            if self._store is not None:
                self._store.close()
                self._store = None

    def _opened(self) -> Store:
        with self._opening:
            if self._store is not None:
                return self._store
            if not self.where:
                raise ApiError(503, self._trouble)
            if time.monotonic() - self._tried_s < TRY_AGAIN_S:
                raise ApiError(503, self._trouble)
            self._tried_s = time.monotonic()
            try:
                from cnctwin.memory.store.opening import open_store  # noqa: PLC0415  with the extra that it needs

                self._store = open_store(self.where, writable=False)
            except ModuleNotFoundError as missing:
                self._trouble = f"the store {self.where} needs the package {missing.name}; pip install 'cnctwin[historian]'"
                raise ApiError(503, self._trouble) from None
            except StoreError as error:
                self._trouble = f"{error}; is `cnctwin process historian` running?"
                raise ApiError(503, self._trouble) from None
            return self._store
