"""The store of an edge that has none (`[store] enabled = false`): rows go out at once, and what finds no broker is dropped.

The next birth carries the newest values. The place in the control's stream is kept in a file of its own.
"""

from collections import Counter
from collections.abc import Iterable, Mapping, Sequence

from edge.place import Place, PlaceFile
from edge.running.forwarder import NOTHING_SETTLED, Sender, Settled
from edge.sample import Drop, EdgeSample, observations_of
from sparkplug.actions import HostState
from sparkplug.metric import MetricSpec


class Unstored:
    """The rows of one device, without a store."""

    observations = 0
    is_done = True
    is_behind = False

    def __init__(self, node: Sender, device: str, places: PlaceFile) -> None:
        self._node, self._device, self._places = node, device, places

    def place(self) -> Place | None:
        """Nothing beyond what the place's file has."""
        return None

    def memory(self) -> str | None:
        """Nothing outlives a restart."""
        return None

    def metrics(self) -> Sequence[MetricSpec]:
        """No metrics."""
        return ()

    def declare(self, names: Iterable[str]) -> None:
        """There is no history that would have to be declared."""

    def put(self, rows: Sequence[Sequence[EdgeSample]], place: Place | None, memory: str | None = None) -> Settled:
        """Send the rows, and keep the place after them."""
        emitted, dropped = 0, Counter[Drop]()
        for row in rows:
            if self._node.publish(self._device, [sample.change for sample in row]):
                emitted += observations_of(row)
            else:
                dropped[Drop.BROKER_OFFLINE] += observations_of(row)
        self._places.keep(place)
        return Settled(emitted, dropped)

    def confirmed(self, token: int) -> None:
        """No barrier was set."""

    def receipt(self, text: str) -> None:
        """Nothing waits for a receipt."""

    def host_state(self, host: str, state: HostState | None) -> None:
        """Nothing waits for a historian."""

    def pump(self) -> Settled:
        """Nothing is due."""
        return NOTHING_SETTLED

    def close(self) -> None:
        """Nothing to close."""

    def health(self) -> Mapping[str, int | float | str | bool]:
        """No health."""
        return {}
