"""The counts of partitions, those included that have gone: sums that never fall while the runner lives.

A partition's ledger begins at 0 wherever it is restored. Without those that have gone the sum of all runners would fall with
every partition that moves, and whoever draws its rise would take the rest for new.
"""

from collections import Counter
from collections.abc import Iterable

from processors.partition.partition import Partition
from twin.vocabulary.node_ledger import BUFFERED, RECEIVED

MACHINES = "machines"


class Counted:
    """See the module."""

    def __init__(self) -> None:
        self._gone: dict[str, Counter[str]] = {}
        self._repeated = 0

    def retire(self, partition: Partition) -> None:
        """Keep the counts of a partition that goes, or is restored again; it has neither machines nor anything held back then."""
        for name, counts in _of(partition):
            without_gauges(counts)
            self._gone.setdefault(name, Counter()).update(counts)
        self._repeated += partition.repeated

    def ledgers(self, partitions: Iterable[Partition]) -> dict[str, dict[str, int]]:
        """Return the ledger of each processor, its machines and what else it counts."""
        totals = {name: Counter(counts) for name, counts in self._gone.items()}
        for partition in partitions:
            for name, counts in _of(partition):
                totals.setdefault(name, Counter()).update(counts)
        return {name: dict(total) for name, total in totals.items()}

    def repeated(self, partitions: Iterable[Partition]) -> int:
        """Return how many records were there before."""
        return self._repeated + sum(partition.repeated for partition in partitions)


def without_gauges(counts: Counter[str]) -> None:
    """Leave what only rises: messages that were held back and went with their partition were never received, it says then."""
    counts[RECEIVED] -= counts[BUFFERED]
    counts[BUFFERED] = counts[MACHINES] = 0


def _of(partition: Partition) -> Iterable[tuple[str, Counter[str]]]:
    for seat in partition.seats:
        engine = seat.engine
        counts: Counter[str] = Counter(engine.ledger.metrics())
        counts.update({MACHINES: len(engine.machines), "holes": engine.counts.holes, "late": engine.counts.late})
        counts.update({"ticks": engine.counts.ticks, "ignored": engine.counts.ignored})
        counts.update({"snapshots_rejected": engine.counts.snapshots_rejected})
        yield seat.name, counts
