"""A place in which a runner keeps what it reads, beside its folds: each record once, since the offset is kept with it."""

from typing import Protocol

from processors.actions import Pin
from sparkplug.records.record import Record


class Sink(Protocol):
    """A store that keeps records with their offsets in one transaction of its own."""

    def begin(self, place: tuple[str, int], offset: int) -> int:
        """Return from where a partition is to be read, so that the store misses nothing; its folds go on at `offset`."""

    def keep(self, place: tuple[str, int], offset: int, record: Record) -> None:
        """Have a record kept with the next `write`; one that is kept already changes nothing."""

    def pin(self, pin: Pin) -> None:
        """Keep a stretch of a machine from being swept."""

    def write(self) -> None:
        """Write what waits; when this returns it is kept, whatever happens."""
