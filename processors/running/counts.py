"""The counts of a processor beside the ledger."""

from dataclasses import dataclass


@dataclass(slots=True)
class Counts:
    """See processors/running/health.py for what each means."""

    ticks: int = 0
    holes: int = 0
    late: int = 0
    dead_letters: int = 0
    ignored: int = 0
    snapshots_rejected: int = 0
