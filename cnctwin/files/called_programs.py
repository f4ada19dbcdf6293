"""The programs beside a program, for the calls in it: read when one is called."""

from collections.abc import Iterator, Mapping
from functools import cached_property
from pathlib import Path

from cnctwin.files.program_text import read_text
from twin.vocabulary.program_names import ENDINGS


class CalledPrograms(Mapping[str, str]):
    """The texts of the folder that a program is in, by name without ending in small letters; its own is none of them."""

    def __init__(self, program: Path) -> None:
        """program: the file of the program that calls."""
        self._program = program

    @cached_property
    def _files(self) -> dict[str, Path]:
        folder = self._program.absolute().parent
        beside = sorted(folder.iterdir(), reverse=True) if folder.is_dir() else []
        programs = (path for path in beside if path.suffix.casefold() in ENDINGS and path.is_file())
        return {path.stem.casefold(): path for path in programs if path.name != self._program.name}

    def __getitem__(self, name: str) -> str:
        """Return the text of that name. Raises KeyError where there is none, UsageError where it cannot be read."""
        return read_text(self._files[name])

    def __iter__(self) -> Iterator[str]:
        return iter(self._files)

    def __len__(self) -> int:
        return len(self._files)
