"""The courier of alerts beside a runner: at work for as long as the runner has the partition in which the alerts are.

Alerts are one cell, and so in one partition, whoever has it: a rebalance moves the courier along with them. It is started and
stopped in a thread of its own. A runner whose partition goes waits a moment for the courier to end, since the next runner gets
the partition after that; a receiver that is slow to answer holds nobody up for longer. Then two couriers overlap, as they do
where a runner hangs that the group has given up. Each sends only what it sees claimed for itself on the broker, so nothing is
sent twice (processors/alerts/courier/desk.py).

While the cluster is away nobody can have taken the partition, or a runner cannot know: its courier goes on until the group has
shared out the partitions again.
"""

import logging
from collections.abc import Callable, Collection
from threading import Condition, Thread
from types import TracebackType
from typing import Protocol

from cnctwin.kafka.assigned import Place
from processors.errors import ConfigurationError

LEAVE_S_MAX = 1.5  # for which a rebalance waits
CLOSE_S_MAX = 25.0  # longer than a courier takes to end
AGAIN_S = 5.0
_log = logging.getLogger(__name__)


class Startable(Protocol):
    """A thing that works from `start` to `stop`, once."""

    def start(self) -> None: ...

    def stop(self) -> None: ...


class MovingCourier:
    """See the module. `new` makes a courier; `home`: where the alerts are.

    Making it makes the first courier, which raises ConfigurationError where a secret is missing. A context: leave it to end.
    """

    def __init__(self, new: Callable[[], Startable], home: Place) -> None:
        self._new, self._home = new, home
        self._next: Startable | None = new()
        self._changed = Condition()
        self._is_wanted = self._is_at_work = self._is_over = False
        self._thread = Thread(target=self._run, name="courier's keeper", daemon=True)

    def __enter__(self) -> "MovingCourier":
        self._thread.start()
        return self

    def __exit__(self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None) -> None:
        with self._changed:
            self._is_wanted, self._is_over = False, True
            self._changed.notify_all()
        self._thread.join(CLOSE_S_MAX)

    @property
    def is_at_work(self) -> bool:
        """True from the start of a courier to the end of its last message."""
        return self._is_at_work

    def hold(self, places: Collection[Place]) -> None:
        """Take note of the partitions that the runner has by now. Returns after LEAVE_S_MAX at the latest."""
        with self._changed:
            self._is_wanted = self._home in places
            self._changed.notify_all()
            if not self._is_wanted and not self._changed.wait_for(lambda: not self._is_at_work, LEAVE_S_MAX):
                _log.warning("the partition of alerts goes, and the courier is still sending; it ends when that is done")

    # The keeper's thread: one courier ends before the next begins.

    def _run(self) -> None:
        while self._awaited(lambda: self._is_wanted):
            try:
                courier, self._next = self._next or self._new(), None
            except ConfigurationError as error:  # a file of a secret that is gone since
                _log.error("no courier can be started, so no notification is sent: %s; another attempt in %g s", error, AGAIN_S)
                self._awaited(lambda: not self._is_wanted, AGAIN_S)
                continue
            self._work(courier)

    def _work(self, courier: Startable) -> None:
        with self._changed:
            if not self._is_wanted:
                self._next = courier
                return
            self._is_at_work = True
        try:
            courier.start()
            _log.info("the courier is here")
            self._awaited(lambda: not self._is_wanted)
            courier.stop()
        except Exception:
            _log.exception("the courier failed")
            self._awaited(lambda: not self._is_wanted, AGAIN_S)
        finally:
            with self._changed:
                self._is_at_work = False
                self._changed.notify_all()
        _log.info("the courier is gone")

    def _awaited(self, condition: Callable[[], bool], timeout_s: float | None = None) -> bool:
        """Wait for a condition, or for the end; return False at the end."""
        with self._changed:
            self._changed.wait_for(lambda: self._is_over or condition(), timeout_s)
            return not self._is_over
