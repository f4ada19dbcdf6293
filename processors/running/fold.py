"""A state and what folds samples into it: of one machine, or of all machines of a cell.

A sample whose step fails, or returns what is not declared, changes nothing: a dead letter says what it was.
"""

from collections.abc import Mapping
from types import MappingProxyType
from typing import Any

from processors.config import Configuration, ProcessorConfig
from processors.contract import CellProcessor, Output, Outputs, PlainOutput
from processors.discovery import AnyProcessor
from processors.effects import DeadLetter, Effect, Pin, Publish
from processors.errors import OutputError
from processors.running.counts import Counts
from processors.running.dead_letter import dead_letter
from processors.running.emission import Emission, plain_message
from processors.sample import Sample
from sparkplug.metric import Reading

Row = Mapping[str, Reading]


class Fold:
    """`name` is the machine's, or the cell's; `cell` holds the rows of the cell's machines that are online."""

    __slots__ = (
        "_config",
        "_counts",
        "_processor",
        "_rows",
        "_step",
        "cell",
        "emissions",
        "is_history",
        "name",
        "state",
        "wakes",
    )

    def __init__(
        self,
        processor: AnyProcessor,
        configuration: Configuration[ProcessorConfig],
        name: str,
        counts: Counts,
        *,
        is_history: bool,
    ) -> None:
        is_cell = isinstance(processor, CellProcessor)
        config = configuration.default if is_cell else configuration.of(name)
        self.name, self.is_history = name, is_history
        self.state: Any = processor.initial(config)
        self.emissions: dict[str, Emission] = {}
        self._processor, self._step, self._counts = processor, processor.step, counts
        self.wakes = processor.wakes if isinstance(processor, CellProcessor) else None
        self._config: Any = configuration if is_cell else config
        self._rows: dict[str, Row] = {}
        self.cell: Mapping[str, Row] = MappingProxyType(self._rows if is_cell else {})

    def join(self, machine: str) -> Emission:
        """A machine is known from now on; what it is told."""
        return self.emissions.setdefault(machine, Emission(self._processor, is_history=self.is_history))

    def show(self, machine: str, row: Row) -> None:
        """The machine is online: its row is to be seen by the others."""
        self._rows[machine] = row

    def hide(self, machine: str) -> None:
        """The machine is offline."""
        self._rows.pop(machine, None)

    def leave(self, machine: str) -> None:
        """The machine is forgotten."""
        self.hide(machine)
        self.emissions.pop(machine, None)

    def take(self, sample: Sample, at_ms: int, effects: list[Effect]) -> bool:
        """Fold a sample; whether its step came to an end."""
        try:
            state, outputs = self._step(self._config, self.state, sample)
            if outputs:
                self._emit(outputs, sample.machine, at_ms, effects)
        except Exception as error:  # whatever a step does, the stream goes on with the state before
            self._counts.dead_letters += 1
            effects.append(DeadLetter(sample.machine or self.name, dead_letter(self._processor.name, sample, error)))
            return False
        self.state = state
        return True

    def _emit(self, outputs: Outputs, machine: str, at_ms: int, effects: list[Effect]) -> None:
        """All outputs of a step, or none: what is not declared raises before anything is remembered."""
        by_machine: dict[str, list[Output]] = {}
        beside: list[Effect] = []
        for output in outputs:
            if isinstance(output, Pin):
                beside.append(output)
            elif isinstance(output, PlainOutput):
                beside.append(plain_message(self._processor.name, self._processor.plain, output))
            elif (own := by_machine.get(whose := output.machine or machine)) is None:
                by_machine[whose] = [output]
            else:
                own.append(output)
        news = []
        for whose, own in by_machine.items():
            emission = self.emissions.get(whose)
            if emission is None:
                raise OutputError(f"{self._processor.name} emits {own[0].name!r} of {whose!r}, no machine of {self.name!r}")
            news.append((whose, emission, emission.news(own, at_ms)))
        for whose, emission, changes in news:
            if changes:
                emission.published(changes)
                effects.append(Publish(whose, tuple(changes)))
        effects += beside
