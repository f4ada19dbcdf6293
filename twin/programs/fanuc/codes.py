"""The G and M codes of the dialect, and which group each is of. G codes are counted in tenths: G54.1 is 541."""

from collections.abc import Mapping
from typing import Final

BY_GROUP: Final[Mapping[str, tuple[int, ...]]] = {
    "motion": (0, 10, 20, 30, 330),
    "cycle": (730, 740, 760, 800, 810, 820, 830, 840, 850, 860, 870, 880, 890),
    "plane": (170, 180, 190),
    "distance": (900, 910),
    "feed": (930, 940, 950),
    "units": (200, 210),
    "cutter": (400, 410, 420),
    "length": (430, 440, 490),
    "retract": (980, 990),
    "scaling": (500, 510),
    "macro": (660, 670),
    "speed": (960, 970),
    "work": (540, 541, 550, 560, 570, 580, 590),
    "path": (610, 640),
    "rotation": (680, 690),
    "polar": (150, 160),
    "exact": (90,),
    "smooth": (51,),
    "ahead": (80,),
    "machine": (530,),
    "dwell": (40,),
    "skip": (310,),
    "once": (100, 280, 300, 520, 650, 920, 921),
}
"""Group "once": not modal, and its axis words are not a place to go to. The names of the others are those of `modal.Modal`."""

GROUPS: Final[Mapping[int, str]] = {code: group for group, codes in BY_GROUP.items() for code in codes}

M_CODES: Final = frozenset({0, 1, 2, 3, 4, 5, 6, 7, 8, 9, 19, 29, 30, 98, 99})


def written(tenths: int) -> str:
    """A code as a programmer writes it.

    >>> written(541), written(30)
    ('G54.1', 'G3')
    """
    return f"G{tenths // 10}.{tenths % 10}" if tenths % 10 else f"G{tenths // 10}"
