"""The lag of a process: how late its messages are folded, and its results handed on, whatever the clocks of the edges show.

    extra delay of a node = age of its last message when it was folded - the least age that its messages have
    lag = median over the nodes of the extra delay; it grows by no more than a second a second

An age is our monotonic clock minus the stamp of the message, so its zero means nothing, and a clock that is wrong is no lag: it
moves the least age as well. (One-way delay over base delay, as in RFC 6817, LEDBAT.) So all that waits counts, in this process,
in the socket or in the broker, and one edge that sends late does not: the others are in time.

Many messages may wait when a process starts, so the first of a node says nothing of its least age. A clock that can be right,
since its first message is less than a minute old, is taken to be right. A lag that stands still, while the process has time to
spare, was a wrong clock, and is forgotten. The least age is learned again where stamps go back: the clock was set. While the
process is in time it creeps up, faster than clocks drift. What this cannot see: a delay that never changes, of edges whose clocks
are more than a minute off, and one that hardly changes while the process has time to spare.
"""

from statistics import median_low

CREEP = 2e-4  # seconds a second: more than a clock drifts
IN_TIME_S = 1.0
SET_BACK_MS = 1000
MAY_BE_RIGHT_S = 60.0
STANDS_STILL_S = 10.0
STANDS_STILL_WITHIN_S = 0.5
SPARE_PCT = 90.0
NODES_MAX = 5000


class Lag:
    """The lag of one process. `now_s` is of a clock that only goes forward, `wall_s` UTC, `cpu_s` the CPU time of the process."""

    def __init__(self, now_s: float, wall_s: float, cpu_s: float) -> None:
        self.folded_s = self.published_s = self.busy_pct = 0.0  # of the last report
        self._stamps_ms: dict[str, int] = {}
        self._ages_s: dict[str, float] = {}  # of the last message of each node since the last report
        self._least_s: dict[str, float] = {}
        self._reported_s, self._cpu_s = now_s, cpu_s
        self._most_s = 0.0  # that the lag can be: the last one that was seen, and the time since
        self._to_wall_s = wall_s - now_s
        self._still_s, self._still_since_s = 0.0, now_s  # the extra delay that stands still, and since when
        self._unpublished_s: float | None = None  # since when
        self._held_s = 0.0

    def folded(self, node: str, stamp_ms: int, now_s: float) -> None:
        """Note a message of an edge that was folded, by the stamp of the message; none that holds history."""
        before_ms = self._stamps_ms.get(node)
        if before_ms is None and len(self._stamps_ms) >= NODES_MAX:
            return
        self._ages_s[node] = age_s = now_s - stamp_ms / 1000
        if before_ms is None:
            wall_age_s = age_s + self._to_wall_s
            self._least_s[node] = -self._to_wall_s if wall_age_s <= MAY_BE_RIGHT_S else age_s - self.folded_s
        elif stamp_ms < before_ms - SET_BACK_MS:
            self._least_s[node] = age_s - self.folded_s  # as late as it was
        self._stamps_ms[node] = stamp_ms
        if self._unpublished_s is None:
            self._unpublished_s = now_s

    def published(self, now_s: float) -> None:
        """Note that the results of all that was folded have been handed to the broker."""
        if self._unpublished_s is not None:
            self._held_s = max(self._held_s, now_s - self._unpublished_s)
            self._unpublished_s = None

    def report(self, now_s: float, wall_s: float, cpu_s: float) -> None:
        """Work out the figures of the time since the last report; call it about once a second."""
        passed_s = now_s - self._reported_s
        self.busy_pct = 100.0 * (cpu_s - self._cpu_s) / passed_s if passed_s > 0.0 else 0.0
        self._reported_s, self._cpu_s, self._to_wall_s = now_s, cpu_s, wall_s - now_s
        creep_s = CREEP * passed_s if self.folded_s < IN_TIME_S else 0.0
        least_s = self._least_s
        for node, age_s in self._ages_s.items():
            least_s[node] = min(least_s[node] + creep_s, age_s)
        extra_s = median_low([age_s - least_s[node] for node, age_s in self._ages_s.items()]) if self._ages_s else 0.0
        if self._stands_still(extra_s, now_s):
            self._least_s.update(self._ages_s)
            extra_s = 0.0
        self._most_s += passed_s
        self.folded_s = min(extra_s, self._most_s)
        if self._ages_s:
            self._most_s = self.folded_s
        if self._unpublished_s is not None:
            self._held_s = max(self._held_s, now_s - self._unpublished_s)
        self.published_s = self.folded_s + self._held_s
        self._ages_s.clear()
        self._held_s = 0.0

    def _stands_still(self, extra_s: float, now_s: float) -> bool:
        is_still = extra_s >= IN_TIME_S and abs(extra_s - self._still_s) <= STANDS_STILL_WITHIN_S
        if not is_still or self.busy_pct >= SPARE_PCT:
            self._still_s, self._still_since_s = extra_s, now_s
        return now_s - self._still_since_s >= STANDS_STILL_S
