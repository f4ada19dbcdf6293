"""A receiver of notifications: takes what the courier sends, refuses, or takes it and does not answer. Stands for HTTP."""

from collections import Counter
from random import Random
from typing import Any

from processors.alerts.courier.exchange import Answer, Request
from processors.alerts.courier.outcome import Outcome, Verdict
from tests.plant.simulation.kernel import Kernel

LATENCY_S = (0.02, 1.5)


class Receiver:
    """`trouble`: the share of requests that go wrong in one way or the other."""

    def __init__(self, kernel: Kernel, chance: Random) -> None:
        self.trouble = 0.0
        self.is_deadly = False  # the next courier that comes is killed while it waits for the answer
        self.arrived: Counter[str] = Counter()
        self._kernel, self._chance = kernel, chance

    def exchanged(self, request: Request, timeout_s: float) -> Answer | Outcome:
        """As processors.alerts.courier.exchange.exchanged."""
        key = _key(request)
        self._kernel.sleep(self._chance.uniform(*LATENCY_S))
        wrong = self._chance.random() < self.trouble
        if wrong and self._chance.random() < 0.5:
            self._kernel.note("not taken", key)
            return Outcome(Verdict.NOT_TAKEN, "refused") if self._chance.random() < 0.5 else Answer(503, {}, b"")
        self.arrived[key] += 1
        self._kernel.note("notified", key)
        if self.is_deadly:
            self.is_deadly = False
            self._kernel.me().process.kill()
        if wrong:
            return Outcome(Verdict.UNSURE, "no answer; it may have arrived")
        self._kernel.sleep(self._chance.uniform(0.0, 0.3))  # a courier that is killed here never knows
        return Answer(200, {}, b"")


def _key(request: Request) -> str:
    headers: Any = request.headers
    return str(headers["X-Cnctwin-Notification"])
