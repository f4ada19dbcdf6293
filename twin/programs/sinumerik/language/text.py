"""A program text: its lines, the programs in it (`%_N_NAME_MPF`), its labels, and where its structures begin and end.

What a jump needs is found once and then looked up, so that a program of many jumps costs no more than it should.
"""

import re
from typing import Final, NamedTuple

from twin.programs.refusal import RefusedError
from twin.programs.sinumerik.language.syntax import Block
from twin.programs.sinumerik.language.tokens import CAPITALS

HEADER: Final = re.compile(r"[ \t]*+%[ \t]*+([A-Z0-9_]++)?+")
HEAD: Final = re.compile(
    r"[ \t]*+(?:/[0-9]?+[ \t]*+)?+(?:[N:][ \t]*+([0-9]++)[ \t]*+)?+(?:([A-Z_][A-Z_][A-Z0-9_]*+)[ \t]*+:(?!=)[ \t]*+)?+([A-Z]++)?+"
)
OPENING: Final = {"IF": "ENDIF", "LOOP": "ENDLOOP", "FOR": "ENDFOR", "WHILE": "ENDWHILE", "REPEAT": "UNTIL"}
CLOSING: Final = frozenset(OPENING.values())
COMMENT: Final = re.compile(r'"[^"]*+"?+|;.*+')
DEPTH_MAX: Final = 100
SUFFIX: Final = re.compile(r"\.(MPF|SPF|CYC|NC|TXT)$|_(MPF|SPF|CYC)$")


class Section(NamedTuple):
    """One program of a text: its name ("" = it has no header) and its lines, `start` up to before `stop`."""

    name: str
    start: int
    stop: int


class Span(NamedTuple):
    """Lines of the first and last word of a structure, and of its ELSE, if it has one."""

    begin: int
    end: int
    middle: int | None


def program_name(written: str) -> str:
    """The name by which a program is called: in capitals, without folder and suffix.

    >>> program_name("/_N_SPF_DIR/_N_Part1_SPF"), program_name("Part1.spf")
    ('PART1', 'PART1')
    """
    last = written.replace("\\", "/").rpartition("/")[2].upper()
    return SUFFIX.sub("", last).removeprefix("_N_")


class Text:
    """A text as it came (`written`) and in capitals (`lines`). `blocks` holds what has been compiled so far, by line."""

    __slots__ = ("blocks", "labels", "lines", "main", "name", "programs", "sections", "spans", "written")

    def __init__(self, text: str, name: str | None) -> None:
        self.name = name
        unified = text.replace("\r\n", "\n").replace("\r", "\n")
        self.written = unified.split("\n")
        self.lines = unified.translate(CAPITALS).split("\n")
        self.blocks: dict[int, Block] = {}
        self.sections = sections(self.lines)
        self.main = next((one for one in self.sections if one.start and is_main(self.lines[one.start - 1])), self.sections[0])
        self.programs = {section.name: section for section in reversed(self.sections) if section.name}
        self.labels: dict[int, dict[str, list[int]]] = {}
        self.spans: dict[int, dict[int, Span]] = {}

    def places(self, section: Section, label: str) -> list[int]:
        """The lines of a label, or of a block number as N10; from the top."""
        index = self.labels.get(section.start)
        if index is None:
            index = self.labels[section.start] = {}
            for at in range(section.start, section.stop):
                found = HEAD.match(self.lines[at])
                if found is not None and found[1] is not None and len(found[1]) <= 9:
                    index.setdefault(f"N{int(found[1])}", []).append(at)
                if found is not None and found[2] is not None:
                    index.setdefault(found[2], []).append(at)
        return index.get(label, [])

    def span(self, section: Section, line: int) -> Span:
        """The structure that has a word on that line."""
        spans = self.spans.get(section.start)
        if spans is None:
            spans = self.spans[section.start] = structures(self.lines, section)
        if line not in spans:
            found = HEAD.match(self.lines[line])
            word = found[3] or "" if found is not None else ""
            raise RefusedError(
                word, "this structure is not whole: IF ENDIF, LOOP ENDLOOP, FOR ENDFOR, WHILE ENDWHILE, REPEAT UNTIL"
            )
        return spans[line]


def is_main(header: str) -> bool:
    """Return True for the header of a main program, `%_N_NAME_MPF`."""
    return header.lstrip().startswith("%") and header.rstrip().endswith("_MPF")


def sections(lines: list[str]) -> list[Section]:
    """The programs of a text, each behind its line with %; what stands before the first one belongs to it if it is empty."""
    found: list[Section] = []
    name, start, used = "", 0, False
    for at, line in enumerate(lines):
        stripped = line.lstrip()
        if stripped.startswith("%"):
            header = HEADER.match(line)
            if used:
                found.append(Section(name, start, at))
            name, start, used = program_name(header[1] or "") if header is not None else "", at + 1, False
        elif stripped and not stripped.startswith(";"):
            used = True
    found.append(Section(name, start, len(lines)))
    return found


def structures(lines: list[str], section: Section) -> dict[int, Span]:
    """Every structure by the lines of its words; those that do not pair up are left out."""
    found: dict[int, Span] = {}
    opened: list[tuple[int, str, int | None]] = []
    for at in range(section.start, section.stop):
        head = HEAD.match(lines[at])
        word = head[3] if head is not None else None
        if word is None or (word not in OPENING and word not in CLOSING and word != "ELSE"):
            continue
        rest = COMMENT.sub(" ", lines[at][head.end() :]) if head is not None else ""
        if (word == "IF" and "GOTO" in rest) or (word == "REPEAT" and rest.strip()):
            continue
        if word in OPENING:
            opened.append((at, OPENING[word], None))
        elif word == "ELSE" and opened and opened[-1][1] == "ENDIF":
            opened[-1] = (opened[-1][0], "ENDIF", at)
        elif opened and opened[-1][1] == word:
            begin, _, middle = opened.pop()
            span = Span(begin, at, middle)
            if len(opened) < DEPTH_MAX:
                found.update({line: span for line in (begin, at, middle) if line is not None})
    return found
