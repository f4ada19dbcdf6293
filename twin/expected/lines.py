"""The number by which a control tells a line: the one that the program gives it (N10), or the place of the block in the text.

A block without such a number has the last one before it, which is what a control goes on showing. Which of them a control tells
is an option; without it, programs in which most blocks have N words are counted by these, all others from 0.
"""

from collections.abc import Callable, Sequence
from enum import StrEnum

MOST = 0.5
BlockNumber = Callable[[str], int | None]
"""The number that the program gives a line, in its language (`SourceWords.block_number`)."""


class Numbering(StrEnum):
    """The ways to number the lines of a program."""

    N_WORDS = "n_words"
    FROM_0 = "from_0"
    FROM_1 = "from_1"


IN_WORDS = {
    Numbering.N_WORDS: "lines by the block numbers in the program",
    Numbering.FROM_0: "lines counted from 0",
    Numbering.FROM_1: "lines counted from 1",
}


def numbering_of(source: Sequence[str], block_number: BlockNumber) -> Numbering:
    """Return how the lines of a program are most likely numbered.

    >>> from twin.programs.discovery import named
    >>> n_word = named("fanuc").words.block_number
    >>> numbering_of(["%", "N10 G1 X1", "N20 X2"], n_word).value, numbering_of(["N100", "G1 X1", "X2"], n_word).value
    ('n_words', 'from_0')
    """
    blocks = [line for line in source if line.strip() and line.strip()[0] not in "%(;O:"]
    named = sum(1 for line in blocks if block_number(line) is not None)
    return Numbering.N_WORDS if blocks and named > MOST * len(blocks) else Numbering.FROM_0


def numbers(source: Sequence[str], numbering: Numbering, block_number: BlockNumber) -> list[int]:
    """Return the number of each line of a text.

    >>> from twin.programs.discovery import named
    >>> n_word = named("fanuc").words.block_number
    >>> numbers(["N10 G1 X1", "X2", "N30 X3"], Numbering.N_WORDS, n_word), numbers(["G1", "X2"], Numbering.FROM_1, n_word)
    ([10, 10, 30], [1, 2])
    """
    if numbering is not Numbering.N_WORDS:
        first = int(numbering is Numbering.FROM_1)
        return list(range(first, first + len(source)))
    found, last = [], 0
    for line in source:
        number = block_number(line)
        last = last if number is None else number
        found.append(last)
    return found
