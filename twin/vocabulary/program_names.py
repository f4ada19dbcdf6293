"""The name of a program: a control tells it with a path, leading zeros or an ending, a file with an ending of its own."""

import re
from functools import lru_cache

ENDINGS = (".nc", ".mpf", ".spf", ".h", ".eia", ".min", ".tap", ".ngc", ".cnc", ".gcode", ".txt")
"""The endings of files with part programs, of all languages (`twin/programs`)."""
_NUMBER = re.compile(r"[o:]?0*(\d+)")


@lru_cache(maxsize=4096)
def program_key(name: str) -> str:
    """Return the name under which a program is kept, of the name that a control tells or that its file has.

    >>> program_key("/PRG/O01701"), program_key("O1701.nc"), program_key("PLATE-1.NC")
    ('o1701', 'o1701', 'plate-1')
    """
    bare = name.strip().replace("\\", "/").rstrip("/").rpartition("/")[2].casefold()
    stem = next((bare.removesuffix(ending) for ending in ENDINGS if bare.endswith(ending)), bare)
    number = _NUMBER.fullmatch(stem)
    return stem if number is None else f"o{number[1]}"
