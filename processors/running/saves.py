"""Which units of a processor are saved next.

What has changed is saved every two seconds while few units change; of many, so many a second, the one that has waited longest
first. Before its turn comes a unit that was never saved, since what its estimate was started from would be lost for good, and one
that has raised or ended an alarm, since nobody is to be told twice.
"""

from collections.abc import Sequence

AGAIN_S = 1.0  # after which a change is saved; it is noted once a second
A_SECOND_MAX = 20  # units of one processor
AT_ONCE_MAX = 60


class Saves:
    """See the module."""

    def __init__(self) -> None:
        self._since_s: dict[str, float] = {}  # of each unit that is not saved as it is, in the order in which they changed
        self._pressing: dict[str, None] = {}
        self._saved: set[str] = set()
        self._left, self._filled_s = float(AT_ONCE_MAX), 0.0

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

    def due(self, now_s: float) -> list[str]:
        """Return the units that are to be saved now. Each is due again until it is `saved`."""
        if not self._since_s:
            return []
        self._left = min(self._left + (now_s - self._filled_s) * A_SECOND_MAX, float(AT_ONCE_MAX))
        self._filled_s = now_s
        room = int(self._left)
        units = [*self._pressing][:room]
        for unit, since_s in self._since_s.items():
            if len(units) >= room or now_s - since_s < AGAIN_S:
                break
            if unit not in self._pressing:
                units.append(unit)
        self._left -= len(units)
        return units

    def all(self) -> list[str]:
        """Return all units that are not saved as they are."""
        return list(self._since_s)

    def saved(self, unit: str) -> None:
        """Note that a unit is saved as it is."""
        self._saved.add(unit)
        self._since_s.pop(unit, None)
        self._pressing.pop(unit, None)

    def forget(self, unit: str) -> None:
        """Note that a unit is no more."""
        self.saved(unit)
        self._saved.discard(unit)

    def age_s(self, now_s: float) -> float:
        """Return for how long the oldest change has not been saved, s."""
        return max((now_s - since_s for since_s in self._since_s.values()), default=0.0)
