"""The lag of a process: how long its messages have waited, whatever the clocks of the edges show.

    extra delay of a message = (its age when it was folded) - (the usual age of messages of that node)
    lag = min(median over the nodes of the extra delay, time since nothing waited)

An age is our monotonic clock minus the stamp of the message, so its zero means nothing; a clock that is wrong, or another that is
set, moves the usual age of its node and no lag. The usual age is that of the node's last message while the process was caught up:
reading found nothing that waited within the last second. So what waits in the socket, or in the broker, counts as well, and one
edge that is late, or whose clock is set back, is no lag of ours: the others are in time.

It cannot see what waits in front of the broker, and a delay that all messages have had since the process began.
"""

from statistics import median_low

CAUGHT_UP_S = 1.0
NODES_MAX = 5000


class Lag:
    """The lag of one process. `now_s` is of a clock that only goes forward, `cpu_s` the CPU time of the process."""

    def __init__(self, now_s: float, cpu_s: float) -> None:
        self.folded_s = self.published_s = self.busy_pct = 0.0  # of the last report
        self.caught_up_s = now_s  # when nothing was seen to wait
        self._ages_s: dict[str, float] = {}  # of the last message of each node since the last report
        self._usual_s: dict[str, float] = {}
        self._reported_s = now_s
        self._cpu_s = cpu_s
        self._unpublished_s: float | None = None  # since when
        self._held_s = 0.0

    def caught_up(self, now_s: float) -> None:
        """Note that reading has found nothing that waited, while the broker was connected."""
        self.caught_up_s = now_s

    def folded(self, node: str, stamp_ms: int, now_s: float) -> None:
        """Note a message of an edge that was folded; none that is history, or was stamped by anybody else."""
        if node in self._usual_s or node in self._ages_s or len(self._usual_s) + len(self._ages_s) < NODES_MAX:
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
        behind_s_max = now_s - self.caught_up_s
        is_caught_up = behind_s_max <= CAUGHT_UP_S
        for node, age_s in self._ages_s.items():
            if is_caught_up:
                self._usual_s[node] = age_s
            elif node not in self._usual_s:  # born while we are behind: it is as late as the others
                self._usual_s[node] = age_s - self.folded_s
        extra_s = [age_s - self._usual_s[node] for node, age_s in self._ages_s.items()]
        self.folded_s = max(0.0, min(behind_s_max, median_low(extra_s))) if extra_s else 0.0
        if self._unpublished_s is not None:
            self._held_s = max(self._held_s, now_s - self._unpublished_s)
        self.published_s = self.folded_s + self._held_s
        passed_s = now_s - self._reported_s
        self.busy_pct = 100.0 * (cpu_s - self._cpu_s) / passed_s if passed_s > 0.0 else 0.0
        self._reported_s, self._cpu_s = now_s, cpu_s
        self._ages_s.clear()
        self._held_s = 0.0
