"""The settings of the wear model. Levels are natural logarithms of load ratios, so 0.05 is about 5 %."""

from typing import NamedTuple


class Terms(NamedTuple):
    """wear_limit: the level at which a tool is spent, before two lives have told it; None = not configured

    material: standard deviation of the load from one batch to another; part: from one part to the next within a batch sharp:
    standard deviation from one sharp tool to another uses_min: of a tool, before parts left are given; fast: the least ratio to
    earlier lives at which a tool wears too fast (twin/wear/fast.py)
    """

    wear_limit: float | None = None
    material: float = 0.05
    part: float = 0.005
    sharp: float = 0.02
    uses_min: int = 8
    fast: float = 2.0
