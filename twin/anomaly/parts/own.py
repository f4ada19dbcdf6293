"""The state of one machine between two ticks; all of it is JSON-able and bounded."""

from typing import NamedTuple

from twin.anomaly.parts.episodes import Memory
from twin.anomaly.parts.model import PartsModel

NEVER = -(10**12)


class Own(NamedTuple):
    """tick: the last one told; program, tool, line: as last told; part: how many parts of the program have begun
    memory: the alarms that are remembered, and what people have said of them
    """

    tick: int = NEVER
    program: str | None = None
    tool: int | None = None
    line: int | None = None
    part: int = 0
    memory: Memory = Memory()


def begun(model: PartsModel) -> Own:
    """Return the state of a machine before anything was told."""
    return Own()
