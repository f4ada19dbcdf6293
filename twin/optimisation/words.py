"""F and S words in the text of a block: found, replaced, added. Nothing else of the line changes, not even its spaces.

Figures are written so that a limit that was kept stays kept: a feed is rounded down to a ten-thousandth of itself, a speed to 1
rev/min.
"""

import math
import re
from collections.abc import Mapping
from typing import NamedTuple

from twin.gcode.text import CAPITALS
from twin.gcode.tokens import TOKEN

INCH_MM = 25.4
DIGITS = 4
WORDS = re.compile(r"[A-Za-z]\s*[-+.0-9#\[]")
FLOW = frozenset({"IF", "GOTO", "WHILE", "DO", "END", "THEN"})
LABEL = re.compile(r"[ \t]*[NO:][ \t]*[0-9]")
BLOCK_SKIP = re.compile(r"[ \t]*(?:[O:][ \t]*[0-9]+[ \t]*)?(?:N[ \t]*[0-9]+[ \t]*)?/")
LINE_END = re.compile(r"\r\n|\r|\n")


class WordPlace(NamedTuple):
    """The place of a word in the text of a block: begin, end; plain: its value is a number, no expression."""

    begin: int
    end: int
    plain: bool


def find_word(text: str, letter: str) -> WordPlace | None:
    """The last word with that letter in a block, outside comments; None where there is none.

    >>> find_word("N10 G1 X4. F400 (F1)", "F")
    WordPlace(begin=11, end=15, plain=True)
    >>> find_word("G1 X4. F#1", "F").plain
    False
    """
    found, depth = None, 0
    for match in TOKEN.finditer(text.translate(CAPITALS)):
        index = match.lastindex
        if index == 5 and match.group(5) in "[]":
            depth += 1 if match.group(5) == "[" else -1
        if index == 2 and match.group(1) == letter:
            found = WordPlace(match.start(1), match.end(2), True)
        elif index == 4 and match.group(4) == letter and depth == 0:
            found = WordPlace(match.start(4), match.end(4), False)
    return found


def with_word(text: str, letter: str, figure: str) -> str:
    """The block with this word: in place of the one that is there, else behind the last word.

    >>> with_word("N10 G1 X4. F400 (finish)", "F", "500"), with_word("N10 G1 X4. (finish) ", "F", "500")
    ('N10 G1 X4. F500 (finish)', 'N10 G1 X4. F500 (finish) ')
    >>> with_word("g1x5f40", "S", "4584")
    'g1x5f40S4584'
    """
    place = find_word(text, letter)
    if place is not None:
        written = text[place.begin]
        return text[: place.begin] + written + figure + text[place.end :]
    end = last_word_end(text)
    dense = len(WORDS.findall(text[:end])) > 1 and " " not in text[:end].strip()
    gap = "" if dense or not end else " "
    return text[:end] + gap + letter + figure + text[end:]


def last_word_end(text: str) -> int:
    """Return the end of the last word of a block: before comments and spaces behind it."""
    end = 0
    for match in TOKEN.finditer(text.translate(CAPITALS)):
        if match.lastindex is not None and match.lastindex < 6:
            end = match.end()
    return end


def source_lines(text: str) -> list[str]:
    """The lines of a program without their ends, counted as the interpreter counts.

    >>> source_lines("G0\\r\\nG1\\n")
    ['G0', 'G1', '']
    """
    return LINE_END.split(text)


def joined(text: str, changed: Mapping[int, str]) -> str:
    """The program with some lines (from 0) replaced, every end of a line as it was.

    >>> joined("G0\\r\\nG1\\n", {1: "G1 F5"})
    'G0\\r\\nG1 F5\\n'
    """
    ends = [*LINE_END.findall(text), ""]
    return "".join(changed.get(k, line) + end for k, (line, end) in enumerate(zip(source_lines(text), ends, strict=True)))


def branches(lines: list[str]) -> list[bool]:
    """Return True for each line that the control may come to, or go on from, another way than from line to line.

    Block skips, jumps and the N words that they may aim at, loops, calls, and the O words of what is called.

    >>> branches(["G1 X3.", "/N20 G1 X4.", "X5. (IF IT FITS)"]), branches(["N1 G1 X3.", "GOTO 1"]), branches(["N1 G1 X3."])
    ([False, True, False], [True, True], [False])
    """
    found, jumps, calls = [], False, False
    for line in lines:
        upper = line.translate(CAPITALS)
        keyword = any(match.lastindex == 4 and match.group(4) in FLOW for match in TOKEN.finditer(upper))
        jumps = jumps or (keyword and "GOTO" in upper)
        of_line = codes(line)
        called = bool(of_line.m & {98, 99, 198} or of_line.g & {650, 660, 670})
        calls = calls or called
        found.append(bool(BLOCK_SKIP.match(upper)) or keyword or called)
    aims = [bool(LABEL.match(line.translate(CAPITALS))) and (calls if line.lstrip()[:1] in "Oo:" else jumps) for line in lines]
    return [one or aim for one, aim in zip(found, aims, strict=True)]


class Codes(NamedTuple):
    """The codes of a block: G in tenths (G54.1 is 541), and M."""

    g: frozenset[int]
    m: frozenset[int]


def codes(text: str) -> Codes:
    """The G and M codes of a block that stand there as plain words, outside comments.

    >>> codes("G1 X3. M8 (NOT G20)")
    Codes(g=frozenset({10}), m=frozenset({8}))
    """
    found: dict[str, set[int]] = {"G": set(), "M": set()}
    for match in TOKEN.finditer(text.translate(CAPITALS)):
        if match.lastindex == 2 and match.group(1) in found:
            value = float(match.group(2).replace(" ", "").replace("\t", ""))
            found[match.group(1)].add(round(10.0 * value) if match.group(1) == "G" else round(value))
    return Codes(frozenset(found["G"]), frozenset(found["M"]))


def inch_lines(lines: list[str], inch: bool = False) -> list[bool]:
    """Return True for each line with G20 in it, or in the last line before it that has G20 or G21; `inch`: at the start.

    >>> inch_lines(["G1 F3", "G20", "G1 F3 (G21)", "G21 G1 F3"])
    [False, True, True, False]
    """
    found = []
    for line in lines:
        of_line = codes(line).g if "2" in line else frozenset()
        inch = 200 in of_line or (inch and 210 not in of_line)
        found.append(inch)
    return found


def feed_figure(feed_mm_min: float, inch: bool) -> str:
    """A feed, rounded down.

    >>> feed_figure(500.0, False), feed_figure(437.26, False), feed_figure(1270.0, True), feed_figure(83.333, False)
    ('500', '437.2', '50.', '83.33')
    """
    value = feed_mm_min / INCH_MM if inch else feed_mm_min
    value *= 1.0 + 1e-12
    places = max(0, DIGITS - 1 - math.floor(math.log10(value)))
    text = f"{math.floor(value * 10**places) / 10**places:.{places}f}"
    text = text.rstrip("0").rstrip(".") if "." in text else text
    return text + "." if inch and "." not in text else text


def figure_mm_min(figure: str, inch: bool) -> float:
    """The feed that a control reads.

    >>> figure_mm_min("50.", True)
    1270.0
    """
    return float(figure) * (INCH_MM if inch else 1.0)
