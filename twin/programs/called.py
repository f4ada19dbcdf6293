"""Programs that a program calls and that stand in texts of their own."""

from collections.abc import Sequence
from typing import Final

from twin.programs.canonical import Move

NOT_AT_HAND: Final = (
    "its text is not at hand: simulate, expect and program times look for it in the folder of the program that calls it, "
    "optimise reads one text"
)
"""The end of the refusal of a call."""


def with_line_elsewhere(moves: Sequence[Move], line: int) -> list[Move]:
    """Return the moves, those of other texts with this line: what counts lines counts those of the main text only.

    >>> from twin.programs.canonical import ProgramEnd
    >>> [move.line for move in with_line_elsewhere([ProgramEnd(3), ProgramEnd(3, "L100")], 9)]
    [3, 9]
    """
    return [move if move.program is None else move._replace(line=line) for move in moves]
