"""A request to the cluster in a thread of its own, so that the caller can give it up.

When a broker dies in the middle of a request, librdkafka may never return.
"""

import logging
import threading
from collections.abc import Callable
from concurrent.futures import Future, wait
from typing import Generic, TypeVar

from processors.errors import ProcessorError

CLOSE_S_MAX = 5.0
T = TypeVar("T")
_log = logging.getLogger(__name__)


class HungError(ProcessorError):
    """The cluster has not answered within the time limit."""


class Request(Generic[T]):
    """See the module. It begins at once. An executor would wait for its thread when the program ends; this thread is a daemon."""

    def __init__(self, ask: Callable[[], T]) -> None:
        self._ask = ask
        self._future = Future[T]()
        threading.Thread(target=self._run, daemon=True).start()

    def _run(self) -> None:
        try:
            self._future.set_result(self._ask())
        except BaseException as error:
            self._future.set_exception(error)

    @property
    def is_over(self) -> bool:
        """True once the answer or an error is there."""
        return self._future.done()

    def answer(self, timeout_s: float | None = None) -> T:
        """Wait for the answer, and return it or raise what came instead. Raises HungError."""
        if not wait([self._future], timeout_s).done:
            raise HungError(f"no answer, not even a refusal, within {timeout_s:g} s")
        return self._future.result()


def closed(close: Callable[[], object], what: str) -> bool:
    """Close a client; wait for CLOSE_S_MAX at most, since one with a commit on its way to a cluster that is gone never ends.

    Return False where it is left behind.
    """
    try:
        Request(close).answer(CLOSE_S_MAX)
    except HungError:
        _log.warning("%s: the cluster is away, and what was under way is left to it", what)
        return False
    return True
