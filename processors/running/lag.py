"""The lag of a process: how late its messages are folded, and its results handed on, whatever the clocks of the edges show.

    extra delay of a node = age of its last message when it was folded - the least age that its messages have
    lag = median over the nodes of the extra delay; it grows by no more than a second a second

An age is our monotonic clock minus the stamp of the message, so its zero means nothing, and a clock that is wrong is no lag: it
moves the least age as well. (One-way delay over base delay, as in RFC 6817, LEDBAT.) So all that waits counts, in this process,
in the socket or in the broker, and one edge that sends late does not: the others are in time.

The least age is learned anew where the stamps of a node go back: its clock was set. While the process is in time it creeps up
faster than a clock drifts. And a lag that stands still for minutes, while the process has time to spare, was a clock that was
slewed. What it cannot see: a delay that was there from the start and never changed, and one that grows by less than the creeping.
"""

from statistics import median_low

CREEP = 2e-4  # seconds a second: more than a clock drifts
IN_TIME_S = 1.0
SET_BACK_MS = 1000
STANDS_STILL_S = 300.0
STANDS_STILL_WITHIN_S = 0.5
SPARE_PCT = 70.0
NODES_MAX = 5000


class Lag:
    """The lag of one process. `now_s` is of a clock that only goes forward, `cpu_s` the CPU time of the process."""

    def __init__(self, now_s: float, cpu_s: float) -> None:
        self.folded_s = self.published_s = self.busy_pct = 0.0  # of the last report
        self._stamps_ms: dict[str, int] = {}
        self._ages_s: dict[str, float] = {}  # of the last message of each node since the last report
        self._least_s: dict[str, float] = {}
        self._reported_s, self._cpu_s = now_s, cpu_s
        self._still_s, self._still_since_s = 0.0, now_s  # the lag that stands still, and since when
        self._unpublished_s: float | None = None  # since when
        self._held_s = 0.0

    def folded(self, node: str, stamp_ms: int, now_s: float) -> None:
        """Note a message of an edge that was folded, by the stamp of the message; none that holds history."""
        before_ms = self._stamps_ms.get(node)
        if before_ms is None and len(self._stamps_ms) >= NODES_MAX:
            return
        if before_ms is not None and stamp_ms < before_ms - SET_BACK_MS:
            self._least_s.pop(node, None)
        self._stamps_ms[node] = stamp_ms
        self._ages_s[node] = now_s - stamp_ms / 1000
        if self._unpublished_s is None:
            self._unpublished_s = now_s

    def published(self, now_s: float) -> None:
        """Note that the results of all that was folded have been handed to the broker."""
        if self._unpublished_s is not None:
            self._held_s = max(self._held_s, now_s - self._unpublished_s)
            self._unpublished_s = None

    def report(self, now_s: float, cpu_s: float) -> None:
        """Work out the figures of the time since the last report; call it about once a second."""
        passed_s = now_s - self._reported_s
        self.busy_pct = 100.0 * (cpu_s - self._cpu_s) / passed_s if passed_s > 0.0 else 0.0
        self._reported_s, self._cpu_s = now_s, cpu_s
        creep_s = CREEP * passed_s if self.folded_s < IN_TIME_S else 0.0
        least_s = self._least_s
        for node, age_s in self._ages_s.items():
            # A node that is new while we are behind is as late as the others.
            known_s = least_s[node] + creep_s if node in least_s else age_s - self.folded_s
            least_s[node] = min(known_s, age_s)
        extra_s = [age_s - least_s[node] for node, age_s in self._ages_s.items()]
        self.folded_s = min(median_low(extra_s), self.folded_s + passed_s) if extra_s else 0.0
        self._forget_what_stands_still(now_s)
        if self._unpublished_s is not None:
            self._held_s = max(self._held_s, now_s - self._unpublished_s)
        self.published_s = self.folded_s + self._held_s
        self._ages_s.clear()
        self._held_s = 0.0

    def _forget_what_stands_still(self, now_s: float) -> None:
        is_still = self.folded_s >= IN_TIME_S and abs(self.folded_s - self._still_s) <= STANDS_STILL_WITHIN_S
        if not is_still or self.busy_pct >= SPARE_PCT:
            self._still_s, self._still_since_s = self.folded_s, now_s
        elif now_s - self._still_since_s >= STANDS_STILL_S:
            self._least_s.clear()
            self.folded_s = 0.0
