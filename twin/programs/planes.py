"""The working planes G17, G18 and G19, as ISO 6983 has them: x and y, z and x, y and z."""

from collections.abc import Mapping
from typing import Final

PLANES: Final[Mapping[int, tuple[int, int, int]]] = {17: (0, 1, 2), 18: (2, 0, 1), 19: (1, 2, 0)}
"""First and second axis and normal of each plane, so that first to second is counter-clockwise about the normal."""
