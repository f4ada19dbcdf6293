"""Retention: how long what is kept. What a processor says (`twin/…`), roll-ups, pins and what is pinned stay for ever."""

import math
from dataclasses import dataclass

from cnctwin.memory.store.contract import StoreError

DAY_MS = 86_400_000


@dataclass(frozen=True, slots=True)
class Retention:
    """The policy of a store.

    raw_days: signals of the controls at their full rate
    block_days: arrays and bytes, as vibration comes
    disk_bytes: how large the store may become; past it the oldest raw goes first that is not pinned. None: as large as the disk
    """

    raw_days: float = 365.0
    block_days: float = 7.0
    disk_bytes: int | None = None

    def __post_init__(self) -> None:
        for name in ("raw_days", "block_days"):
            days = getattr(self, name)
            if not (math.isfinite(days) and 0.05 <= days <= 36_500):
                raise StoreError(f"{name} {days}: give 0.05 to 36500 days")
        if self.disk_bytes is not None and self.disk_bytes < 10_000_000:
            raise StoreError(f"disk_bytes {self.disk_bytes}: a store needs 10 MB at least")
