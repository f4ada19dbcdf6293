"""A processor: a pure fold over the samples of a machine, with everything it reads and emits declared.

    step(config, state, sample) -> (state, outputs)

A file `processors/<name>.py` that ends in `PROCESSOR = Processor(...)` is found by discovery and put through the contract
suite: same stream, same answer; a restart in the middle changes nothing; nothing crashes it; it emits only what it declares.
Where machines are compared with each other, a `CellProcessor` folds the samples of all machines of a cell into one state.
"""

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, is_dataclass
from enum import Enum
from typing import Any, ClassVar, Generic, NamedTuple, TypeVar

from processors.actions import Pin, PlainOutput
from processors.config import ALL, CellConfig, Configuration, ProcessorConfig
from processors.description import Description
from processors.errors import DeclarationError
from processors.sample import Sample, SampleKind
from sparkplug.datatype import DataType
from sparkplug.metric import MetricSpec
from sparkplug.quality import Quality
from sparkplug.topics import NAMESPACE
from sparkplug.values import Value
from twin.vocabulary.nodes import JOBS_NODE, is_twin_node, twin_node
from twin.vocabulary.twin_signals import TWIN_PREFIX

__all__ = [
    "CellConfig",
    "CellProcessor",
    "NoState",
    "Output",
    "OutputSpec",
    "Pin",
    "PlainOutput",
    "PlainSpec",
    "Processor",
    "Provenance",
    "Sample",
    "SampleKind",
]


class Provenance(Enum):
    """The origin of a figure."""

    MEASURED = "measured"
    MODELLED = "modelled"
    INFERRED = "inferred"


@dataclass(frozen=True, slots=True)
class OutputSpec:
    """One metric that a processor emits.

    deadband: a number that moved by less than this since it was last published is not published again
    is_alarm: not emitted for history samples: nobody is woken up for yesterday
    of_challenger: published for a challenger too, as `twin/challenger/…` (processors/description.py)
    """

    name: str
    datatype: DataType
    unit: str | None
    meaning: str
    provenance: Provenance
    deadband: float = 0.0
    is_alarm: bool = False
    of_challenger: bool = False

    def __post_init__(self) -> None:
        if not self.name.startswith(TWIN_PREFIX):
            raise DeclarationError(f"output {self.name!r} has to start with {TWIN_PREFIX!r}")
        if self.datatype not in PYTHON_TYPES:
            raise DeclarationError(f"output {self.name!r} is a {self.datatype.name}; use a number, BOOLEAN or a text")

    def metric(self) -> MetricSpec:
        """The birth certificate's entry: unit, meaning and provenance travel as properties."""
        properties = {"meaning": self.meaning, "provenance": self.provenance.value}
        return MetricSpec(self.name, self.datatype, unit=self.unit, properties=properties)


_WHOLE = (
    DataType.INT8, DataType.INT16, DataType.INT32, DataType.INT64,
    DataType.UINT8, DataType.UINT16, DataType.UINT32, DataType.UINT64,
)  # fmt: skip
PYTHON_TYPES: dict[DataType, tuple[type, ...]] = {
    **dict.fromkeys(_WHOLE, (int,)),
    DataType.FLOAT: (float, int),
    DataType.DOUBLE: (float, int),
    DataType.BOOLEAN: (bool,),
    DataType.STRING: (str,),
    DataType.TEXT: (str,),
}


@dataclass(frozen=True, slots=True)
class PlainSpec:
    """Plain messages, outside Sparkplug, whose topic starts with `prefix` (which ends in a slash)."""

    prefix: str
    meaning: str
    qos: int = 0

    def __post_init__(self) -> None:
        if not self.prefix.endswith("/") or self.prefix.startswith((f"{NAMESPACE}/", "$")) or set("+#") & set(self.prefix):
            raise DeclarationError(f"plain prefix {self.prefix!r}: has to end in '/', outside {NAMESPACE}/ and $, no wildcard")


class Output(NamedTuple):
    """A value for a declared metric. `value` None is a null and needs a reason.

    machine, at_s: whose, and as of which event time; None = those of the sample
    """

    name: str
    value: Value
    quality: Quality = Quality.GOOD
    reason: str | None = None
    machine: str | None = None
    at_s: float | None = None

    @classmethod
    def null(cls, name: str, reason: str, machine: str | None = None, at_s: float | None = None) -> "Output":
        """A null that says why. Keep live figures out of `reason`: a changed reason is published again."""
        return cls(name, None, Quality.BAD, reason, machine, at_s)

    @classmethod
    def nulls(cls, names: Iterable[str], reason: str) -> "tuple[Output, ...]":
        """Return nulls of all these names for one reason: what a step answers while an input is missing."""
        return tuple(cls.null(name, reason) for name in names)


@dataclass(frozen=True, slots=True)
class NoState:
    """The state of a processor that needs none."""


C = TypeVar("C", bound=ProcessorConfig)
D = TypeVar("D", bound=CellConfig)
S = TypeVar("S")
Outputs = Sequence[Output | PlainOutput | Pin]


