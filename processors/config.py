"""Configuration of a processor: one typed model, with other values for single machines.

A file holds a table for each processor, so that one file can serve several:

    [cutting_force]
    rated_power_kw = 11.0

    [cutting_force.machines.okuma]
    tool_diameter_mm = 10.0
"""

import tomllib
from collections.abc import Callable, Collection, Mapping
from pathlib import Path
from typing import Any, ClassVar, Generic, Self, TypeVar

from pydantic import BaseModel, ConfigDict, Field, ValidationError, model_validator

from processors.errors import ConfigurationError
from sparkplug.shown_address import shown_address
from twin.vocabulary.faults import faults_of, report

MACHINES = "machines"
TICKS_MAX = 100_000  # that one jump of event time may bring


class ProcessorConfig(BaseModel):
    """The settings that the engine needs of every processor. Durations are event time."""

    model_config = ConfigDict(extra="forbid", frozen=True, allow_inf_nan=False)
    of_one_machine: ClassVar[frozenset[str] | None] = None
    """The keys that a machine may have a value of its own for; None = all."""
    unshown: ClassVar[frozenset[str]] = frozenset()
    """The keys below which a secret may stand: no error shows their values."""
    of_the_machine: ClassVar[Mapping[str, str]] = {}
    """Keys of old tables that describe the machine → the section of its file (docs/reference/machine.md) where they belong."""

    tick_s: float = Field(default=1.0, ge=0.001, le=3600.0, description="a tick at each multiple of this")
    gap_s_max: float = Field(default=600.0, gt=0.0, le=86_400.0, description="a longer jump forwards is a hole")
    late_s_max: float = Field(default=5.0, ge=0.0, le=3600.0, description="a longer jump backwards is another clock")

    @model_validator(mode="after")
    def _ticks_are_bounded(self) -> Self:
        if self.gap_s_max / self.tick_s > TICKS_MAX:
            raise ValueError(f"gap_s_max / tick_s is more than {TICKS_MAX}: make tick_s longer or gap_s_max shorter")
        return self

    def belongs_elsewhere(self, table: str, machine: str = "", keys: Collection[str] | None = None) -> tuple[str, ...]:
        """Return a sentence on each value of this table that describes the machine and not how the processor runs.

        machine: whose table it is, "" = that of all; keys: those that stand in it, None = all that were given

        >>> ProcessorConfig().belongs_elsewhere("thermal")
        ()
        """
        stand = self.model_fields_set if keys is None else keys
        return tuple(
            f"[{table}] {key} belongs in machines/{machine or '<name>'}.toml, {section}; "
            f"it is used until {machine or 'a machine'} has a file"
            for key, section in self.of_the_machine.items()
            if key in stand
        )


ALL = "all"


class CellConfig(ProcessorConfig):
    """The settings that the engine needs of a processor that compares machines.

    cells: the machines of each cell by name; those that stand in none are together in the cell "all"
    """

    cells: dict[str, tuple[str, ...]] = Field(default_factory=dict, max_length=1000)

    @model_validator(mode="after")
    def _a_machine_has_one_cell(self) -> Self:
        named = [machine for machines in self.cells.values() for machine in machines]
        if twice := sorted({machine for machine in named if named.count(machine) > 1}):
            raise ValueError(f"cells has {', '.join(twice)} twice; a machine is in one cell")
        return self

    def cell_of(self, machine: str) -> str:
        """The cell that a machine is in."""
        return next((cell for cell, machines in self.cells.items() if machine in machines), ALL)


C_co = TypeVar("C_co", bound=ProcessorConfig, covariant=True)


