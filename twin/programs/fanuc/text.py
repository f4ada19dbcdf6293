"""A program text: lines, the programs (O numbers) in it, and where its sequence numbers and loops are.

Everything that a jump needs is found once and then looked up, so that a program of many jumps costs no more than it should.
"""

import re
from bisect import bisect_right
from typing import Final, NamedTuple

from twin.programs.fanuc.block import Block
from twin.programs.refusal import RefusedError

LABEL: Final = re.compile(r"[ \t]*+(?:/[ \t]*+[0-9]?+[ \t]*+)?+(?:[O:][ \t]*+([0-9]++)[ \t]*+)?+(?:N[ \t]*+([0-9]++))?+")
LOOP: Final = re.compile(r"\([^)]*+\)?+|;.*+|(?<![A-Z])(DO|END)[ \t]*+([1-3])(?![0-9.])")
CAPITALS: Final = {code: code - 32 for code in range(ord("a"), ord("z") + 1)}
LOOP_DEPTH_MAX = 3


class Section(NamedTuple):
    """One program of a text: its O number (None = it has none) and its lines, `start` up to before `stop`."""

    number: int | None
    start: int
    stop: int


class Loop(NamedTuple):
    """Lines of a DO and of its END."""

    begin: int
    end: int


class Text:
    """A text as it came (`written`) and in capitals (`lines`). `blocks` holds what has been compiled so far, by line."""

    __slots__ = ("blocks", "lines", "loops", "name", "programs", "sections", "sequences", "written")

    def __init__(self, text: str, name: str | None) -> None:
        self.name = name
        unified = text.replace("\r\n", "\n").replace("\r", "\n")
        self.written = unified.split("\n")
        self.lines = unified.translate(CAPITALS).split("\n")
        self.blocks: dict[int, Block | None] = {}
        self.sections = sections(self.lines)
        self.programs = {section.number: section for section in reversed(self.sections) if section.number is not None}
        self.sequences: dict[int, dict[int, list[int]]] = {}
        self.loops: dict[int, dict[int, Loop]] = {}

    def section(self, number: int) -> Section | None:
        """The program with that O number."""
        return self.programs.get(number)

    def line_of(self, sequence: int, section: Section, after: int) -> int | None:
        """The line of N`sequence`: forward from line `after`, then from the top, as a control searches."""
        index = self.sequences.get(section.start)
        if index is None:
            index = {}
            for at in range(section.start, section.stop):
                match = LABEL.match(self.lines[at])
                if match is not None and match.group(2) is not None and len(match.group(2)) <= 9:
                    index.setdefault(int(match.group(2)), []).append(at)
            self.sequences[section.start] = index
        found = index.get(sequence)
        if not found:
            return None
        return found[bisect_right(found, after) % len(found)]

    def loop_at(self, line: int, section: Section) -> Loop:
        """The loop whose DO or END stands on that line."""
        loops = self.loops.get(section.start)
        if loops is None:
            loops = self.loops[section.start] = pairs(self.lines, section)
        if line not in loops:
            raise RefusedError("", "DO and END of a loop have to stand one each in blocks of their own, without crossing")
        return loops[line]


def sections(lines: list[str]) -> list[Section]:
    """The programs of a text. What stands before `%` on the first line, and behind the next one, belongs to none."""
    begin, stop = 0, len(lines)
    filled = next((at for at, line in enumerate(lines) if line.strip()), stop)
    if filled < stop and lines[filled].lstrip().startswith("%"):
        begin = filled + 1
    stop = next((at for at in range(begin, stop) if lines[at].lstrip().startswith("%")), stop)
    found: list[Section] = []
    number, start, empty = None, begin, True
    for at in range(begin, stop):
        line = lines[at].lstrip()
        match = LABEL.match(line) if line[:1] in ("O", ":", "/") else None
        if match is not None and match.group(1) is not None:
            if not empty:
                found.append(Section(number, start, at))
            number, start, empty = int(match.group(1)[:9]), at, False
        elif line and not line.startswith(("(", ";")):
            empty = False
    found.append(Section(number, start, stop))
    return found


def pairs(lines: list[str], section: Section) -> dict[int, Loop]:
    """Every loop of a program by the lines of its DO and its END; those that do not pair up are left out."""
    found: dict[int, Loop] = {}
    open_loops: list[tuple[int, str]] = []
    for at in range(section.start, section.stop):
        line = lines[at]
        if "DO" not in line and "END" not in line:
            continue
        for match in LOOP.finditer(line):
            word, number = match.groups()
            if word == "DO":
                open_loops.append((at, number))
            elif word == "END" and open_loops:
                begin, opened = open_loops.pop()
                if opened == number and len(open_loops) < LOOP_DEPTH_MAX:
                    found[begin] = found[at] = Loop(begin, at)
    return found
