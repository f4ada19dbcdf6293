"""The processors' loop and engines, the historian's recorder and the edge's forwarder as they are, and the plant hears of it."""

from collections.abc import Callable, Sequence
from typing import TYPE_CHECKING, Any, ClassVar

from cnctwin.memory.historian import StoreRecorder
from edge.running.forwarder import Forwarder
from edge.running.receipts import spans_of
from edge.sample import EdgeSample, observations_of
from processors.actions import Action
from processors.running.engine import Engine, Way
from processors.running.picks import Stream
from processors.running.ports import Receipt
from processors.running.runner import Runner
from sparkplug.host_session import EventKind, HostEvent
from sparkplug.metric import NodeId

if TYPE_CHECKING:
    from tests.plant.simulation.plant import Plant


class ObservedRunner(Runner):
    """Makes itself known to the plant."""

    plant: ClassVar["Plant"]

    def __init__(self, host: Any, workers: Sequence[Any], folder: Any = None) -> None:
        super().__init__(host, workers, folder)
        self.plant.runners[self.plant.kernel.me().process.name] = self

    def _stream(self, event: HostEvent, now_s: float) -> None:
        ObservedEngine.event = event
        super()._stream(event, now_s)


class ObservedEngine(Engine):
    """Remembers all that it was given, so that another engine can be given the same."""

    event: ClassVar[HostEvent]  # that goes the shortest way at the moment
    remembers: ClassVar[bool] = False

    def __init__(self, processor: Any, configuration: Any, **options: Any) -> None:
        super().__init__(processor, configuration, **options)
        self._made_of = processor, configuration
        self._is_first = not options
        self._given: list[Callable[[Engine], Any]] = []

    def _note(self, what: Callable[[Engine], Any]) -> None:
        if self.remembers:
            self._given.append(what)

    def feed(self, event: HostEvent, wall_s: float) -> list[Action]:
        self._note(lambda engine: engine.feed(_plainly(event), wall_s))
        return super().feed(event, wall_s)

    def way_of(self, node: NodeId, device: str) -> Way | None:
        shortest = super().way_of(node, device)
        if shortest is None:
            return None

        def way(message: Stream, wall_s: float) -> list[Action]:
            event = ObservedEngine.event
            self._note(lambda engine: engine.feed(_plainly(event), wall_s))
            return shortest(message, wall_s)

        return way

    def describe(self, machine: str, role: Any, description: Any) -> list[Action]:
        self._note(lambda engine: engine.describe(machine, role, description))
        return super().describe(machine, role, description)

    def plain(self, topic: str, payload: bytes, at_ms: int) -> list[Action]:
        self._note(lambda engine: engine.plain(topic, payload, at_ms))
        return super().plain(topic, payload, at_ms)

    def beat(self, at_ms: int) -> list[Action]:
        self._note(lambda engine: engine.beat(at_ms))
        return super().beat(at_ms)

    def silence(self, wall_s: float) -> list[Action]:
        self._note(lambda engine: engine.silence(wall_s))
        return super().silence(wall_s)

    def restore(self, payload: bytes) -> str:
        self._note(lambda engine: engine.restore(payload))
        return super().restore(payload)

    def bury_unborn(self, at_ms: int) -> list[Action]:
        self._note(lambda engine: engine.bury_unborn(at_ms))
        return super().bury_unborn(at_ms)

    def differing(self) -> list[str]:
        """Return the units whose state is not that of a fresh engine which is given the same, without the short ways."""
        if not self.remembers or not self._is_first:
            return []
        fresh = Engine(*self._made_of)
        for given in self._given:
            given(fresh)
        return [unit for unit in self.units if self.snapshot(unit) != fresh.snapshot(unit)]


def _plainly(event: HostEvent) -> HostEvent:
    """Return an event that goes the long way: by the names of its readings."""
    return event._replace(names=()) if event.kind is EventKind.DATA else event


class ObservedRecorder(StoreRecorder):
    """Tells the plant which rows it has said to be kept."""

    plant: ClassVar["Plant"]

    def receipts(self) -> list[Receipt]:
        """Return the receipts, as the recorder gives them."""
        found = super().receipts()
        for receipt in found:
            rows = self.plant.receipted.setdefault(receipt.device, set())
            for first, last in spans_of(receipt.value):
                rows.update(range(first, last + 1))
        return found


class ObservedForwarder(Forwarder):
    """Tells the plant what it has sent without a store, since its disk took nothing: nobody confirms that."""

    plant: ClassVar["Plant"]

    def _send_unstored(self, row: Sequence[EdgeSample]) -> None:
        self.plant.unstored[self._device] += observations_of(row)
        super()._send_unstored(row)
