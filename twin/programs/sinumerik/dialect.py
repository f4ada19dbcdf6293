"""The language of SINUMERIK controls: names beside letters, R parameters, frames, cycles with arguments."""

import re
from typing import Final

from twin.programs.dialect import Dialect
from twin.programs.sinumerik import source_words
from twin.programs.sinumerik.codes import M_CODES
from twin.programs.sinumerik.interpreter import interpret

BEGINNINGS: Final = (
    r"MCALL|DEF[ \t]++(?:REAL|INT|BOOL|STRING|CHAR)|PROC[ \t]|EXTERN[ \t]|CYCLE[0-9]|HOLES[12]\b|POCKET[1-4]\b"
    r"|SLOT[12]\b|LONGHOLE\b"
    r"|A?TRANS\b|A?ROT\b|A?SCALE\b|A?MIRROR\b|MSG[ \t]*+\(|WORKPIECE[ \t]*+\(|STOPRE\b|REPEATB?\b"
    r"|ENDIF\b|ENDLOOP\b|ENDFOR\b|GOTO[FBCS]\b"
)
"""Words at the beginning of a block."""
CODES: Final = r"SUPA|G50[05]|G64[1-5]|G45[01]|FFWON|COMPCAD|COMPON|SOFT|BRISK|TRAORI|CIP|G60[123]|G1(?:10|11|12|53)"
ADDRESSES: Final = r"CR|AR|AP|RP|RND|RNDM|CHF|CHR|TURN|SPOS|LIMS|ADIS|CTOL|OFFN|ANG|[XYZIJKF]|R(?:[0-9]++|[ \t]*+\[[^]\n]*+\])"
OWN: Final = re.compile(
    r"^[ \t]*+%_N_\w|^;\$PATH="
    rf"|^[ \t]*+(?:N[0-9]++[ \t]*+)?+(?:{BEGINNINGS})"
    rf"|(?<![A-Z0-9_])(?:{CODES})(?![A-Z0-9_.])"
    rf"|(?<![A-Z0-9_])(?:{ADDRESSES})[ \t]*+=(?!=)"
    r"|(?<![A-Z0-9_])T[ \t]*+=[ \t]*+\"|\$[AP]_",
    re.M | re.I,
)
"""Words that no other language has."""
OUTSIDE: Final = re.compile(r"\([^()\n]*+\)|(?<=;)(?!\$PATH).*+")
"""Text in brackets, a comment in other languages, and after `;`: it does not show the language."""
COMMENT: Final = re.compile(r"^[ \t]*+;", re.M)
PLAIN: Final = re.compile(r"(?<![A-Z_])[GMXYZ][ \t]*+[-+]?+\.?+[0-9]", re.I)


def recognises(text: str) -> float:
    """Return 0.95 for a text with words of this language alone, 0.4 for plain ISO words beside a comment behind `;`."""
    if OWN.search(OUTSIDE.sub("()", text)) is not None:
        return 0.95
    return 0.4 if COMMENT.search(text) is not None and PLAIN.search(text) is not None else 0.0


DIALECT = Dialect(
    name="sinumerik",
    title="SINUMERIK mill",
    control="SINUMERIK 840D sl, ONE, 828D",
    suffixes=(".mpf", ".spf"),
    recognises=recognises,
    interpret=interpret,
    words=source_words,
    m_codes=M_CODES,
)
