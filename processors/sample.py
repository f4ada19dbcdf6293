"""The input of a fold: one message of one machine, or a moment at which none came."""

import math
from collections.abc import Mapping
from enum import Enum
from types import MappingProxyType
from typing import NamedTuple

from sparkplug.metric import Reading
from sparkplug.quality import Quality


class SampleKind(Enum):
    """Why the fold is called."""

    DATA = "data"  # something changed
    TICK = "tick"  # event time reached a multiple of tick_s
    BIRTH = "birth"  # the machine's edge came online, the row is complete
    DEATH = "death"  # an edge of the machine went offline, its part of the row is stale
    HOLE = "hole"  # messages were lost, or event time jumped; gap_s says how far
    PLAIN = "plain"  # a plain message that a cell's processor listens to; of no machine
    BEAT = "beat"  # a second has passed on the wall; of no machine


_GOOD = Quality.GOOD
"""Looked up once: a member of an enumeration takes longer to look up than a whole reading."""


class Sample(NamedTuple):
    """One call of the fold.

    at_s: event time, s since 1970 (UTC). It never goes back, except at a HOLE.
    row: the last known reading of each input, as of now. A view: valid during the step only, not to be kept.
    changed: names in the row that this message set
    gap_s: at a HOLE, how much event time was jumped over, forwards or backwards; 0 where it is not known
    is_history: an edge sends late what it had buffered; such samples fold into a state of their own
    cell: the rows of all machines of the cell that are online, where the fold is a cell's; at the DEATH of its last edge
        the machine is not among them
    topic: of a PLAIN message; its text is in `detail`
    """

    machine: str
    kind: SampleKind
    at_s: float
    row: Mapping[str, Reading]
    changed: tuple[str, ...] = ()
    gap_s: float = 0.0
    detail: str = ""
    is_history: bool = False
    cell: Mapping[str, Mapping[str, Reading]] = MappingProxyType({})
    topic: str = ""

    def number(self, name: str) -> tuple[float | None, str | None]:
        """The value of `name` as (number, None), or (None, reason) where there is no number to go by.

        >>> Sample("vmc", SampleKind.TICK, 0.0, {}).number("spindle_rpm")
        (None, 'spindle_rpm is not offered')
        """
        reading = self.row.get(name)
        if reading is None:
            return None, f"{name} is not offered"
        value = reading.value
        if type(value) is float and reading.quality is _GOOD and -math.inf < value < math.inf:
            return value, None  # what nearly every reading is
        if (reason := why_unknown(reading)) is not None:
            return None, reason
        if isinstance(value, bool) or not isinstance(value, (int, float)):
            return None, f"{name} is not a number"
        try:
            number = float(value)
        except OverflowError:
            return None, f"{name} is beyond any number"
        return (number, None) if math.isfinite(number) else (None, f"{name} is {number}")


def why_unknown(reading: Reading) -> str | None:
    """Why a reading says nothing of the present: stale, bad or null; None where it does."""
    if reading.quality is not _GOOD:
        word = "stale" if reading.quality is Quality.STALE else "bad"
    elif reading.value is None:
        word = "null"
    else:
        return None
    return f"{reading.name} is {word}: {reading.reason}" if reading.reason else f"{reading.name} is {word}"
