"""The order in which the units of a processor are saved.

What has changed is saved every two seconds while that is little; of much, so many bytes a second, the unit that has waited the
longest first. Before its turn comes a unit that was never saved, since what its estimate was started from would be lost for
good, and one that has raised or ended an alarm, since nobody is to hear of it twice.
"""

from collections.abc import Iterator, Sequence
from itertools import chain, islice, takewhile

AGAIN_S = 1.0  # after which a change is saved; it is noted once a second
BYTES_A_SECOND = 40_000  # of one processor: some 30 machines
BYTES_AT_ONCE = 120_000
BYTES_MIN = 500  # of a unit


class Saves:
    """See the module."""

    def __init__(self) -> None:
        self._since_s: dict[str, float] = {}  # of each unit that is not saved as it is, in the order in which they changed
        self._pressing: dict[str, None] = {}
        self._saved: set[str] = set()
        self._bytes_left, self._filled_s = float(BYTES_AT_ONCE), 0.0

    def changed(self, units: Sequence[str], now_s: float) -> None:
        """Note that units have changed since they were saved last."""
        for unit in units:
            self._since_s.setdefault(unit, now_s)

    def press(self, unit: str, now_s: float) -> None:
        """Note that a unit is to be saved before the others."""
        self._pressing[unit] = None
        self._since_s.setdefault(unit, now_s)

    def is_saved(self, unit: str) -> bool:
        """Return True if the unit was saved before."""
        return unit in self._saved

    def due(self, now_s: float) -> Iterator[str]:
        """Yield the units that are to be saved now. One that is not `saved` or forgotten before the next one is due again."""
        if not self._since_s:
            return
        self._bytes_left = min(self._bytes_left + (now_s - self._filled_s) * BYTES_A_SECOND, float(BYTES_AT_ONCE))
        self._filled_s = now_s
        if self._bytes_left <= 0.0:
            return
        waited = takewhile(lambda unit: now_s - self._since_s[unit] >= AGAIN_S, self._since_s)
        at_most = 1 + int(self._bytes_left / BYTES_MIN)
        for unit in list(dict.fromkeys(islice(chain(self._pressing, waited), at_most))):
            if self._bytes_left <= 0.0:
                return
            yield unit

    def all(self) -> list[str]:
        """Return all units that are not saved as they are."""
        return list(self._since_s)

    def saved(self, unit: str, size: int) -> None:
        """Note that a unit is saved as it is, in so many bytes."""
        self._bytes_left -= size
        self._saved.add(unit)
        self._since_s.pop(unit, None)
        self._pressing.pop(unit, None)

    def forget(self, unit: str) -> None:
        """Note that a unit is no more."""
        self._saved.discard(unit)
        self._since_s.pop(unit, None)
        self._pressing.pop(unit, None)

    def age_s(self, now_s: float) -> float:
        """Return for how long the oldest change has not been saved, s."""
        return max((now_s - since_s for since_s in self._since_s.values()), default=0.0)
