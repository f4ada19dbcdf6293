"""A state and what folds samples into it: of one machine, or of all machines of a cell.

A sample whose step fails, or returns what is not declared, changes nothing: a dead letter says what it was.
"""

from collections.abc import Mapping
from types import MappingProxyType
from typing import Any

from processors.actions import Action, DeadLetter, Pin, Publish
from processors.config import Configuration, ProcessorConfig
from processors.contract import Output, Outputs, PlainOutput
from processors.description import Given
from processors.discovery import AnyProcessor
from processors.errors import OutputError
from processors.running.challenger import Challenger
from processors.running.challenger import Row as OwnRow
from processors.running.counts import Counts
from processors.running.dead_letter import dead_letter
from processors.running.emission import Emission, plain_topics
from processors.running.ledger import FOLDED, DropReason, Fates
from processors.sample import Sample
from sparkplug.metric import Reading

Row = Mapping[str, Reading]
Folded = tuple[list[Action], Fates]
"""The actions to be sent, and the fates of the message that brought them and of those that were held back before it."""
DEAD: Fates = (DropReason.DEAD_LETTER,)


class Fold:
    """`name` is the machine's, or the cell's; `cell` holds the rows of the cell's machines that are online.

    version: of the description that the step is given; "" where nobody has described the machine
    """

    __slots__ = (
        "_config",
        "_counts",
        "_initial",
        "_plain",
        "_processor",
        "_quiet",
        "_step",
        "cell",
        "challenger",
        "emissions",
        "is_history",
        "name",
        "rows",
        "state",
        "version",
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
        given: Given | None = None,
    ) -> None:
        """`given`: what a description has made of the configuration; None where the processor heeds none."""
        self.name, self.is_history = name, is_history
        self.state: Any = processor.initial(processor.config_of(configuration, name))
        self._initial = self.state
        self.challenger: Challenger | None = None
        self.emissions: dict[str, Emission] = {}
        self._processor, self._step, self._counts = processor, processor.step, counts
        self._plain = plain_topics(processor.name, processor.plain)
        self.wakes = processor.wakes
        self.version, self._config = Given("", processor.given(configuration, name)) if given is None else given
        self.rows: dict[str, Row] = {}
        self._quiet: Outputs = ()  # the outputs that were news of nothing, and would be of nothing again
        self.cell: Mapping[str, Row] = MappingProxyType(self.rows if processor.is_of_cells else {})

    def join(self, machine: str) -> Emission:
        """A machine is known from now on; what it is told."""
        return self.emissions.setdefault(
            machine, Emission(self._processor.name, self._processor.outputs, is_history=self.is_history)
        )

    def show(self, machine: str, row: Row) -> None:
        """The machine is online: its row is to be seen by the others."""
        self.rows[machine] = row

    def hide(self, machine: str) -> None:
        """The machine is offline."""
        self.rows.pop(machine, None)

    def leave(self, machine: str) -> None:
        """The machine is forgotten."""
        self.hide(machine)
        self.emissions.pop(machine, None)

    def describe(self, given: Given) -> None:
        """Go on with what another description makes of the configuration. The state stays, or is that of the challenger where
        it is the challenger's description."""
        if self.challenger is not None and given.version == self.challenger.version != self.version:
            self.state = self.challenger.state
        self.version, self._config = given
        self._quiet = ()

    def challenge(self, given: Given | None, rows: tuple[OwnRow, OwnRow]) -> bool:
        """Have a challenger with this description, None for none; return True if another one, or none, was there before."""
        if (None if self.challenger is None else self.challenger.version) == (None if given is None else given.version):
            if self.challenger is not None and given is not None:
                self.challenger.describe(given)
            return False
        beside = self._processor.beside
        state = self._initial if beside is None else beside(self.state)
        self.challenger = None if given is None else Challenger(self._processor, given, state, rows, self._counts)
        return True

    def take_both(self, sample: Sample, at_ms: int) -> Folded:
        """Fold a sample, also with the challenger."""
        actions, fates = self.take(sample, at_ms)
        assert self.challenger is not None
        return actions + self.challenger.take(sample, at_ms), fates

    def take(self, sample: Sample, at_ms: int) -> Folded:
        """Fold a sample."""
        try:
            state, outputs = self._step(self._config, self.state, sample)
            actions = [] if not outputs or outputs is self._quiet else self._emitted(outputs, sample.machine, at_ms)
        except Exception as error:  # whatever a step does, the stream goes on with the state before
            self._counts.dead_letters += 1
            letter = DeadLetter(sample.machine or self.name, dead_letter(self._processor.name, sample, error))
            return [letter], DEAD
        self.state = state
        return actions, FOLDED

    def _emitted(self, outputs: Outputs, machine: str, at_ms: int) -> list[Action]:
        """All outputs of a step, or none: what is not declared raises before anything is remembered."""
        for output in outputs:
            if type(output) is not Output or output[4] is not None:
                return self._several_emitted(outputs, machine, at_ms)
        emission = self.emissions.get(machine)
        if emission is None:  # a step of no machine, which names one without saying whose it is
            return self._several_emitted(outputs, machine, at_ms)
        changes = emission.news(outputs, at_ms)  # type: ignore[arg-type]
        if not changes:
            if type(outputs) is tuple and not self._processor.is_of_cells:
                self._quiet = outputs
            return []
        self._quiet = ()
        emission.published(changes)
        return [tuple.__new__(Publish, (machine, tuple(changes)))]

    def _several_emitted(self, outputs: Outputs, machine: str, at_ms: int) -> list[Action]:
        """Outputs of several machines, or beside Sparkplug."""
        if (ready := self._plain.ready(outputs)) is not None:
            return ready
        self._quiet = ()
        by_machine: dict[str, list[Output]] = {}
        beside: list[Action] = []
        for output in outputs:
            if isinstance(output, PlainOutput):
                beside.append(self._plain.message(output))
            elif isinstance(output, Pin):
                beside.append(output)
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
        actions: list[Action] = []
        for whose, emission, changes in news:
            if changes:
                emission.published(changes)
                actions.append(Publish(whose, tuple(changes)))
        return actions + beside if beside else actions