@dataclass(frozen=True, slots=True, kw_only=True)
class _Declaration(Generic[C, S]):
    """The part of a declaration that both kinds of processor share.

    version: of the state's form; a snapshot of another version is not restored
    inputs: names of the metrics that are read; None = all, those of other processors too
    alarms: looks up the declared alarms that are read beside `inputs` (processors/alarms.py), once all processors can be imported
    state: a frozen dataclass of JSON-able fields; `initial` makes the first one
    reads: makes what the step needs of the files that a configuration names, by machine; raises ValueError where it cannot.
        The step is given the whole configuration then, with what was read
    records: whether the runtime hands all that it hears to a recorder, as it comes, before the fold sees it
    described: makes what the step is given out of what it would be given otherwise and the machine's description, None where
        nobody has described it. It is called once for each description, and the state goes on
    beside: makes the state that a challenger starts from out of the live one; None = it starts from `initial`
    """

    name: str
    version: int
    inputs: frozenset[str] | None
    outputs: tuple[OutputSpec, ...]
    config: type[C]
    state: type[S]
    initial: Callable[[C], S]
    plain: tuple[PlainSpec, ...] = ()
    reads: Callable[[Configuration[C]], Mapping[str, Any]] | None = None
    alarms: Callable[[], tuple[str, ...]] | None = None
    records: bool = False
    described: Callable[[Any, Description | None], Any] | None = None
    beside: Callable[[S], S] | None = None

    def __post_init__(self) -> None:
        if not is_dataclass(self.state) or not self.state.__dataclass_params__.frozen:  # type: ignore[attr-defined]
            raise DeclarationError(f"processor {self.name!r}: state {self.state.__name__} has to be a frozen dataclass")
        names = [spec.name for spec in self.outputs]
        if len(set(names)) < len(names):
            raise DeclarationError(f"processor {self.name!r}: an output is declared twice: {names}")

    @property
    def node(self) -> str:
        """The id of its edge node and of its host application."""
        return twin_node(self.name)

    @property
    def signals(self) -> frozenset[str] | None:
        """The names of all metrics that are read, `inputs` and `alarms`; None = all."""
        return self.inputs if self.inputs is None or self.alarms is None else self.inputs.union(self.alarms())

    def configured(self, table: Mapping[str, Any] | None = None) -> Configuration[C]:
        """The configuration out of a table, checked, with what it names on the disk. Raises ConfigurationError."""
        return Configuration(self.config, table, name=self.name, reads=self.reads)

    def listens_to(self, node: str) -> bool:
        """Return True if it reads the node `node`: never itself or jobs, other processors only where an input is theirs."""
        if not is_twin_node(node):
            return True
        if node == JOBS_NODE:
            return False
        reads_twins = self.inputs is None or self.alarms is not None or any(name.startswith(TWIN_PREFIX) for name in self.inputs)
        return reads_twins and node != self.node


@dataclass(frozen=True, slots=True, kw_only=True)
class Processor(_Declaration[C, S]):
    """A fold over what one machine says: a state for each machine, which is its own unit.

    step: takes the values that hold for the machine; with `reads`, the whole configuration; with `described`, what that makes
    wakes: signals whose change is folded as it comes; all others are seen at the next tick. None = every change is
    """

    step: Callable[[Any, S, Sample], tuple[S, Outputs]]
    wakes: frozenset[str] | None = None
    listens: ClassVar[tuple[str, ...]] = ()
    beats: ClassVar[bool] = False

    @property
    def is_of_cells(self) -> bool:
        """True if machines share a state."""
        return False

    def unit_of(self, configuration: Configuration[C], machine: str) -> str:
        """The unit that a machine is in: what has a state."""
        return machine

    def units_at_start(self, configuration: Configuration[C]) -> tuple[str, ...]:
        """The units that there are before any machine is born."""
        return ()

    def config_of(self, configuration: Configuration[C], machine: str) -> C:
        """The values that hold for the stream of a machine, or the first state of a unit."""
        return configuration.of(machine)

    def given(self, configuration: Configuration[C], unit: str, description: Description | None = None) -> Any:
        """Return what the step of a unit is given: the configuration, and what `described` makes of it."""
        given = configuration.of(unit) if self.reads is None else configuration
        return given if self.described is None else self.described(given, description)


@dataclass(frozen=True, slots=True, kw_only=True)
class CellProcessor(_Declaration[D, S]):
    """A fold over what the machines of a cell say: a state for each cell, and the configuration of each machine at hand.

    The samples of its machines come as they are received, each in the event time of its own control; `sample.cell` holds the rows
    of all that are online.

    listens: filters of plain topics whose messages come as samples of kind PLAIN, to every cell
    wakes: signals whose change is folded as it comes; all others are seen at the next tick. None = every change is
    beats: whether a sample of kind BEAT comes once a second, by the clock on the wall
    """

    step: Callable[[Configuration[D], S, Sample], tuple[S, Outputs]]
    listens: tuple[str, ...] = ()
    wakes: frozenset[str] | None = None
    beats: bool = False

    @property
    def is_of_cells(self) -> bool:
        """True if machines share a state."""
        return True

    def unit_of(self, configuration: Configuration[D], machine: str) -> str:
        """The cell that a machine is in."""
        return configuration.default.cell_of(machine)

    def units_at_start(self, configuration: Configuration[D]) -> tuple[str, ...]:
        """All cells, where the processor works without any machine."""
        return (*configuration.default.cells, ALL) if self.beats or self.listens else ()

    def config_of(self, configuration: Configuration[D], machine: str) -> D:
        """The values that hold for all: the machines of a cell share ticks and times."""
        return configuration.default

    def given(self, configuration: Configuration[D], unit: str, description: Description | None = None) -> Any:
        """Return what the step of a cell is given: the whole configuration, that of each machine at hand."""
        del unit, description
        return configuration
