"""A machine as its machine.toml describes it (docs/reference/machine.md)."""

from pathlib import Path

from cnctwin.batch.simulation import machine_to_simulate
from cnctwin.interface.errors import one_tree
from twin.machine import MachineFile


def read_machine(path: str | Path) -> MachineFile:
    """Read a machine.toml, or the twin.toml of a diagnosis, its effects checked. Raises MachineError."""
    with one_tree():
        return machine_to_simulate(Path(path))


def machine_of(given: MachineFile | str | Path) -> MachineFile:
    """Return the machine that is given, or that of the file that is named."""
    return given if isinstance(given, MachineFile) else read_machine(given)
