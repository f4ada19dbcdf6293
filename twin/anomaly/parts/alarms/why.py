"""The reason of an alarm: which signal, where in the program, how far from what was expected, and what it looks like."""

import json
from typing import NamedTuple


class Like(NamedTuple):
    """An earlier alarm that a person has put a name to; likeness: 0 to 1."""

    label: str
    likeness: float
    at_s: float


class Why(NamedTuple):
    """scale: "seconds", "cut", "part" or "tool"; lines: first and last of the section, None where the control tells none
    measured, expected: in `unit`, over the scale; spreads: how many of what repeats lie between them
    since_s: how long it has been so; by: what the expectation rests on, as "12 parts" or "the twin"
    like: the nearest earlier alarms with a name; peers: machines that show it too
    """

    signal: str
    scale: str
    program: str | None
    tool: int | None
    lines: tuple[int, int] | None
    section: int
    measured: float
    expected: float
    unit: str | None
    spreads: float
    since_s: float
    by: str
    like: tuple[Like, ...] = ()
    peers: tuple[str, ...] = ()

    def in_json(self) -> str:
        """Return the JSON text that is published."""
        fields = self._asdict()
        fields["like"] = [like._asdict() for like in self.like]
        return json.dumps(fields, separators=(",", ":"), allow_nan=False)
