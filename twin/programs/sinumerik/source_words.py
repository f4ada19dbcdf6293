"""F and S words in the text of a block: found, replaced, added. Nothing else of the line changes, not even its spaces.

A feed is rounded down to a ten-thousandth of itself, so that a limit that was kept stays kept. Feeds and speeds among the
arguments of a cycle are no words of the block.
"""

import math
import re
from collections.abc import Iterator
from typing import Final, NamedTuple

from twin.programs.sinumerik.codes import GROUPS
from twin.programs.sinumerik.language.statements import STATEMENTS
from twin.programs.sinumerik.language.tokens import CAPITALS, PLAIN, TOKEN
from twin.programs.source import WordPlace

INCH_MM: Final = 25.4
DIGITS: Final = 4
NO_FEED: Final = frozenset(
    {"G0", "G4", "G25", "G26", "G33", "G331", "G332", "G63", "G74", "G75", "G110", "G111", "G112"}
) | frozenset(code for code, group in GROUPS.items() if group == "frame")
"""Codes whose axis words are no way at the feed in force."""
NO_SPEED: Final = frozenset({"G4", "G25", "G26", "G96", "G961"})
PROBING: Final = frozenset({"MEAS", "MEAW", "MEASA", "MEAWA"})
NO_BRANCH: Final = frozenset({"DEF", "EXTERN"})
CALLS_NOTHING: Final = re.compile(
    r"(?:CYCLE[0-9]+|HOLES[12]|POCKET[1-4]|SLOT[12]|LONGHOLE|MSG|WORKPIECE|FGROUP|GROUP_\w+|SETMS|STOPRE)$"
)
CALL: Final = re.compile(
    r"[ \t]*+(?:/[0-9]?+[ \t]*+)?+(?:[N:][ \t]*+[0-9]++[ \t]*+)?+"
    r"(?:MCALL\b|([A-Z_]{2}\w*+|L[0-9]++)[ \t]*+(?:$|;|\(|P[ \t]*+=?[ \t]*+[0-9]))"
)
"""A block that calls a subprogram or a cycle: it stands there by itself, with P at most."""
NUMBER: Final = re.compile(rf"[-+]?+[ \t]*+{PLAIN}")


class Piece(NamedTuple):
    """One token of a line outside brackets: its group in `TOKEN`, its text in capitals, and where it lies."""

    group: int
    text: str
    begin: int
    end: int


def pieces(line: str) -> Iterator[Piece]:
    """The tokens outside brackets and before the comment."""
    depth = 0
    for match in TOKEN.finditer(line.translate(CAPITALS)):
        group = match.lastindex or 0
        if group == 9:
            return
        begin = match.start(2 if group == 3 else group)
        text = match.group(group) if group != 3 else match[2] + match[3]
        depth -= group == 8 and text in ")]"
        if depth <= 0 or (depth == 1 and group == 8 and text in "(["):
            yield Piece(group, text, begin, match.end())
        depth += group == 8 and text in "(["


def find_word(line: str, letter: str) -> WordPlace | None:
    """The last word with that letter in a block: `F500`, `F=500`, `S1=3000`; None where there is none.

    >>> find_word("N10 G1 X4 F400 ;F1", "F")
    WordPlace(begin=10, figure=11, end=14, plain=True)
    >>> find_word("G1 X4 F=R1*2 Y5", "F")
    WordPlace(begin=6, figure=8, end=12, plain=False)
    """
    found, all_pieces = None, list(pieces(line))
    for at, piece in enumerate(all_pieces):
        if piece.group == 3 and piece.text[0] == letter:
            found = WordPlace(piece.begin, piece.begin + 1, piece.end, True)
        named = piece.group in (1, 4) and piece.text in (letter, f"{letter}1")
        if named and at + 1 < len(all_pieces) and all_pieces[at + 1].text == "=":
            begin, end = all_pieces[at + 1].end, value_end(all_pieces, at + 2)
            plain = NUMBER.fullmatch(line[begin:end].strip()) is not None
            found = WordPlace(piece.begin, begin, end, plain)
    return found


def value_end(all_pieces: list[Piece], at: int) -> int:
    """Return where the expression ends that begins at a token."""
    end, wants_operand = all_pieces[at - 1].end, True
    for piece in all_pieces[at:]:
        is_operator = piece.group == 8 or piece.text in ("DIV", "MOD")
        if not wants_operand and not is_operator:
            break
        end = piece.end
        wants_operand = is_operator and piece.text not in (")", "]")
    return end


