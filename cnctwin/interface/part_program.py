"""A part program as it is given: a Path is a file, a str is the text itself."""

from pathlib import Path
from typing import NamedTuple

from cnctwin.errors import UsageError
from cnctwin.files.program_text import read_encoded


class PartProgram(NamedTuple):
    """The text of a program, how messages call it, and the encoding in which it goes back to the control."""

    text: str
    name: str
    encoding: str = "utf-8"


def part_program(given: str | Path) -> PartProgram:
    """The program that is given.

    A str is never taken for the name of a file, so that no text is a file by accident. Raises UsageError where it looks like one,
    or where the file cannot be read.

    >>> part_program("G0 X10\\nM30\\n").name
    'program'
    """
    if isinstance(given, Path):
        text, encoding = read_encoded(given)
        return PartProgram(text, given.name, encoding)
    line = given.strip()
    if "\n" not in line and len(line) < 1000 and Path(line).suffix[1:].isalpha():
        raise UsageError(f"program {line!r}: is the text of a program in one line; for a file, give pathlib.Path({line!r})")
    return PartProgram(given, "program")
