"""The constants of the machines, from the very configuration that the processors run with."""

from pathlib import Path
from typing import NamedTuple

from processors.config import Configuration, read_tables
from processors.cutting_force import Config as ForceConfig
from processors.thermal import Config as ThermalConfig


class OfMachine(NamedTuple):
    """The constants of a prediction for a machine, and where each table is from."""

    thermal: ThermalConfig
    force: ForceConfig
    thermal_basis: str
    force_basis: str


class Constants:
    """The tables [thermal] and [cutting_force] of a configuration; without one, the defaults."""

    def __init__(self, path: Path | None = None) -> None:
        """Read and check the file. Raises ConfigurationError."""
        self.path = path
        self._tables = {} if path is None else read_tables(path)
        self._thermal = Configuration(ThermalConfig, self._tables.get("thermal"), name="thermal")
        self._force = Configuration(ForceConfig, self._tables.get("cutting_force"), name="cutting_force")

    def of(self, machine: str) -> OfMachine:
        """The constants of a machine, of whose name nothing need be known."""
        return OfMachine(
            self._thermal.of(machine),
            self._force.of(machine),
            self._basis("thermal", machine, self._thermal.machines),
            self._basis("cutting_force", machine, self._force.machines),
        )

    def _basis(self, table: str, machine: str, own: tuple[str, ...]) -> str:
        if machine in own:
            return f"[{table}.machines.{machine}] of the configuration"
        if table in self._tables:
            return f"[{table}] of the configuration, for all machines"
        return "defaults: nobody has configured this machine; good for trends only"
