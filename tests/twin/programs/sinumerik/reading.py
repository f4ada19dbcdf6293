"""A SINUMERIK text run, and what its moves say, to a nanometre."""

from twin.programs import Arc, Linear, Move, Rapid, Settings, ToolOffset
from twin.programs.sinumerik.interpreter import interpret

TOOLS = Settings(tool_offsets={1: ToolOffset(0.0, 5.0), 2: ToolOffset(100.0, 3.0), 3: ToolOffset(0.0, 1.0)})


def run(text: str, settings: Settings | None = None) -> list[Move]:
    """The moves of a text."""
    return interpret(text, settings or Settings())


def rounded(figures: tuple[float, ...]) -> tuple[float, ...]:
    return tuple(round(figure, 6) + 0.0 for figure in figures)


def ends(moves: list[Move]) -> list[tuple[float, ...]]:
    """Return where each motion ends."""
    return [rounded(move.end_mm) for move in moves if isinstance(move, Rapid | Linear | Arc)]


def cuts(moves: list[Move]) -> list[tuple[str, tuple[float, ...]]]:
    """Each motion as the letter of its kind and its end."""
    letters = {Rapid: "R", Linear: "L", Arc: "A"}
    return [(letters[type(move)], rounded(move.end_mm)) for move in moves if isinstance(move, Rapid | Linear | Arc)]


def heights(moves: list[Move]) -> list[tuple[str, float]]:
    """Each motion as the letter of its kind and its z."""
    return [(letter, end[2]) for letter, end in cuts(moves)]


def only_arc(text: str, settings: Settings | None = None) -> Arc:
    (found,) = [move for move in run(text, settings) if isinstance(move, Arc)]
    return found