def with_word(line: str, letter: str, figure: str) -> str:
    """The block with this word: in place of the one that is there, else behind the last word.

    >>> with_word("N10 G1 X4 F=R1 ;finish", "F", "500"), with_word("N10 G1 X4 ;finish", "F", "500")
    ('N10 G1 X4 F=500 ;finish', 'N10 G1 X4 F500 ;finish')
    """
    place = find_word(line, letter)
    if place is not None:
        return place.replaced(line, figure)
    all_pieces = list(pieces(line))
    end = all_pieces[-1].end if all_pieces else 0
    dense = len(all_pieces) > 1 and " " not in line[:end].strip()
    gap = "" if (dense and all_pieces[-1].group == 3) or not end else " "
    return line[:end] + gap + letter + figure + line[end:]


def stands_alone(line: str) -> bool:
    """Return True for a block that takes no further word: a call, or a jump and its like.

    >>> [stands_alone(line) for line in ("N9 POCKET3(5,0)", "MCALL CYCLE81(5,0)", "L100 P2", "SUPA", "X=IC(5)", "GOTOF LAB")]
    [True, True, True, False, False, True]
    """
    names = {piece.text for piece in pieces(line) if piece.group == 4}
    found = CALL.match(line.translate(CAPITALS))
    return bool(names & STATEMENTS.keys()) or (found is not None and found[1] not in GROUPS)


def feed_place(line: str) -> WordPlace | None:
    """Return the place of F."""
    return find_word(line, "F")


def speed_place(line: str) -> WordPlace | None:
    """Return the place of S, or S1."""
    return find_word(line, "S")


def with_feed(line: str, figure: str) -> str:
    """Return the block with this F; a call stays as it is."""
    return line if stands_alone(line) else with_word(line, "F", figure)


def with_speed(line: str, figure: str) -> str:
    """Return the block with this S; a call stays as it is."""
    return line if stands_alone(line) else with_word(line, "S", figure)


def codes(line: str) -> frozenset[str]:
    """The G codes and names of a block by themselves: G1, SUPA, TRANS; M codes as M3.

    >>> sorted(codes("N10 G01 X3 M1=3 SOFT ;G20"))
    ['G1', 'M3', 'N10', 'SOFT']
    """
    found, all_pieces = set(), list(pieces(line))
    for at, piece in enumerate(all_pieces):
        if piece.group == 3 and piece.text[0] in "GMN":
            digits = piece.text[1:].strip()
            found.add(piece.text[0] + (str(int(digits)) if digits.isdecimal() else digits))
        elif piece.group in (1, 4) and piece.text in ("M", "M1") and len(all_pieces) > at + 2 and all_pieces[at + 2].group == 5:
            found.add("M" + all_pieces[at + 2].text)
        elif piece.group == 4 and (at + 1 == len(all_pieces) or all_pieces[at + 1].text != "="):
            found.add(piece.text)
    return frozenset(found)


def feed_figure(feed_mm_min: float, inch: bool) -> str:
    """A feed, rounded down.

    >>> feed_figure(500.0, False), feed_figure(437.26, False), feed_figure(83.333, False)
    ('500', '437.2', '83.33')
    """
    value = (feed_mm_min / INCH_MM if inch else feed_mm_min) * (1.0 + 1e-12)
    places = max(0, DIGITS - 1 - math.floor(math.log10(value)))
    text = f"{math.floor(value * 10**places) / 10**places:.{places}f}"
    return text.rstrip("0").rstrip(".") if "." in text else text


def figure_mm_min(figure: str, inch: bool) -> float:
    """The feed that a control reads.

    >>> figure_mm_min("50", True), figure_mm_min("=500", False)
    (1270.0, 500.0)
    """
    return float(figure.strip().lstrip("=").upper().replace("EX", "e")) * (INCH_MM if inch else 1.0)


def exact_feed_figure(feed_mm_min: float, inch: bool) -> str:
    """A feed to the sixth place.

    >>> exact_feed_figure(1270.0, True), exact_feed_figure(83.3333333, False)
    ('50', '83.333333')
    """
    return f"{feed_mm_min / INCH_MM if inch else feed_mm_min:.6f}".rstrip("0").rstrip(".")


