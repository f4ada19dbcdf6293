"""The engagement of one tool along one path in a stock that nothing has cut before."""

from numpy.typing import ArrayLike

from twin.engagement import Engagement, Workpiece, cut
from twin.engagement.along_path import CELLS_PER_DIAMETER
from twin.machine import Stock


def engagement(
    points_mm: ArrayLike,
    tool_diameter_mm: float,
    stock: Stock | None,
    resolution_mm: float = 0.1,
    cutting: ArrayLike | None = None,
) -> Engagement:
    """Parameters as of `cut`; stock: None = nothing to cut."""
    workpiece = Workpiece.of(stock, tool_diameter_mm / CELLS_PER_DIAMETER)
    return cut(workpiece, points_mm, tool_diameter_mm, resolution_mm, cutting)[1]
