"""A part program of any language in, canonical moves out."""

from twin.programs.canonical import Move
from twin.programs.discovery import dialect_of
from twin.programs.settings import Settings


def interpret(text: str, settings: Settings | None = None) -> list[Move]:
    """Run a part program and return its canonical moves, in order.

    text: in the language that `Settings.dialect` names, else in that which the text shows; lines may end in any way
    settings: what is not in the text; None = `Settings()`

    Raises PartProgramError (line, word, reason) where the control would refuse a block, or its language is not read.

    >>> for move in interpret("G21 G90\\nG1 X10. F600\\nM30"):
    ...     print(move)
    Linear(line=1, end_mm=(10.0, 0.0, 0.0), feed_mm_min=600.0, feed_per_rev_mm=None, program=None)
    ProgramEnd(line=2, program=None)
    """
    settings = settings or Settings()
    return dialect_of(text, settings).interpret(text, settings)
