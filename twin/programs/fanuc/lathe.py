"""The words that mark a lathe's program (FANUC G-code system A), where G99, G50 and X mean something else than on a mill."""

import re
from typing import Final

from twin.errors import PartProgramError

MARKS: Final = re.compile(r"(?<![A-Z#])(?:G50[ \t]*+(S)[ \t]*+[0-9.]++|T([0-9]{2})(?:\2|00)(?![0-9.]))", re.I)
"""`G50 S2500`, the highest speed, and `T0101`, a turret's place with its offset."""
CHANGE: Final = re.compile(r"(?<![A-Z#])M0?6(?![0-9.])", re.I)
COMMENT: Final = re.compile(r"\([^)\n]*+\)?+|;[^\n]*+")
REASON: Final = (
    "belongs to a lathe (G-code system A), which is not read: X would be a diameter there, and G99 a feed per revolution; "
    "only mills' programs are read"
)


def refuse_lathe(text: str) -> None:
    """Raise PartProgramError at the first word that only a lathe's program has.

    A tool number of four digits counts only where no block has M6: a mill with so many tools changes them by it.

    >>> refuse_lathe("T0101 M6 (not G50 S2500)")
    """
    if MARKS.search(text) is None:
        return
    bare = COMMENT.sub("", text)
    changes = CHANGE.search(bare) is not None
    for mark in MARKS.finditer(bare):
        if mark.group(1) is not None or not changes:
            raise PartProgramError(bare.count("\n", 0, mark.start()) + 1, " ".join(mark.group().split()), REASON)
