"""Limits on how often a birth is repeated on request, and requested.

Many hosts may miss the same birth at once. The edge answers all requests of a window with one birth; a host waits a moment
before it asks, asks no more if a birth has come meanwhile, and waits longer each time that a node does not answer.
"""

from dataclasses import dataclass
from random import Random

from sparkplug.topics import NodeId


@dataclass(slots=True)
class RebirthAnswer:
    """The edge's side: a few rebirths at once, then one each `interval_ms_min`; what exceeds that is answered together, later.

    The few are for hosts that start together; while an answer is due no data may go out, so it had better be rare.
    """

    interval_ms_min: int
    at_once_max: int = 4
    _left: float = -1.0
    _last_ms: int = 0
    _due_ms: int | None = None

    @property
    def is_due(self) -> bool:
        """Return whether a request waits for its answer."""
        return self._due_ms is not None

    def request(self, now_ms: int) -> bool:
        """Note a request; True where the birth is to be sent now."""
        self._refill(now_ms)
        if self._left >= 1.0:
            self._left -= 1.0
            return True
        if self._due_ms is None:
            self._due_ms = now_ms + round((1.0 - self._left) * self.interval_ms_min)
        return False

    def due(self, now_ms: int) -> bool:
        """True once when a request that had to wait is to be answered."""
        if self._due_ms is None or now_ms < self._due_ms:
            return False
        self._refill(now_ms)
        self._left, self._due_ms = max(self._left - 1.0, 0.0), None
        return True

    def _refill(self, now_ms: int) -> None:
        if self._left < 0.0:
            self._left = float(self.at_once_max)
        else:
            gained = max(now_ms - self._last_ms, 0) / self.interval_ms_min
            self._left = min(self._left + gained, float(self.at_once_max))
        self._last_ms = now_ms


@dataclass(slots=True)
class _Request:
    due_ms: int
    wanted: bool = True
    attempts: int = 0
    asked_ms: int | None = None


class RebirthRequests:
    """The host's side: when to ask which node.

    The first request waits up to `spread_ms`, by chance, so that one of many hosts asks for all. A node is asked again after
    `interval_ms_min`, doubled each time up to `interval_ms_max`; the doubling is forgotten after a quiet `interval_ms_max`.
    After `attempts_max` requests without a birth the node is left alone until it sends something again.
    """

    def __init__(
        self,
        chance: Random,
        *,
        interval_ms_min: int = 5000,
        interval_ms_max: int = 60_000,
        spread_ms: int = 300,
        attempts_max: int = 8,
    ) -> None:
        self._chance = chance
        self._interval_ms_min = interval_ms_min
        self._interval_ms_max = interval_ms_max
        self._spread_ms = spread_ms
        self._attempts_max = attempts_max
        self._requests: dict[NodeId, _Request] = {}

    def want(self, node: NodeId, now_ms: int) -> None:
        """The node's birth is needed."""
        soon = now_ms + self._chance.randint(0, self._spread_ms)
        request = self._requests.get(node)
        if request is None:
            self._requests[node] = _Request(soon)
        elif not request.wanted:
            request.wanted = True
            if request.asked_ms is not None and now_ms - request.asked_ms > self._interval_ms_max:
                request.attempts = 0
            request.due_ms = soon if request.asked_ms is None else max(soon, request.asked_ms + self._wait_ms(request))

    def born(self, node: NodeId) -> None:
        """The birth has come, whoever asked for it."""
        if (request := self._requests.get(node)) is not None:
            request.wanted = False

    def due(self, now_ms: int) -> list[NodeId]:
        """The nodes that are to be asked now."""
        nodes = [node for node, request in self._requests.items() if request.wanted and now_ms >= request.due_ms]
        for node in nodes:
            request = self._requests[node]
            request.attempts += 1
            request.asked_ms = now_ms
            request.due_ms = now_ms + self._wait_ms(request)
            request.wanted = request.attempts < self._attempts_max
        return nodes

    def _wait_ms(self, request: _Request) -> int:
        return min(self._interval_ms_min << max(request.attempts - 1, 0), self._interval_ms_max)
