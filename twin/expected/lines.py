"""The number by which a control tells a line: its N word, or the place of the block in the text.

A block without an N word has the last one before it, which is what a control goes on showing. Which of them a control tells is an
option; without it, programs in which most blocks have N words are counted by these, all others from 0.
"""

import re
from collections.abc import Sequence
from enum import StrEnum

N_WORD = re.compile(r"^\s*/?\d?\s*N\s*0*(\d+)", re.I)
MOST = 0.5


class Numbering(StrEnum):
    """The ways to number the lines of a program."""

    N_WORDS = "n_words"
    FROM_0 = "from_0"
    FROM_1 = "from_1"


IN_WORDS = {
    Numbering.N_WORDS: "lines by N words",
    Numbering.FROM_0: "lines counted from 0",
    Numbering.FROM_1: "lines counted from 1",
}


def numbering_of(source: Sequence[str]) -> Numbering:
    """Return how the lines of a program are most likely numbered.

    >>> numbering_of(["%", "N10 G1 X1", "N20 X2"]).value, numbering_of(["N100", "G1 X1", "X2"]).value
    ('n_words', 'from_0')
    """
    blocks = [line for line in source if line.strip() and line.strip()[0] not in "%(;O:"]
    named = sum(1 for line in blocks if N_WORD.match(line))
    return Numbering.N_WORDS if blocks and named > MOST * len(blocks) else Numbering.FROM_0


def numbers(source: Sequence[str], numbering: Numbering) -> list[int]:
    """Return the number of each line of a text.

    >>> numbers(["N10 G1 X1", "X2", "N30 X3"], Numbering.N_WORDS), numbers(["G1", "X2"], Numbering.FROM_1)
    ([10, 10, 30], [1, 2])
    """
    if numbering is not Numbering.N_WORDS:
        first = int(numbering is Numbering.FROM_1)
        return list(range(first, first + len(source)))
    found, last = [], 0
    for line in source:
        match = N_WORD.match(line)
        last = last if match is None else int(match[1])
        found.append(last)
    return found
