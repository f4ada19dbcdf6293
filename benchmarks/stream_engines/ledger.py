"""The account of the outputs: which came, how often, and which differ from what an undisturbed fold gives."""

import json
from collections import Counter

from benchmarks.stream_engines.fold import expected


class Ledger:
    """An account of the outputs that were read: how often each came, and which were wrong."""

    def __init__(self, messages: int, state_bytes: int) -> None:
        self.due = {(machine, count): result for machine, count, result in expected(messages, state_bytes)}
        self.times, self.wrong, self.newest = Counter[tuple[str, int]](), set[str](), dict[str, int]()

    def take(self, value: bytes) -> bool:
        """Enter an output; True if it is the first of its message."""
        output = json.loads(value)
        machine, count = place = output["machine"], output["count"]
        self.times[place] += 1
        if self.due.get(place) != (output["sum"], output["oldest"]):
            self.wrong.add(machine)
        self.newest[machine] = max(count, self.newest.get(machine, 0))
        return self.times[place] == 1

    @property
    def complete(self) -> bool:
        """True once there is an output of every message."""
        return len(self.times) >= len(self.due)

    def repeated(self) -> int:
        """Return how many outputs came again."""
        return self.times.total() - len(self.times)

    def exact(self) -> int:
        """Return the number of keys of which every output came, and none differed from what an undisturbed fold gives."""
        missing = {machine for machine, count in self.due if not self.times[machine, count]}
        return len({machine for machine, _ in self.due} - missing - self.wrong)
