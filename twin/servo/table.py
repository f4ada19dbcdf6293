"""The table side of an axis: where a second, table-side scale sees the axis, at a tick.

Nominally the screw is rigid and exact, and the table is where the motor says.
"""

from twin.sites import Site, at


def table(position_mm: float) -> float:
    """Table position, mm, from the motor's.

    >>> table(12.5)
    12.5
    """
    position_mm = at(Site.MECHANICS, position_mm)
    table_mm = at(Site.MECHANICS, position_mm)
    return table_mm  # noqa: RET504 - the quantity has a name that effects know
