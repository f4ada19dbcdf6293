"""The processors' loop and the historian's recorder as they are, but that the plant hears what they do."""

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any, ClassVar

from cnctwin.memory.historian import StoreRecorder
from edge.running.receipts import spans_of
from processors.running.ports import Receipt
from processors.running.runner import Runner

if TYPE_CHECKING:
    from tests.plant.simulation.plant import Plant


class ObservedRunner(Runner):
    """Makes itself known to the plant."""

    plant: ClassVar["Plant"]

    def __init__(self, host: Any, workers: Sequence[Any]) -> None:
        super().__init__(host, workers)
        self.plant.runners[self.plant.kernel.me().process.name] = self


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
