"""A machine followed through its parts: its residuals at each tick, on every time scale, and where it is in its part."""

from twin.anomaly.parts.model import PartsModel
from twin.anomaly.parts.own import Own
from twin.anomaly.parts.told import Told


def told_after(model: PartsModel, own: Own, told: Told) -> Own:
    """Return the state after one more tick; a gated one tells nothing of the cut."""
    return own._replace(tick=told.tick, program=told.program, tool=told.tool, line=told.line)