def inch_lines(lines: list[str], inch: bool = False) -> list[bool]:
    """Return True for each line with G700 in force; G70 leaves feeds in mm, except on a control set up in inches (`inch`).

    >>> inch_lines(["G1 F3", "G700", "G1 F3 ;G710", "G710 G1 F3", "G70 F3"])
    [False, True, True, False, False]
    """
    found, base = [], inch
    for line in lines:
        of_line = codes(line) if "7" in line else frozenset()
        if "G700" in of_line or (base and "G70" in of_line):
            inch = True
        elif of_line & {"G710", "G71", "G70"}:
            inch = False
        found.append(inch)
    return found


def branches(lines: list[str]) -> list[bool]:
    """Return True for each line that the control may come to, or go on from, another way than from line to line.

    Block skips, jumps and what they aim at, structures, repetitions, calls by name, and the blocks behind which MCALL calls one;
    a cycle of the control comes back to where it was called.

    >>> branches(["G1 X3", "/N20 G1 X4", "LAB: X5", "SUB1 P2", "GOTOB LAB"])
    [False, True, True, True, True]
    >>> branches(["MCALL SUB1", "X5", "MCALL", "MCALL CYCLE81(9,0,1,-5)", "X5", "MCALL"])
    [True, True, True, False, False, False]
    """
    marked: list[tuple[bool, str]] = []
    jumps = modal = False
    for line in lines:
        upper = line.translate(CAPITALS)
        words = [piece for piece in pieces(line) if piece.group == 4]
        names = [word.text for word in words]
        leads = any(name in STATEMENTS and name not in NO_BRANCH for name in names)
        jumps = jumps or any(name.startswith(("GOTO", "REPEAT")) for name in names)
        own = next((name for name in names if calls(name, upper)), None)
        was_modal = modal
        if "MCALL" in names:
            modal = any(name != "MCALL" and not CALLS_NOTHING.match(name) for name in names)
        marked.append((upper.lstrip().startswith(("/", "%")) or leads or own is not None or modal or was_modal, upper))
    return [one or (jumps and is_aim(upper)) for one, upper in marked]


LABEL: Final = re.compile(
    r"[ \t]*+(?:/[0-9]?+[ \t]*+)?+(?:[N:][ \t]*+[0-9]++[ \t]*+)?+(?:[A-Z_]{2}[A-Z0-9_]*+[ \t]*+:(?!=)|(?<=[0-9])|(?<=[0-9][ \t]))"
)


def is_aim(upper: str) -> bool:
    """Return True for a line with a label or a block number."""
    return LABEL.match(upper) is not None


def calls(name: str, upper: str) -> bool:
    """Return True for a name that is a subprogram: no G code, no cycle, no variable that gets a value."""
    if name in GROUPS or name in STATEMENTS or CALLS_NOTHING.match(name) or name == "MCALL" or len(name) < 2:
        return False
    return re.match(rf"[ \t]*+(?:N[0-9]++[ \t]*+)?+{re.escape(name)}[ \t]*+(?:$|;|\(|P[ \t]*+=?[ \t]*+[0-9])", upper) is not None


def takes_feed(line: str) -> bool:
    """Return True for a block with a place to go to, unless its codes say that it goes there another way.

    >>> takes_feed("X5"), takes_feed("G0 X5"), takes_feed("TRANS X5"), takes_feed("CYCLE81(10,0,2,-5)"), takes_feed("X=IC(5)")
    (True, False, False, False, True)
    """
    named = any(find_word(line, letter) is not None for letter in "XYZ") or "AP" in codes_with_values(line)
    return named and not codes(line) & NO_FEED


def codes_with_values(line: str) -> frozenset[str]:
    return frozenset(piece.text for piece in pieces(line) if piece.group == 4)


def probes(line: str) -> bool:
    """Return True for a probing move."""
    return bool(codes_with_values(line) & PROBING)


def commands_speed(line: str) -> bool:
    """Return True where S is a speed of the spindle."""
    return not codes(line) & NO_SPEED


def starts_spindle(line: str) -> bool:
    """Return True for M3 and M4."""
    return bool(codes(line) & {"M3", "M4"})


BLOCK_NUMBER: Final = re.compile(r"^\s*(?:/\d?)?\s*N0*(\d+)", re.I)


def block_number(line: str) -> int | None:
    """Return the N word at the beginning of a block.

    >>> block_number("/N0010 G1 X3"), block_number("G1 X5")
    (10, None)
    """
    found = BLOCK_NUMBER.match(line)
    return None if found is None else int(found[1])