class Configuration(Generic[C_co]):
    """The configuration of one processor: the values for all machines, and for those that have their own.

    read: by machine, what the processor has made of the files that the values name (its models): read once, here
    """

    def __init__(
        self,
        model: type[C_co],
        table: Mapping[str, Any] | None = None,
        *,
        name: str = "",
        reads: "Callable[[Configuration[C_co]], Mapping[str, Any]] | None" = None,
    ) -> None:
        """Check `table` at once, every machine of it, and read what it names. Raises ConfigurationError with a line for each
        fault, which names table, key and value."""
        shared = dict(table or {})
        machines = shared.pop(MACHINES, {})
        if not isinstance(machines, dict) or not all(isinstance(own, dict) for own in machines.values()):
            raise ConfigurationError(f"[{name}.{MACHINES}] has to hold one table for each machine")
        faults: list[str] = []
        default = _validated(model, shared, name, faults)
        of_machine = {}
        for machine, own in machines.items():
            where = f"{name}.{MACHINES}.{machine}"
            faults += _common_keys(model, own, where)
            # a fault of the common values is not repeated for each machine
            of_machine[machine] = _validated(model, {**shared, **own}, where, faults, None if default is not None else own)
        if default is None or faults:
            raise ConfigurationError("\n".join(faults))
        self._name = name
        self._own_keys = {machine: frozenset(own) for machine, own in machines.items()}
        self.default: C_co = default
        self._of_machine: dict[str, C_co] = {machine: one for machine, one in of_machine.items() if one is not None}
        try:
            self.read: Mapping[str, Any] = {} if reads is None else reads(self)
        except ValueError as error:
            raise ConfigurationError(f"[{name}] {error}") from error

    def of(self, machine: str) -> C_co:
        """The values that hold for `machine`."""
        return self._of_machine.get(machine, self.default)

    def belongs_elsewhere(self) -> tuple[str, ...]:
        """Return a sentence on each value, of all machines and of single ones, that describes a machine."""
        lines = list(self.default.belongs_elsewhere(self._name))
        for machine, own in self._of_machine.items():
            lines += own.belongs_elsewhere(f"{self._name}.{MACHINES}.{machine}", machine, self._own_keys[machine])
        return tuple(lines)

    @property
    def machines(self) -> tuple[str, ...]:
        """The machines that have values of their own."""
        return tuple(self._of_machine)


def _common_keys(model: type[ProcessorConfig], own: Mapping[str, Any], where: str) -> list[str]:
    """Return a line for each value of one machine that holds for all of them, and would not be heeded."""
    allowed = model.of_one_machine
    if allowed is None:
        return []
    return [
        f"[{where}] {key} = {value!r} holds for all machines; one of them may have its own {', '.join(sorted(allowed))}"
        for key, value in own.items()
        if key in model.model_fields and key not in allowed
    ]


def _validated(
    model: type[C_co], table: Mapping[str, Any], where: str, faults: list[str], keys: Collection[str] | None = None
) -> C_co | None:
    """Return the table as its model, or None with its faults added to `faults`; keys: those whose faults count, None = all."""
    try:
        return model.model_validate(table)
    except ValidationError as error:
        faults += table_faults(model, error, where, keys)
        return None


def table_faults(model: Any, error: ValidationError, where: str, keys: Collection[str] | None = None) -> list[str]:
    """Return a line for each fault of a table, without the secrets that addresses in it may have."""
    found = [fault for fault in error.errors(include_url=False) if keys is None or (fault["loc"] and fault["loc"][0] in keys)]
    unshown: frozenset[str] = getattr(model, "unshown", frozenset())
    faults = [
        {key: value for key, value in fault.items() if key != "input" or not unshown.intersection(map(str, fault["loc"][:1]))}
        for fault in found
    ]
    return faults_of(faults, model, f"[{where}] ", lambda value: shown_address(repr(value)))


def read_tables(path: Path) -> dict[str, dict[str, Any]]:
    """The tables of a configuration file by processor. Raises ConfigurationError where it is no TOML of tables."""
    try:
        document = tomllib.loads(path.read_text(encoding="utf-8"))
    except OSError as error:
        raise ConfigurationError(f"{path}: {error.strerror or error}; give a readable TOML file") from error
    except (tomllib.TOMLDecodeError, UnicodeDecodeError) as error:
        raise ConfigurationError(f"{path}: {error}") from error
    if loose := [name for name, table in document.items() if not isinstance(table, dict)]:
        raise ConfigurationError(
            report(path, [f"{name} is in no table; put it below its processor, as [thermal]" for name in loose])
        )
    return document
