"""The mill dialect of FANUC-type controls with Macro B: G codes, O numbers, `#` variables."""

import re
from typing import Final

from twin.programs.dialect import Dialect
from twin.programs.fanuc import words
from twin.programs.fanuc.codes import M_CODES
from twin.programs.fanuc.interpreter import interpret

OWN: Final = re.compile(
    r"^[ \t]*+[O:][0-9]{1,8}+(?![0-9.])|#[0-9\[]|G(?:6[567]|5\.1|54\.1|43|8[1-9]|73|28)(?![0-9.])|M9[89](?![0-9])", re.M | re.I
)
"""Program numbers, macro variables and calls, and codes that mean something else, or nothing, elsewhere."""
PLAIN: Final = re.compile(r"(?<![A-Z_])[A-Z][ \t]*+[-+]?+\.?+[0-9]|^[ \t]*+%|^[ \t]*+\(", re.M | re.I)
"""Words that other controls that read ISO 6983 have as well."""


def recognises(text: str) -> float:
    """Return 0.9 for a text with words of this language alone, 0.5 for one with plain ISO words."""
    if OWN.search(text) is not None:
        return 0.9
    return 0.5 if PLAIN.search(text) is not None else 0.0


DIALECT = Dialect(
    name="fanuc",
    title="FANUC mill",
    control="FANUC and controls of its type",
    suffixes=(".nc", ".ngc", ".tap", ".cnc", ".gcode", ".eia", ".min", ".txt"),
    recognises=recognises,
    interpret=interpret,
    words=words,
    m_codes=M_CODES,
)
