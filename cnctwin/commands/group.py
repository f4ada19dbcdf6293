"""A group of commands, as `cnctwin --help` shows it: a folder of `cnctwin/commands/`, which declares it in its `__init__.py`."""

from collections.abc import Mapping
from importlib import import_module
from typing import Any, NamedTuple


class CommandGroup(NamedTuple):
    """The commands of one folder: what people use them for, and for each name where it is and its line in the help.

    A command stands in `<folder>/<module>.py` or below it; its place is `module:name`. No command is loaded by declaring it.
    """

    folder: str
    title: str
    commands: Mapping[str, tuple[str, str]]

    def loaded(self, name: str) -> Any:
        """Return the function, or the application with subcommands, of a command."""
        module, _, attribute = self.commands[name][0].partition(":")
        return getattr(import_module(f"{self.folder}.{module}"), attribute)
