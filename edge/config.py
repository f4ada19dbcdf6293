"""The configuration of one edge: one machine, one control, one broker (TOML, one file a machine).

Checked before any I/O. Secrets do not stand in the file: it names the environment variable that holds them.
"""

import re
from dataclasses import dataclass, field
from pathlib import Path
from typing import Annotated, Any, Generic, Literal, Self, TypeVar

from pydantic import AfterValidator, BaseModel, Field, ValidationError, model_validator

from edge.accelerometer.section import AccelerometerSection
from edge.chosen import Chosen, PlcSection, VariableSection, chosen_of
from edge.errors import ConfigError
from edge.section import Section
from edge.signals import signal
from edge.units import conversion
from sparkplug.shown_address import shown_address
from twin.vocabulary.faults import faults_of
from twin.vocabulary.nodes import edge_node
from twin.vocabulary.signals import DERIVED, Kind

BROKERS_MAX = 10
_BY_ADDRESS = ("variables", "plc")
_ENTRY = 'write name = { address = "…", unit = "…" }; docs/how-to/edges.md says how an address is written'
BLOCK_PATTERN = r'(?<![A-Z_])M0*6(?![\d.])|\bTOOL CALL (?:\d|"|QS?\d)'


def _pattern(text: str) -> str:
    try:
        re.compile(text)
    except re.error as error:
        raise ValueError(f"is no regular expression: {error}") from error
    return text


class MachineSection(Section):
    """`name` is the Sparkplug device. After `lost_after_s` without the control the device is declared dead."""

    name: str = Field(default="machine", pattern=r"^[^/+#]+$")
    adapter: str = "mtconnect"
    lost_after_s: float = Field(default=30.0, gt=0)


class BrokerSection(Section):
    """The broker to publish to, or several in `urls`, of which the edge is on one at a time.

    Empty `node` means `edge-<machine>`; `session_file` keeps bdSeq and, beside it, the place in the control's stream; empty, the
    program keeps them in its state folder.
    """

    url: str = "mqtt://127.0.0.1:1883"
    urls: tuple[str, ...] = Field(default=(), max_length=BROKERS_MAX)
    group: str = "cnc"
    node: str = ""
    session_file: str = ""
    primary_host: str = ""
    username: str = ""
    password_env: str = ""
    password_file: str = ""

    @model_validator(mode="after")
    def _names_its_brokers_once(self) -> Self:
        if self.urls and "url" in self.model_fields_set:
            raise ValueError("has url and urls; put all brokers into urls")
        if len(set(self.urls)) < len(self.urls):
            raise ValueError("urls names a broker twice; name each once")
        return self


class SignalSection(Section):
    """The source of one canonical signal. `native_unit` is what the values really are, whatever the control declares."""

    data_item: str = ""
    native_unit: str = ""
    scale: float = Field(default=1.0, allow_inf_nan=False)
    deadband: float = Field(default=0.0, ge=0, allow_inf_nan=False)
    low: float | None = None
    high: float | None = None
    publish: bool = True


class ReportSection(Section):
    """Report by exception: an unchanged value is sent again after `interval_s_max` (0 = never)."""

    interval_s_max: float = Field(default=0.0, ge=0)


class StoreSection(Section):
    """Store and forward: what no broker has confirmed is kept on the disk. Empty `file`: beside the session file.

    `await_receipt`: kept until a memory (the processor `historian`) says that it has it, too; "auto": as soon as one has been
    heard of on the broker, and from then on.

    What is too old or too much goes, oldest first, and is counted; less than `free_bytes_min` is never left on the disk.
    `synchronous = "full"` also outlives a power cut, at the price of an fsync for each frame.
    """

    enabled: bool = True
    file: str = ""
    age_s_max: float = Field(default=86_400.0, gt=0, allow_inf_nan=False)
    bytes_max: int = Field(default=1_000_000_000, ge=1_000_000)
    free_bytes_min: int = Field(default=500_000_000, ge=0)
    synchronous: Literal["normal", "full"] = "normal"
    await_receipt: Literal["auto"] | bool = "auto"
    history_rows_per_s: float = Field(default=1_000.0, ge=1, le=100_000)  # how fast what was stored follows what is live


class ToolChangeSection(Section):
    """The state machine of `edge.tool_change`."""

    debounce_s: float = Field(default=2.0, ge=0, le=60)  # how long a number must stand before the change is over
    blank_s: float = Field(default=1.0, ge=0, le=60)  # how long it must be empty to be a change without other evidence
    change_s_max: float = Field(default=60.0, gt=0)  # after this a change that shows no end is given up
    block_pattern: Annotated[str, AfterValidator(_pattern)] = BLOCK_PATTERN
    zero_is_no_tool: bool = True


SourceT = TypeVar("SourceT", bound=BaseModel)


@dataclass(frozen=True, slots=True)
class EdgeConfig(Generic[SourceT]):
    """One edge. `source` is the table that the adapter reads; `path` is for messages only."""

    source: SourceT
    machine: MachineSection = field(default_factory=MachineSection)
    broker: BrokerSection = field(default_factory=BrokerSection)
    signals: dict[str, SignalSection] = field(default_factory=dict)
    report: ReportSection = field(default_factory=ReportSection)
    tool_change: ToolChangeSection = field(default_factory=ToolChangeSection)
    store: StoreSection = field(default_factory=StoreSection)
    accelerometer: AccelerometerSection = field(default_factory=AccelerometerSection)
    variables: dict[str, VariableSection] = field(default_factory=dict)
    plc: dict[str, PlcSection] = field(default_factory=dict)
    path: Path = Path("edge.toml")

    def __post_init__(self) -> None:
        for name, section in self.signals.items():
            try:
                self._check(name, section)
            except ConfigError as error:
                raise ConfigError(f"{self.path}: [signals.{name}]: {error}") from error

    def _check(self, name: str, section: SignalSection) -> None:
        known = signal(name)
        if name in DERIVED:
            raise ConfigError("is derived by the edge and cannot be mapped; remove the table")
        if section.native_unit:
            conversion(section.native_unit, known.unit)
        if known.kind is not Kind.NUMBER and (section.deadband or section.scale != 1.0):
            raise ConfigError("scale and deadband need a number; remove them")

    @property
    def chosen(self) -> tuple[Chosen, ...]:
        """Return what is read by its address on the control."""
        return chosen_of(self.variables, self.plc)

    @property
    def node(self) -> str:
        """The id of the edge node."""
        return self.broker.node or edge_node(self.machine.name)


def faults_in(table: str, kind: Any, error: ValidationError) -> list[str]:
    """Return the complaints of pydantic about a table as lines with key, value and what is wrong; no address shows a secret."""
    faults = [dict(fault) for fault in error.errors(include_url=False)]
    lines = faults_of(faults, kind, f"{table}.", _without_secret)
    if table not in _BY_ADDRESS:
        return lines
    return [f"{line}; {_ENTRY}" if line.endswith(("is missing", "must be a table")) else line for line in lines]


def _without_secret(value: object) -> str:
    is_address = any(mark in str(value) for mark in ("//", "?", "@"))  # of a broker or control; "#500" is a variable's
    return shown_address(repr(value)) if is_address else repr(value)
