"""The way from one connection to the next: which broker of the list is dialled, and after what pause.

A connection that lasted is made again at the same broker. After one that did not come about or did not last, the next broker's
turn has come, and the pause doubles: two nodes with one id throw each other out again and again. A session that walks (5.4,
primary host offline) goes to the next broker with the shortest pause: nothing has failed.
"""

from collections.abc import Sequence
from random import Random

from sparkplug.broker import BrokerAddress

PAUSE_S_MIN = 0.2
PAUSE_S_MAX = 15.0
ABSENT_S_MAX = 0.5  # where nobody listens: knocking costs nobody anything, and live values are wanted soon after its return
STABLE_S = 5.0


class Itinerary:
    """The brokers of a connection, and where it stands among them. Times are those of time.monotonic."""

    def __init__(self, brokers: Sequence[BrokerAddress], chance: Random) -> None:
        self.server = 0
        self._brokers = tuple(brokers)
        self._chance = chance
        self._pause_s = PAUSE_S_MIN
        self._accepted_s: float | None = None
        self._walks = False

    @property
    def broker(self) -> BrokerAddress:
        """The broker whose turn it is."""
        return self._brokers[self.server]

    def accepted(self, now_s: float) -> None:
        """The broker has accepted the connection."""
        self._accepted_s = now_s

    def walk(self) -> None:
        """The session leaves this broker by its own will and goes on to the next one."""
        self._walks = True

    def ended(self, now_s: float, *, somebody_listens: bool) -> float:
        """Return the pause before the next attempt, after a connection or an attempt has ended."""
        lasted = self._accepted_s is not None and now_s - self._accepted_s > STABLE_S
        if self._walks or not lasted:
            self.server = (self.server + 1) % len(self._brokers)
        longest_s = PAUSE_S_MAX if somebody_listens else ABSENT_S_MAX
        self._pause_s = PAUSE_S_MIN if self._walks or lasted else min(2 * self._pause_s, longest_s)
        self._accepted_s, self._walks = None, False
        return self._pause_s * self._chance.uniform(0.8, 1.2)
