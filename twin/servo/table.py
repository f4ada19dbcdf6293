"""The table side of an axis: where a second, table-side scale sees the axis, at a tick.

Nominally the screw is rigid and exact, and the table is where the motor says.
"""

from typing import NamedTuple

from twin.sites import Site, at


class Seen(NamedTuple):
    """The velocity of the axis, and where the table is."""

    velocity_mm_s: float
    table_mm: float


def table(position_mm: float, velocity_mm_s: float) -> Seen:
    """Table position, mm, from the motor's.

    >>> table(12.5, 3.0).table_mm
    12.5
    """
    position_mm = at(Site.MECHANICS, position_mm)
    velocity_mm_s = at(Site.MECHANICS, velocity_mm_s)
    table_mm = at(Site.MECHANICS, position_mm)
    return Seen(velocity_mm_s, table_mm)
