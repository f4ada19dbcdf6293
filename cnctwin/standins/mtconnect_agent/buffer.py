"""The agent's memory: a bounded circular buffer of observations, and the latest value of each data item."""

from collections.abc import Collection, Iterator

from cnctwin.standins.mtconnect_agent.data_set import changes, merged
from cnctwin.standins.mtconnect_agent.device_model import DataItem
from cnctwin.standins.mtconnect_agent.observation import Observation


class LatestValues:
    """The latest observation of each data item; of a condition, all that are active."""

    def __init__(self, values: dict[DataItem, tuple[Observation, ...]] | None = None) -> None:
        self._values = dict(values or {})

    def copy(self) -> "LatestValues":
        return LatestValues(self._values)

    def of(self, item: DataItem) -> tuple[Observation, ...]:
        return self._values.get(item, ())

    def all(self, wanted: Collection[DataItem] | None = None) -> list[Observation]:
        """Return the latest observations, of all items or of those wanted."""
        found: Iterator[tuple[Observation, ...]] = (
            values for item, values in self._values.items() if wanted is None or item in wanted
        )
        return [observation for values in found for observation in values]

    def news_in(self, observation: Observation) -> Observation | None:
        """Return what of an observation isn't known yet, None if nothing: the agent stores no value twice in a row."""
        item, before = observation.item, self.of(observation.item)
        if not before or (item.is_discrete and not observation.is_unavailable):
            return observation
        if item.is_condition:
            return None if self._condition_is_known(before, observation) else observation
        if observation.entries is not None:
            known = before[0].entries
            if known is None or observation.is_reset:  # nothing was known: even a removed entry is news
                return observation
            news = changes(known, observation.entries)
            return observation._replace(entries=news) if news else None
        return None if before[0].says_the_same(observation) else observation

    def apply(self, observation: Observation) -> None:
        """Make an observation the latest."""
        item, before = observation.item, self.of(observation.item)
        if item.is_condition:
            self._values[item] = _active_conditions(before, observation)
        elif observation.entries is not None:
            known = (before[0].entries if before and not observation.is_reset else None) or {}
            self._values[item] = (observation._replace(entries=merged(known, observation.entries)),)
        else:
            self._values[item] = (observation,)

    @staticmethod
    def _condition_is_known(active: tuple[Observation, ...], new: Observation) -> bool:
        if new.level == "Normal" and new.native_code and active[0].level != "Unavailable":
            return all(o.native_code != new.native_code or o.level == "Normal" for o in active)
        if new.level in ("Normal", "Unavailable"):
            return active[0].level == new.level and not active[0].native_code
        return any(o.native_code == new.native_code and o.says_the_same(new) for o in active)


class ObservationBuffer:
    """A circular buffer: sequence numbers from 1, the oldest observation gives way to the newest."""

    def __init__(self, size: int) -> None:
        if size < 1:
            raise ValueError(f"the buffer size {size} is less than 1")
        self.size = size
        self.next_sequence = 1
        self.latest = LatestValues()
        self._ring: list[Observation] = []
        self._before_first = LatestValues()

    @property
    def first_sequence(self) -> int:
        return max(1, self.next_sequence - self.size)

    def add(self, observation: Observation) -> Observation | None:
        """Store an observation under the next sequence number; None if it says nothing new."""
        news = self.latest.news_in(observation)
        if news is None:
            return None
        stored = news._replace(sequence=self.next_sequence)
        if len(self._ring) < self.size:
            self._ring.append(stored)
        else:
            place = (self.next_sequence - 1) % self.size
            self._before_first.apply(self._ring[place])
            self._ring[place] = stored
        self.latest.apply(stored)
        self.next_sequence += 1
        return stored

    def since(self, start: int, count: int, wanted: Collection[DataItem] | None = None) -> tuple[list[Observation], int]:
        """Return up to `count` wanted observations from sequence `start`, and the sequence to go on with."""
        found: list[Observation] = []
        for sequence in range(start, self.next_sequence):
            observation = self._ring[(sequence - 1) % self.size]
            if wanted is None or observation.item in wanted:
                found.append(observation)
                if len(found) >= count:
                    return found, sequence + 1
        return found, self.next_sequence

    def latest_at(self, sequence: int) -> LatestValues:
        """Return the latest values as they were when `sequence` was stored; it must still be in the buffer."""
        values = self._before_first.copy()
        for earlier in range(self.first_sequence, sequence + 1):
            values.apply(self._ring[(earlier - 1) % self.size])
        return values


def _active_conditions(active: tuple[Observation, ...], new: Observation) -> tuple[Observation, ...]:
    """Return what is active after `new`: Normal without a code clears everything, with a code only that one."""
    if new.level == "Unavailable" or (new.level == "Normal" and not new.native_code):
        return (new,)
    kept = tuple(o for o in active if o.level in ("Warning", "Fault") and o.native_code != new.native_code)
    if new.level != "Normal":
        return (*kept, new)
    return kept or (new._replace(native_code="", attributes=(), value=""),)
