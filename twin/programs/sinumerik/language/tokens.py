"""Tokens of one block: addresses with their number, names, numbers, texts, operators. One pass of one pattern.

A single letter with a number behind it is an address with its value (`X10`, `R1`, `G54`); with `=` behind the number it is an
extended address (`M1=3`, `I1=AC(5)`). All repetitions are possessive, so that no line makes the pattern go back.
"""

import re
from enum import Enum, auto
from typing import Final, NamedTuple

from twin.programs.refusal import RefusedError

NUMBER_MAX: Final = 1e15
"""More than any length, feed or count; it keeps the arithmetic finite."""
CAPITALS: Final = {code: code - 32 for code in range(ord("a"), ord("z") + 1)}
PLAIN: Final = r"(?:[0-9]++(?:\.[0-9]*+)?+|\.[0-9]++)(?:EX[-+]?+[0-9]{1,3}+)?+"
WORD_OPERATORS: Final = frozenset({"DIV", "MOD", "AND", "OR", "XOR", "NOT", "B_AND", "B_OR", "B_XOR", "B_NOT"})
SHOWN_MAX: Final = 24


class Kind(Enum):
    """The kind of a token."""

    ADDRESS = auto()
    NAME = auto()
    NUMBER = auto()
    TEXT = auto()
    OPERATOR = auto()


TOKEN: Final = re.compile(
    r"[ \t]*+(?:"
    r"([A-Z][0-9]{1,4}+)(?=[ \t]*+=(?!=))"  # 1: an extended address
    rf"|(?:([A-Z])[ \t]*+([-+]?+[ \t]*+{PLAIN}))"  # 2, 3: an address and its value
    r"|(\$?+[A-Z_][A-Z_][A-Z0-9_]*+|\$?+[A-Z_])"  # 4: a name
    rf"|({PLAIN})"  # 5: a number
    r"""|("[^"]*+"?+)"""  # 6: a text
    r"|('[HB][0-9A-F]*+'?+)"  # 7: a hexadecimal or binary constant
    r"|(==|<>|>=|<=|<<|[-+*/()\[\]=<>,:])"  # 8: an operator
    r"|(;.*+)"  # 9: a comment
    r"|([^ \t]))"  # 10: anything else
)


class Token(NamedTuple):
    """kind; name: letter, name or operator in capitals, or the contents of a text; number; text as written; where it begins."""

    kind: Kind
    name: str
    number: float
    text: str
    begin: int


def number(digits: str, word: str) -> float:
    """The value of a plain number; `EX` is its exponent of ten."""
    value = float(digits.replace(" ", "").replace("\t", "").replace("EX", "e"))
    if not -NUMBER_MAX <= value <= NUMBER_MAX:
        raise RefusedError(word, "is more than a control can hold")
    return value


def constant(written: str) -> float:
    """`'H1F'` is 31, `'B101'` is 5.

    >>> constant("'H1F'"), constant("'B101'")
    (31.0, 5.0)
    """
    digits, base = written[2:-1], 16 if written[1] == "H" else 2
    if written[-1] != "'" or not digits or len(digits) > 32 or (base == 2 and set(digits) - {"0", "1"}):
        raise RefusedError(written, "is no constant; write 'HFF' or 'B1010'")
    return float(int(digits, base))


def tokenise(line: str, written: str) -> list[Token]:
    """Tokens of `line`, which is `written` in capitals, without its comment.

    >>> [token.text for token in tokenise("N10 G1X=R1+2 Y-5.5 ;FINISH", "n10 g1x=r1+2 y-5.5 ;finish")]
    ['n10', 'g1', 'x', '=', 'r1', '+', '2', 'y-5.5']

    Raises RefusedError for a character that no program has, and for a text without an end.
    """
    tokens: list[Token] = []
    for match in TOKEN.finditer(line):
        index = match.lastindex or 0
        begin = match.start(2 if index == 3 else index)
        text = written[begin : match.end()]
        if index == 1:
            tokens.append(Token(Kind.NAME, match[1], 0.0, text, begin))
        elif index == 3:
            tokens.append(Token(Kind.ADDRESS, match[2], number(match[3], text), text, begin))
        elif index == 4:
            kind = Kind.OPERATOR if match[4] in WORD_OPERATORS else Kind.NAME
            tokens.append(Token(kind, match[4], 0.0, text, begin))
        elif index == 5:
            tokens.append(Token(Kind.NUMBER, "", number(match[5], text), text, begin))
        elif index == 6:
            if len(text) < 2 or text[-1] != '"':
                raise RefusedError(text[:SHOWN_MAX], 'this text has no end; write "')
            tokens.append(Token(Kind.TEXT, text[1:-1], 0.0, text, begin))
        elif index == 7:
            tokens.append(Token(Kind.NUMBER, "", constant(match[7]), text, begin))
        elif index == 8:
            tokens.append(Token(Kind.OPERATOR, match[8], 0.0, text, begin))
        elif index == 10:
            raise RefusedError(text, "this character has no meaning there; a comment stands behind ;")
    return tokens
