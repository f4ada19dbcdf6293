"""The NC files of a plant in a folder, found by the name that a control gives a program."""

import re
from collections.abc import Iterator
from functools import cached_property
from pathlib import Path

from cnctwin.errors import UsageError
from cnctwin.files.program_text import read_text
from twin.vocabulary.program_names import ENDINGS

SUFFIXES = ("", *ENDINGS)
HEAD_CHARACTERS = 2000
"""A program names itself within so many."""
_WORD = re.compile(r"^[%\s]*([O:]\s*0*\d+|BEGIN PGM \S+)", re.IGNORECASE | re.MULTILINE)


class ProgramFolder:
    """The NC files of a plant, found by the name that the control gives a program."""

    def __init__(self, folder: Path | None) -> None:
        """Raises UsageError where it is no folder."""
        if folder is not None and not folder.is_dir():
            raise UsageError(f"{folder}: there is no such folder with NC files")
        self._folder = folder

    @cached_property
    def _files(self) -> dict[str, Path]:
        files = {} if self._folder is None else {p.name.casefold(): p for p in sorted(self._folder.iterdir()) if p.is_file()}
        by_word: dict[str, Path] = {}
        for path in files.values():
            if path.suffix.casefold() in SUFFIXES:
                by_word |= dict.fromkeys(_words(read_text(path)[:HEAD_CHARACTERS]), path)
        return by_word | files

    def programs(self) -> dict[str, Path]:
        """Return every program that has the ending of one, by the names under which a control may tell it."""
        return {name: path for name, path in self._files.items() if path.suffix.casefold() in SUFFIXES}

    def path_of(self, program: str) -> Path | None:
        """Return the file of a program; None where the folder has none of that name."""
        return next((self._files[name] for name in _names(program) if name in self._files), None)

    def text_of(self, program: str) -> str | None:
        """Return the text of a program; None where the folder has none of that name."""
        path = self.path_of(program)
        return None if path is None else read_text(path)


def _names(program: str) -> Iterator[str]:
    """Yield the file names, in small letters, under which a program may be kept."""
    name = re.split(r"[/\\]", program.strip())[-1].casefold()
    stem = name.rpartition(".")[0] or name
    for one in dict.fromkeys((name, stem)):
        yield from (f"{one}{suffix}" for suffix in SUFFIXES)
        if match := re.fullmatch(r"[o:]?0*(\d+)", one):
            yield from (f"o{match[1]}{suffix}" for suffix in SUFFIXES)


def _words(text: str) -> Iterator[str]:
    """Yield the name that a program gives itself: `o1701` of O1701, as `_names` writes it."""
    if match := _WORD.search(text):
        digits = re.sub(r"\D", "", match[1]).lstrip("0") if not match[1].upper().startswith("BEGIN") else ""
        yield f"o{digits}" if digits else match[1].split()[-1].casefold()
