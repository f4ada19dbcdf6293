"""A dialect: one language of part programs, as its folder `twin/programs/<name>/` declares it in `dialect.py`.

`interpret` turns a text into canonical moves; `words` reads and writes feed and speed in the text of one line, for the optimiser.
"""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Final, Protocol

from twin.programs.canonical import Move
from twin.programs.settings import Settings
from twin.programs.source import WordPlace

RECOGNISED_CHARACTERS_MAX: Final = 20_000
"""A language is told from the beginning of a text, up to here."""


class SourceWords(Protocol):
    """The words of a line in this language that the optimiser needs. A module of functions with these names is one.

    A line comes without its end. Comments hold no words. Nothing here raises for a line that cannot be read: the interpreter,
    which runs first, names it.
    """

    def feed_place(self, line: str) -> WordPlace | None:
        """Return the place of the word that programs the feed, the last one where there are several; None without one."""

    def speed_place(self, line: str) -> WordPlace | None:
        """Return the place of the word that programs the speed of the spindle; None without one."""

    def with_feed(self, line: str, figure: str) -> str:
        """Return the line with this feed: in place of the one that is there, else as a new word where the language has it."""

    def with_speed(self, line: str, figure: str) -> str:
        """Return the line with this speed, in the same way."""

    def feed_figure(self, feed_mm_min: float, inch: bool) -> str:
        """Return a feed as this language writes it, rounded down so that a limit that was kept stays kept."""

    def figure_mm_min(self, figure: str, inch: bool) -> float:
        """Return the feed that the control reads from this figure."""

    def exact_feed_figure(self, feed_mm_min: float, inch: bool) -> str:
        """Return a feed as this language writes it, to the sixth place."""

    def inch_lines(self, lines: list[str], inch: bool) -> list[bool]:
        """Return True for each line whose feed counts inches; `inch`: at the start."""

    def branches(self, lines: list[str]) -> list[bool]:
        """Return True for each line that the control may come to, or go on from, another way than from line to line.

        Block skips, jumps and what they aim at, loops, calls, and the beginnings of what is called.
        """

    def takes_feed(self, line: str) -> bool:
        """Return True where the line would move by the feed in force, if it has none of its own."""

    def probes(self, line: str) -> bool:
        """Return True for a probing move, or one that ends at a signal: its feed has a reason of its own."""

    def commands_speed(self, line: str) -> bool:
        """Return True where the speed word of the line is a speed of the spindle: no argument, clamp, angle or surface speed."""

    def starts_spindle(self, line: str) -> bool:
        """Return True where the line itself sets the spindle turning."""

    def block_number(self, line: str) -> int | None:
        """Return the number that the program gives the line (N10), by which a control may name it; None without one."""


@dataclass(frozen=True, slots=True)
class Dialect:
    """One language of part programs.

    name: of its folder, and of `dialect` in [control] of machine.toml; title: for people; control: makers and controls
    suffixes: of its files, in small letters with their dot, the usual one first
    recognises: from 0 (nothing in the text is of this language) to 1 (it can be no other); of several languages the surest is
        taken. Gets at most `RECOGNISED_CHARACTERS_MAX` characters from the beginning of a text
    interpret: raises PartProgramError (line, word, reason) where the control would refuse a block, or it is not read
    speed_per_tool: the speed stands in the block that calls the tool, and in no other: the optimiser chooses one for each tool
    blocks_are_numbered: the control numbers every block of a text, and names it by that number rather than by its line
    m_codes: M codes that have a meaning of their own in this language, which a machine builder's cannot take
    end, start: the words that end a program and that start the spindle, as a sentence names them
    """

    name: str
    title: str
    control: str
    suffixes: tuple[str, ...]
    recognises: Callable[[str], float]
    interpret: Callable[[str, Settings], list[Move]]
    words: SourceWords
    m_codes: frozenset[int]
    end: str = "M30"
    start: str = "S and M3 or M4"
    speed_per_tool: bool = False
    blocks_are_numbered: bool = False
