"""F and S words in the text of a block: found, replaced, added. Nothing else of the line changes, not even its spaces.

Figures are written so that a limit that was kept stays kept: a feed is rounded down to a ten-thousandth of itself, a speed to 1
rev/min.
"""

import math
import re
from typing import NamedTuple

from twin.programs.fanuc.text import CAPITALS
from twin.programs.fanuc.tokens import TOKEN
from twin.programs.source import WordPlace

INCH_MM = 25.4
DIGITS = 4
WORDS = re.compile(r"[A-Za-z]\s*[-+.0-9#\[]")
FLOW = frozenset({"IF", "GOTO", "WHILE", "DO", "END", "THEN"})
LABEL = re.compile(r"[ \t]*[NO:][ \t]*[0-9]")
BLOCK_SKIP = re.compile(r"[ \t]*(?:[O:][ \t]*[0-9]+[ \t]*)?(?:N[ \t]*[0-9]+[ \t]*)?/")
BLOCK_NUMBER = re.compile(r"^\s*/?\d?\s*N\s*0*(\d+)", re.I)
S_IS_NO_SPEED_G = frozenset({100, 500, 650, 660, 670, 920, 960})
S_IS_NO_SPEED_M = frozenset({19, 29, 98, 198})
"""Codes in whose block S is something else: an argument, a clamp, a surface speed, an angle, the speed of a tap."""
STARTS = frozenset({3, 4})
NO_FEED = frozenset({0, 100, 280, 300, 520, 530, 650, 920, 921})
"""Codes whose axis words are no feed, in tenths."""
PROBING = frozenset({310, 311, 312, 313, 314, 370, 380, 382, 383, 384, 385})
"""G31 and its kin, G37, G38.2 to G38.5, in tenths."""


def find_word(text: str, letter: str) -> WordPlace | None:
    """The last word with that letter in a block, outside comments; None where there is none.

    >>> find_word("N10 G1 X4. F400 (F1)", "F")
    WordPlace(begin=11, figure=12, end=15, plain=True)
    >>> find_word("G1 X4. F#1", "F").plain
    False
    """
    found, depth = None, 0
    for match in TOKEN.finditer(text.translate(CAPITALS)):
        index = match.lastindex
        if index == 5 and match.group(5) in "[]":
            depth += 1 if match.group(5) == "[" else -1
        if index == 2 and match.group(1) == letter:
            found = WordPlace(match.start(1), match.start(1) + 1, match.end(2), True)
        elif index == 4 and match.group(4) == letter and depth == 0:
            found = WordPlace(match.start(4), match.start(4) + 1, match.end(4), False)
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
        return place.replaced(text, figure)
    end = last_word_end(text)
    dense = len(WORDS.findall(text[:end])) > 1 and " " not in text[:end].strip()
    gap = "" if dense or not end else " "
    return text[:end] + gap + letter + figure + text[end:]


def feed_place(line: str) -> WordPlace | None:
    """Return the place of F."""
    return find_word(line, "F")


def speed_place(line: str) -> WordPlace | None:
    """Return the place of S."""
    return find_word(line, "S")


def with_feed(line: str, figure: str) -> str:
    """Return the block with this F."""
    return with_word(line, "F", figure)


def with_speed(line: str, figure: str) -> str:
    """Return the block with this S."""
    return with_word(line, "S", figure)


def last_word_end(text: str) -> int:
    """Return the end of the last word of a block: before comments and spaces behind it."""
    end = 0
    for match in TOKEN.finditer(text.translate(CAPITALS)):
        if match.lastindex is not None and match.lastindex < 6:
            end = match.end()
    return end


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


def exact_feed_figure(feed_mm_min: float, inch: bool) -> str:
    """A feed to the sixth place.

    >>> exact_feed_figure(1270.0, True), exact_feed_figure(83.3333333, False), exact_feed_figure(500.0, False)
    ('50.', '83.333333', '500')
    """
    text = f"{feed_mm_min / INCH_MM if inch else feed_mm_min:.6f}".rstrip("0")
    return text if inch else text.rstrip(".")


def takes_feed(line: str) -> bool:
    """Return True for a block with a place to go to, unless its codes say that it goes there another way.

    >>> takes_feed("X5."), takes_feed("G0 X5."), takes_feed("S500")
    (True, False, False)
    """
    return any(find_word(line, letter) is not None for letter in "XYZ") and not codes(line).g & NO_FEED


def probes(line: str) -> bool:
    """Return True for G31 and its kin."""
    return bool(codes(line).g & PROBING)


def commands_speed(line: str) -> bool:
    """Return True where S is a speed of the spindle."""
    of_block = codes(line)
    return not of_block.g & S_IS_NO_SPEED_G and not of_block.m & S_IS_NO_SPEED_M


def starts_spindle(line: str) -> bool:
    """Return True for M3 and M4."""
    return bool(STARTS & codes(line).m)


def block_number(line: str) -> int | None:
    """Return the N word at the beginning of a block.

    >>> block_number("/N0010 G1 X3."), block_number("G1 N5")
    (10, None)
    """
    found = BLOCK_NUMBER.match(line)
    return None if found is None else int(found[1])
