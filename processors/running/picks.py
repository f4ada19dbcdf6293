"""The readings of a message that a processor takes, found once for all messages that carry the same names."""

from collections.abc import Callable, Sequence
from operator import itemgetter
from typing import NamedTuple

from sparkplug.host_event import HostEvent
from sparkplug.metric import NodeId, Reading

Stream = tuple[NodeId, tuple[Reading, ...], tuple[str, ...], int, int]
"""A message of live data: its node, its readings, their names, their oldest and their newest stamp."""
LAYOUTS_MAX = 20_000  # that are remembered; then all are forgotten, and found again


def stream_of(event: HostEvent) -> Stream:
    """The data of an event whose names are given."""
    return event.node, event.readings, event.names, event.oldest_ms, event.newest_ms


class Pick(NamedTuple):
    """The readings that are taken: their names, and a function that gets them out of the message, in its order.

    wakes: one of them is a signal whose change is folded as it comes
    """

    names: tuple[str, ...]
    get: Callable[[Sequence[Reading]], tuple[Reading, ...]]
    wakes: bool


class Picks:
    """Finds the readings that a processor takes, by the names in a message. `inputs` None takes everything."""

    def __init__(self, inputs: frozenset[str] | None, wakes: frozenset[str] | None) -> None:
        self.inputs, self._wakes = inputs, wakes
        self._known: dict[tuple[str, ...], Pick] = {}

    def of(self, names: tuple[str, ...]) -> Pick:
        """Return what is taken of a message with these names."""
        known = self._known.get(names)
        if known is None:
            if len(self._known) >= LAYOUTS_MAX:
                self._known.clear()
            known = self._known[names] = self._found(names)
        return known

    def _found(self, names: tuple[str, ...]) -> Pick:
        inputs = self.inputs
        places = tuple(place for place, name in enumerate(names) if inputs is None or name in inputs)
        taken = tuple(names[place] for place in places)
        return Pick(taken, _getter(places, len(names)), self._wakes is None or not self._wakes.isdisjoint(taken))


def _getter(places: tuple[int, ...], count: int) -> Callable[[Sequence[Reading]], tuple[Reading, ...]]:
    """Return a function that takes these places out of a sequence."""
    if len(places) == count:
        return tuple
    if len(places) == 1:
        (place,) = places
        return lambda readings: (readings[place],)
    return itemgetter(*places) if places else lambda _: ()
