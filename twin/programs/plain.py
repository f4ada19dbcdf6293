"""Plain motions: blocks of nothing but `N G0…G3 X Y Z I J F`, as most blocks of a long program are, in every language of G codes.

One pattern takes such a block apart and its move is put out at once; everything else goes the long way of its language.
"""

import re
from collections.abc import Callable
from dataclasses import dataclass
from typing import Final

from twin.programs.arcs import by_centre
from twin.programs.canonical import Arc, Linear, Move, Rapid
from twin.programs.refusal import RefusedError

PLAIN_NUMBER: Final = r"[-+]?+(?:[0-9]{1,9}+(?:\.[0-9]{0,15}+)?+|\.[0-9]{1,15}+)"
POINT_NUMBER: Final = r"[-+]?+(?:[0-9]{1,9}+\.[0-9]{0,15}+|\.[0-9]{1,15}+)"


def plain_pattern(length: str) -> re.Pattern[str]:
    """A block of nothing but `N G0…G3 X Y Z I J F` in this order, each at most once. Possessive: it never goes back."""
    words = "".join(rf"(?:{letter}({length})[ \t]*+)?+" for letter in "XYZIJF")
    return re.compile(rf"[ \t]*+(?:N[0-9]++[ \t]*+)?+(?:G0?+([0-3])(?![0-9.])[ \t]*+)?+{words}")


PLAIN: Final = plain_pattern(PLAIN_NUMBER)
PLAIN_WITH_POINTS: Final = plain_pattern(POINT_NUMBER)


@dataclass(slots=True)
class PlainModes:
    """The modes in which plain blocks are run: in G17 and G94, with nothing but a translation between program and machine.

    motion: 0 to 3; feed_mm_min: of F, 0 = none yet; unit_mm and feed_unit_mm: one unit of a length and of a feed
    """

    motion: int
    absolute: bool
    position: tuple[float, float, float]
    offset: tuple[float, ...]
    feed_mm_min: float
    unit_mm: float
    feed_unit_mm: float
    arc_radius_error_mm_max: float


def plain_blocks(
    lines: list[str],
    at: int,
    stop: int,
    program: str | None,
    match: Callable[[str], re.Match[str] | None],
    modes: PlainModes,
    put: Callable[[Move], None],
) -> int:
    """Run plain motions from line `at` up to the first block that is none, or that has to be refused; returns its line."""
    new, error_max = tuple.__new__, modes.arc_radius_error_mm_max
    unit, feed_unit, absolute, motion, feed = modes.unit_mm, modes.feed_unit_mm, modes.absolute, modes.motion, modes.feed_mm_min
    offset_x, offset_y, offset_z = modes.offset
    x, y, z = modes.position
    while at < stop:
        found = match(lines[at])
        if found is None:
            break
        g, x_word, y_word, z_word, i_word, j_word, f_word = found.groups()
        mode = motion if g is None else int(g)
        new_feed = feed if f_word is None else float(f_word) * feed_unit
        if absolute:
            new_x = x if x_word is None else float(x_word) * unit + offset_x
            new_y = y if y_word is None else float(y_word) * unit + offset_y
            new_z = z if z_word is None else float(z_word) * unit + offset_z
        else:
            new_x = x if x_word is None else float(x_word) * unit + x
            new_y = y if y_word is None else float(y_word) * unit + y
            new_z = z if z_word is None else float(z_word) * unit + z
        moves = x_word is not None or y_word is not None or z_word is not None
        if i_word is not None or j_word is not None:
            centre = (
                x if i_word is None else x + float(i_word) * unit,
                y if j_word is None else y + float(j_word) * unit,
            )
            if mode < 2 or new_feed <= 0.0:
                break
            try:
                swept = by_centre((x, y), (new_x, new_y), centre, mode == 2, error_max)
            except RefusedError:
                break  # The long way says it with line and word.
            end, middle = (new_x, new_y, new_z), (centre[0], centre[1], z)
            put(new(Arc, (at, end, middle, 17, swept.sweep_rad, new_feed, None, program, 1.0)))
        elif moves:
            if mode == 1 and new_feed > 0.0:
                put(new(Linear, (at, (new_x, new_y, new_z), new_feed, None, program)))
            elif mode == 0 and new_feed >= 0.0:
                put(new(Rapid, (at, (new_x, new_y, new_z), program)))
            else:
                break
        elif new_feed < 0.0:
            break
        motion, feed, x, y, z = mode, new_feed, new_x, new_y, new_z
        at += 1
    modes.motion, modes.feed_mm_min, modes.position = motion, feed, (x, y, z)
    return at
