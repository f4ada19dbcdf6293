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

MACHINES = "machines"
TICKS_MAX = 100_000  # that one jump of event time may bring


class ProcessorConfig(BaseModel):
    """The settings that the engine needs of every processor. Durations are event time."""

    model_config = ConfigDict(extra="forbid", frozen=True, allow_inf_nan=False)
    of_one_machine: ClassVar[frozenset[str] | None] = None
    """The keys that a machine may have a value of its own for; None = all."""
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
        """Check `table` at once, every machine of it, and read what it names. Raises ConfigurationError naming key, value and
        model."""
        shared = dict(table or {})
        machines = shared.pop(MACHINES, {})
        if not isinstance(machines, dict) or not all(isinstance(own, dict) for own in machines.values()):
            raise ConfigurationError(f"[{name}.{MACHINES}] has to hold one table for each machine")
        for machine, own in machines.items():
            _check_own(model, own, f"{name}.{MACHINES}.{machine}")
        self._name = name
        self._own_keys = {machine: frozenset(own) for machine, own in machines.items()}
        self.default: C_co = _validated(model, shared, name)
        self._of_machine: dict[str, C_co] = {
            machine: _validated(model, {**shared, **own}, f"{name}.{MACHINES}.{machine}") for machine, own in machines.items()
        }
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


def _check_own(model: type[ProcessorConfig], own: Mapping[str, Any], where: str) -> None:
    """Refuse a value for one machine that holds for all of them, and would not be heeded."""
    allowed = model.of_one_machine
    if allowed is not None and (common := [key for key in own if key in model.model_fields and key not in allowed]):
        raise ConfigurationError(
            f"[{where}] {common[0]} = {own[common[0]]!r} holds for all machines; one of them may have its own "
            + ", ".join(sorted(allowed))
        )


def _validated(model: type[C_co], table: Mapping[str, Any], where: str) -> C_co:
    try:
        return model.model_validate(table)
    except ValidationError as error:
        first = error.errors()[0]
        key = ".".join(str(part) for part in first["loc"])
        known = ", ".join(model.model_fields)
        said = first["msg"].removeprefix("Value error, ")
        raise ConfigurationError(
            f"[{where}] {key} = {shown_address(repr(first['input']))}: {said} (known: {known})" if key else f"[{where}] {said}"
        ) from error


def read_tables(path: Path) -> dict[str, dict[str, Any]]:
    """The tables of a configuration file by processor. Raises ConfigurationError where it is no TOML of tables."""
    try:
        document = tomllib.loads(path.read_text(encoding="utf-8"))
    except OSError as error:
        raise ConfigurationError(f"{path}: {error.strerror or error}; give a readable TOML file") from error
    except (tomllib.TOMLDecodeError, UnicodeDecodeError) as error:
        raise ConfigurationError(f"{path}: {error}") from error
    for name, table in document.items():
        if not isinstance(table, dict):
            raise ConfigurationError(f"{path}: {name} = {table!r} stands outside a table; put it under [<processor>]")
    return document
