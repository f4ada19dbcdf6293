"""Tokens of one block: words with a plain number, keywords, numbers, operators. One pass of one pattern.

All repetitions are possessive, so that no line, however long, makes the pattern go back.
"""

import re
from typing import NamedTuple

from twin.programs.refusal import RefusedError

WORD, NUMBER, KEYWORD, OPERATOR = range(4)

NUMBER_MAX = 999_999_999.0
"""The nine digits of a control; also what keeps arithmetic on lengths finite."""

FUNCTION_NAMES = ("SIN", "COS", "TAN", "ASIN", "ACOS", "ATAN", "SQRT", "ABS", "ROUND", "FIX", "FUP", "LN", "EXP", "BIN", "BCD")
STATEMENT_NAMES = ("GOTO", "IF", "THEN", "WHILE", "DO", "END")
OPERATOR_NAMES = ("EQ", "NE", "GT", "LT", "GE", "LE", "AND", "OR", "XOR", "MOD")
NAMES = sorted((*FUNCTION_NAMES, *STATEMENT_NAMES, *OPERATOR_NAMES), key=len, reverse=True)

PLAIN_NUMBER = r"(?:[0-9]++\.?+[0-9]*+|\.[0-9]++)"
TOKEN = re.compile(
    rf"[ \t]*+(?:([A-Z:])[ \t]*+([-+]?+[ \t]*+{PLAIN_NUMBER})"  # 1, 2: a word
    rf"|({PLAIN_NUMBER})"  # 3: a number
    rf"|({'|'.join(NAMES)}|[A-Z])"  # 4: a keyword, or the letter of a word whose value is an expression
    r"|([-+*/\[\]#=,])"  # 5: an operator
    r"|(\([^)]*+\)?+|;.*+)"  # 6: a comment
    r"|(\S))"  # 7: anything else
)


class Token(NamedTuple):
    """kind; name: letter, keyword or operator; number (None unless there is one); text as written; whole: it has no point."""

    kind: int
    name: str
    number: float
    text: str
    whole: bool


def number(text: str, word: str) -> float:
    value = float(text.replace(" ", "").replace("\t", ""))
    if not -NUMBER_MAX <= value <= NUMBER_MAX:
        raise RefusedError(word, "has more than nine digits before the point")
    return value


def _around(written: str, place: int) -> str:
    """Return the text around a place, from space to space, as far as it helps."""
    before = written[:place].rpartition(" ")[2][-16:]
    return before + written[place:].partition(" ")[0][:16]


def tokenise(line: str, written: str) -> list[Token]:
    """Tokens of `line`, which is `written` in capitals, without its comments.

    >>> [token.text for token in tokenise("N10 G1X-1.5 (FINISH) Y#1", "n10 g1x-1.5 (finish) y#1")]
    ['n10', 'g1', 'x-1.5', 'y', '#', '1']

    Raises RefusedError for a character that no program has, and for a comment without an end.
    """
    tokens = []
    for match in TOKEN.finditer(line):
        index = match.lastindex
        text = written[match.start(index or 0) : match.end()]
        if index == 2:
            text = written[match.start(1) : match.end()]
            digits = match.group(2)
            tokens.append(Token(WORD, match.group(1), number(digits, text), text, "." not in digits))
        elif index == 3:
            tokens.append(Token(NUMBER, "", number(text, text), text, "." not in text))
        elif index == 4:
            tokens.append(Token(KEYWORD, match.group(4), 0.0, text, False))
        elif index == 5:
            tokens.append(Token(OPERATOR, text, 0.0, text, False))
        elif index == 6:
            if text[0] == "(" and text[-1] != ")":
                raise RefusedError(text[:20], "this comment has no end; write )")
        else:
            around = _around(written, match.start(7))
            o_for_0 = "; the letter O is no 0" if "O" in around.upper() else ""
            raise RefusedError(around, f"the character {text} has no meaning there; a comment stands in ( ){o_for_0}")
    return tokens
