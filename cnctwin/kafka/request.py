"""A request to the cluster in a thread of its own, so that the caller can give it up.

When a broker dies in the middle of a request, librdkafka may never return.
"""

import logging
import threading
from collections.abc import Callable
from typing import Generic, TypeVar

from processors.errors import ProcessorError

CLOSE_S_MAX = 5.0
T = TypeVar("T")
_log = logging.getLogger(__name__)


class HungError(ProcessorError):
    """The cluster has not answered within the time limit."""


class Request(Generic[T]):
    """See the module. It begins at once."""

    def __init__(self, ask: Callable[[], T]) -> None:
        self._ask = ask
        self._answers: list[T] = []
        self._errors: list[BaseException] = []
        self._thread = threading.Thread(target=self._run, daemon=True)
        self._thread.start()

    def _run(self) -> None:
        try:
            self._answers.append(self._ask())
        except BaseException as error:
            self._errors.append(error)

    @property
    def is_over(self) -> bool:
        """True once the answer or an error is there."""
        return not self._thread.is_alive()

    def answer(self, timeout_s: float | None = None) -> T:
        """Wait for the answer, and return it or raise what came instead. Raises HungError."""
        self._thread.join(timeout_s)
        if self._thread.is_alive():
            raise HungError(f"no answer, not even a refusal, within {timeout_s:g} s")
        if self._errors:
            raise self._errors[0]
        return self._answers[0]


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
