"""The programs beside a program, for the calls in it: read when one is called."""

from collections.abc import Collection, Iterator, Mapping
from dataclasses import replace
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING

from cnctwin.files.program_text import read_text
from twin.programs.discovery import dialect_of, told_by_ending
from twin.programs.settings import Settings
from twin.vocabulary.program_names import ENDINGS

if TYPE_CHECKING:
    from twin.machine import MachineFile


class CalledPrograms(Mapping[str, str]):
    """The texts of the folder that a program is in, by name without ending in small letters; its own is none of them."""

    def __init__(self, program: Path, endings: Collection[str] = ENDINGS) -> None:
        """program: the file of the program that calls; endings: of those that it can call."""
        self._program, self._endings = program, endings

    @cached_property
    def _files(self) -> dict[str, Path]:
        folder = self._program.absolute().parent
        beside = sorted(folder.iterdir(), reverse=True) if folder.is_dir() else []
        programs = (path for path in beside if path.suffix.casefold() in self._endings and path.is_file())
        return {path.stem.casefold(): path for path in programs if path.name != self._program.name}

    def __getitem__(self, name: str) -> str:
        """Return the text of that name. Raises KeyError where there is none, UsageError where it cannot be read."""
        return read_text(self._files[name])

    def __iter__(self) -> Iterator[str]:
        return iter(self._files)

    def __len__(self) -> int:
        return len(self._files)


def with_called_programs(settings: Settings, program: Path, text: str) -> Settings:
    """Return the settings with the language of a program and those of the same language beside it. Raises PartProgramError."""
    settings = replace(settings, dialect=told_by_ending(text, program.suffix, settings.dialect))
    return replace(settings, programs=CalledPrograms(program, dialect_of(text, settings).suffixes))


def speaking(machine: "MachineFile", program: Path, text: str) -> "MachineFile":
    """Return the machine with the language of a program, where its [control] names none and the program's ending does."""
    dialect = told_by_ending(text, program.suffix, machine.control.dialect)
    return machine.model_copy(update={"control": machine.control.model_copy(update={"dialect": dialect})})
