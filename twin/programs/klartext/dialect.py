"""Klartext of HEIDENHAIN, the language of TNC controls: `L X+10 Y-5 R0 F500 M3`, `TOOL CALL`, `CYCL DEF`, Q parameters."""

import re
from typing import Final

from twin.programs.dialect import Dialect
from twin.programs.klartext import words
from twin.programs.klartext.interpreter import interpret
from twin.programs.klartext.m_functions import CODES

BEGINS: Final = re.compile(r"^[ \t\ufeff]*+(?:N?+[0-9]++[ \t]++)?+(?:BEGIN|END) PGM(?![A-Z])", re.M | re.I)
OWN: Final = re.compile(
    r"^[ \t]*+(?:N?+[0-9]++[ \t]++)?+(?:TOOL (?:CALL|DEF)|CYCL (?:DEF|CALL)|BLK FORM|CALL (?:LBL|PGM)|LBL[ \t]|APPR |DEP "
    r"|FN[ \t]*+[0-9]++:|(?:L|LP|C|CP|CR|CT|CC)[ \t]++I?+(?:[XYZABC]|P[RA])[-+Q])",
    re.M | re.I,
)


def recognises(text: str) -> float:
    """Return 1 for a text with BEGIN PGM or END PGM, 0.95 for one with blocks that only Klartext has."""
    if BEGINS.search(text) is not None:
        return 1.0
    return 0.95 if OWN.search(text) is not None else 0.0


DIALECT = Dialect(
    name="klartext",
    title="HEIDENHAIN Klartext",
    control="HEIDENHAIN TNC",
    suffixes=(".h",),
    recognises=recognises,
    interpret=interpret,
    words=words,
    m_codes=CODES,
    end="END PGM",
    start="S in TOOL CALL and M3 or M4",
    speed_per_tool=True,
    blocks_are_numbered=True,
)
