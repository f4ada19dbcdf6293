"""The text of a Klartext program as blocks.

A line is a block, but for a line that ends in `~`, which the next one continues, and for the parameters of a cycle (`Q200=2 ;…`),
which stand on lines of their own below their CYCL DEF. Block numbers, comments (`;`) and structure items (`*`) mean nothing to
the control.
"""

import re
from bisect import bisect_right
from typing import Final, NamedTuple

from twin.programs.refusal import RefusedError

CAPITALS: Final = {code: code - 32 for code in range(ord("a"), ord("z") + 1)}
NUMBER: Final = re.compile(r"[ \t]*+(?:N?+([0-9]++)(?=[ \t]|$)[ \t]*+)?+")
COMMENT: Final = re.compile(r"[^;\"]*+(?:\"[^\"]*+\"?+[^;\"]*+)*+")
CYCLE: Final = re.compile(r"(?:CYCL DEF|TCH PROBE)[ \t]++[0-9]++(?![.0-9])")
PARAMETER_LINE: Final = re.compile(r"Q([0-9]++)[ \t]*+=[ \t]*+(?![^;]*[()*/^]|Q?[-+0-9.,]+[ \t]+[-+])")
LABEL: Final = re.compile(r"LBL[ \t]*+(?:\"([^\"]*+)\"|([0-9]++))[ \t]*+")
CYCLE_PARAMETER_MIN: Final = 200


class Part(NamedTuple):
    """One line of a block: index in the text, what is left without number and comment in capitals, and as written; its number."""

    line: int
    body: str
    written: str
    number: int | None = None


class Source(NamedTuple):
    """One block. `body` in capitals and `written` are the whole of it; `skip`: a `/` stands before it."""

    line: int
    body: str
    written: str
    parts: tuple[Part, ...]
    skip: bool


class Text:
    """A program: its name (None = the main program), its blocks, and which of them its labels are."""

    __slots__ = ("labels", "name", "sources")

    def __init__(self, text: str, name: str | None) -> None:
        self.name = name
        self.sources = blocks(text)
        self.labels: dict[str, int] = {}
        for at, source in enumerate(self.sources):
            if source.body.startswith("LBL"):
                label = label_of(source)
                if label is not None and label != "0":
                    self.labels.setdefault(label, at)

    def find(self, label: str, word: str) -> int:
        """The block of a label; RefusedError where there is none."""
        if label not in self.labels:
            raise RefusedError(word, f"there is no LBL {label} in this program")
        return self.labels[label]

    def number_at(self, line: int) -> int | None:
        """Return the number of the block that a line is in, by which the control names it; None where it has none."""
        at = bisect_right(self.sources, line, key=lambda source: source.line) - 1
        return self.sources[at].parts[0].number if at >= 0 else None


def unit_of(body: str) -> str | None:
    """The last word of BEGIN PGM and END PGM, where it is a unit.

    >>> unit_of("BEGIN PGM 2.5D MILLING INCH"), unit_of("BEGIN PGM A")
    ('INCH', None)
    """
    last = body.rsplit(maxsplit=1)[-1]
    return last if last in ("MM", "INCH") else None


def label_of(source: Source) -> str | None:
    """The label that a block sets: a number without zeros before it, or a name as written."""
    match = LABEL.fullmatch(source.body)
    if match is None:
        return None
    if match.group(2) is not None:
        return match.group(2).lstrip("0") or "0"
    return source.written[match.start(1) : match.end(1)]


def part_of(line: str, at: int) -> tuple[Part, bool, bool]:
    """A line without number and comment; and whether it is indented, and goes on in the next line."""
    capitals = line.translate(CAPITALS)
    number = NUMBER.match(capitals)
    begin = number.end() if number is not None else 0
    own = int(number[1][:9]) if number is not None and number[1] is not None else None
    end_match = COMMENT.match(capitals, begin)
    end = end_match.end() if end_match is not None else len(line)
    goes_on = capitals.rstrip().endswith("~")
    body, written = capitals[begin:end], line[begin:end]
    if body.startswith("*"):
        body = written = ""
    if body.rstrip().endswith("~"):
        cut = body.rstrip()[:-1]
        body, written = cut, written[: len(cut)]
    kept = len(body.rstrip())
    return Part(at, body[:kept], written[:kept], own), line[:1] in (" ", "\t"), goes_on


def blocks(text: str) -> list[Source]:
    """The blocks of a text in order; empty ones are left out."""
    found: list[list[Part]] = []
    goes_on = False
    for at, line in enumerate(text.replace("\r\n", "\n").replace("\r", "\n").split("\n")):
        if not line.strip() or line.strip() == "%":
            goes_on = False
            continue
        part, indented, continues = part_of(line.lstrip("\ufeff"), at)
        if goes_on or (found and part.number is None and belongs(found[-1], part, indented)):
            if part.body:
                found[-1].append(part)
        elif part.body:
            found.append([part])
        else:
            continue
        goes_on = continues
    return [source_of(parts) for parts in found]


def belongs(parts: list[Part], part: Part, indented: bool) -> bool:
    """Return True for a parameter line of the cycle that is being defined."""
    match = PARAMETER_LINE.match(part.body)
    if match is None or CYCLE.match(parts[0].body) is None:
        return False
    return indented or int(match.group(1)[:9]) >= CYCLE_PARAMETER_MIN


def source_of(parts: list[Part]) -> Source:
    body, written = " ".join(part.body for part in parts), " ".join(part.written for part in parts)
    skip = body.startswith("/")
    if skip:
        kept = body[1:].lstrip()
        written, body = written[len(written) - len(kept) :], kept
        first = parts[0]
        rest = first.body[1:].lstrip()
        parts = [Part(first.line, rest, first.written[len(first.written) - len(rest) :], first.number), *parts[1:]]
    return Source(parts[0].line, body, written, tuple(parts), skip)
