"""The physics of the machines, as the processors have it: their descriptions, else the configuration that they run with."""

from collections.abc import Callable
from pathlib import Path
from typing import NamedTuple

from processors import cutting_force, thermal
from processors.config import Configuration, read_tables
from processors.description import Description

KEPT_MAX = 1000
"""Machines whose physics is kept from one question to the next."""


class OfMachine(NamedTuple):
    """The physics of a prediction for a machine, and where each part of it is from."""

    thermal: thermal.Described
    force: cutting_force.Described
    thermal_basis: str
    force_basis: str


class Constants:
    """The descriptions; for machines that have none, the tables [thermal] and [cutting_force] of old, else what is assumed."""

    def __init__(self, path: Path | None = None, described: Callable[[str], Description | None] = lambda _: None) -> None:
        """Read and check the file. described: returns the live description of a machine. Raises ConfigurationError."""
        self.path = path
        self._tables = {} if path is None else read_tables(path)
        self._described = described
        self._thermal = Configuration(thermal.Config, self._tables.get("thermal"), name="thermal")
        self._force = Configuration(cutting_force.Config, self._tables.get("cutting_force"), name="cutting_force")
        self._kept: dict[str, tuple[str, OfMachine]] = {}

    def of(self, machine: str) -> OfMachine:
        """The physics of a machine, of whose name nothing need be known."""
        description = self._described(machine)
        version = "" if description is None else description.version
        kept = self._kept.get(machine)
        if kept is not None and kept[0] == version:
            return kept[1]
        heat = thermal.described(self._thermal.of(machine), description)
        force = cutting_force.described(self._force.of(machine), description)
        of = OfMachine(
            heat,
            force,
            heat.words if version else self._basis("thermal", machine, self._thermal.machines),
            force.drive if version else self._basis("cutting_force", machine, self._force.machines),
        )
        if len(self._kept) < KEPT_MAX or machine in self._kept:
            self._kept[machine] = (version, of)
        return of

    def _basis(self, table: str, machine: str, own: tuple[str, ...]) -> str:
        if machine in own:
            return f"[{table}.machines.{machine}] of the configuration"
        if table in self._tables:
            return f"[{table}] of the configuration, for all machines"
        return "defaults: this machine has no description; good for trends only"
