"""The part of an interpreter's state that every language has: the moves that were put out, and the block that puts them out."""

from typing import Final

from twin.programs.canonical import Move, Position
from twin.programs.refusal import RefusedError
from twin.programs.settings import Settings

REACH_MM: Final = 1e12
"""No machine goes as far, and beyond it sums of positions lose their figures."""


class PutOut:
    """out: what moves go to now, `moves` or the buffer of a compensated section; line, program: of the running block."""

    __slots__ = ("line", "moves", "out", "program", "settings")

    settings: Settings
    moves: list[Move]
    out: list[Move]
    line: int
    program: str | None

    def emit(self, move: Move) -> None:
        """Put out a move. RefusedError where there are more than any program makes."""
        self.out.append(move)
        if len(self.out) > self.settings.moves_max:
            raise RefusedError("", f"the program makes more than {self.settings.moves_max} moves; Settings.moves_max")

    @staticmethod
    def checked(position: Position) -> Position:
        """Return the position, if a machine could be there; else RefusedError."""
        if not all(-REACH_MM < figure < REACH_MM for figure in position):
            raise RefusedError("", "the end of this move is beyond any machine")
        return position
