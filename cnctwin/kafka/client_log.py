"""The log of librdkafka's clients as lines of this program, and seldom: while a cluster is away each client has a line for every
attempt.

One line of a kind goes through in a minute, and says how many like it were held back. That no broker answers, and that one does
again, is said each time.
"""

import logging
import re
import time
from collections.abc import Callable
from math import inf
from threading import Lock
from typing import TYPE_CHECKING

if TYPE_CHECKING:  # who asks for settings may be without it
    from confluent_kafka import KafkaError

EVERY_S = 60.0
KINDS_MAX = 200
# What differs between lines of one kind: the thread, the client, sockets, the number of a broker, how long and how often.
_VARIES = re.compile(r"\[\S*#(?:producer|consumer)-\d+\] |\[thrd:[^\]]*\]+: |\bipv[46]#\S+|/(?:bootstrap|\d+)\b|\(after .*\)|\d+")
_TOLD = ("_TRANSPORT", "_RESOLVE")  # of one connection, and in the client's log as well
_log = logging.getLogger(__name__)


class Seldom(logging.Filter):
    """Lets one line of each kind through in EVERY_S, and adds to it how many it has held back. Of the kinds that it knows the one
    that was let through the longest ago makes room for a new one."""

    def __init__(self, clock: Callable[[], float] = time.monotonic) -> None:
        super().__init__()
        self._clock = clock
        self._lock = Lock()
        self._kinds: dict[str, tuple[float, int]] = {}  # when one was let through, and how many were held back since

    def filter(self, record: logging.LogRecord) -> bool:
        """Return True for a line that goes through."""
        said = record.getMessage()
        with self._lock:
            held = self._held(kind_of(said), self._clock())
        if held is None:
            return False
        if held:
            record.msg, record.args = "%s (%d like it were held back)", (said, held)
        return True

    def _held(self, kind: str, now_s: float) -> int | None:
        """Return how many lines of a kind were held back before the one that goes through now; None where it is held back too."""
        at_s, held = self._kinds.get(kind, (-inf, 0))
        if now_s - at_s < EVERY_S:
            self._kinds[kind] = at_s, held + 1
            return None
        self._kinds.pop(kind, None)
        if len(self._kinds) >= KINDS_MAX:
            del self._kinds[next(iter(self._kinds))]
        self._kinds[kind] = now_s, 0
        return held


def kind_of(said: str) -> str:
    """Return what a line has in common with others of its kind.

    >>> kind_of("FAIL [rdkafka#consumer-4] [thrd:k:9/1]: k:9/1: Connect to ipv4#10.0.0.7:9 failed (after 3ms in state CONNECT)")
    'FAIL k:: Connect to  failed '
    """
    return _VARIES.sub("", said)


class Reach:
    """Says once that no broker answers, and once that the cluster does again."""

    def __init__(self) -> None:
        self._is_away = False

    def failed(self, error: "KafkaError") -> None:
        """Take an error of a client, as its `error_cb`."""
        if error.name() == "_ALL_BROKERS_DOWN":
            if not self._is_away:
                self._is_away = True
                _log.warning("kafka: the cluster does not answer: %s", error.str())
        elif error.name() not in _TOLD:
            LOG.warning("kafka: %s", error.str())

    def answered(self) -> None:
        """Take it that the cluster has acknowledged something."""
        if self._is_away:
            self._is_away = False
            _log.warning("kafka: the cluster answers again")


LOG = logging.getLogger(f"{__name__}.client")
"""The logger of all clients of this process, and of what they report again and again."""
LOG.addFilter(Seldom())
REACH = Reach()
"""The reach of the one cluster that this process has."""
