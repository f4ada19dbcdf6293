"""The lanes whose silence is watched, by when it is next worth a look.

A machine that goes on talking is looked at every few seconds; one that is silent, at each tick. To ask a thousand machines at
each turn of the loop whether they are silent would cost more than their messages.
"""

import heapq
import itertools

from processors.running.unit import Machine


class Silences:
    """`margin_s`: how long a message may be on its way before its machine counts as silent."""

    def __init__(self, margin_s: float) -> None:
        self.margin_s = margin_s
        self._due: list[tuple[float, int, Machine]] = []
        self._numbers = itertools.count()

    def watch(self, machine: Machine) -> None:
        """A message of the machine has come: from now on it may be silent."""
        if not machine.live.is_awaited and (at_s := machine.live.silent_at_s(self.margin_s)) is not None:
            machine.live.is_awaited = True
            heapq.heappush(self._due, (at_s, next(self._numbers), machine))

    def due(self, wall_s: float) -> list[Machine]:
        """The machines that may have something to give by now, by name, so that a restart changes no order: each of them is to
        be asked, and watched again."""
        due, machines = self._due, []
        while due and due[0][0] <= wall_s:
            machine = heapq.heappop(due)[2]
            machine.live.is_awaited = False
            at_s = machine.live.silent_at_s(self.margin_s)
            if at_s is not None and at_s > wall_s:  # it has said something since
                machine.live.is_awaited = True
                heapq.heappush(due, (at_s, next(self._numbers), machine))
            elif at_s is not None:
                machines.append(machine)
        return sorted(machines, key=lambda machine: machine.name)
