"""Scores of the machines of a cell, put side by side as of the same moment.

Each machine ticks by its own control, and the messages of one may come later than those of another. Machines are in step while
their last ticks lie within `wait_ticks` of each other; where not all do, as many as can. A frame is judged when all machines that
are in step have come to its tick (and further by the look-back of the gate), whatever the order in which they came. Nobody waits
for a machine that is out of step; its scores are judged alone.
"""

from bisect import bisect_right
from collections.abc import Collection, Mapping
from typing import NamedTuple

from processors.joint_anomaly.gate import Gated
from processors.joint_anomaly.moment import Moment
from twin.anomaly.preparation import Standardised

NEVER = -(2**62)


class Scored(NamedTuple):
    """A raw score of tick number `tick`, at `at_s` of the machine's own clock; None with the reason where there is none.

    now: the features beside what is usual, where the model knows that
    moment: what the machine told at this tick, where parts are compared; the raw score is known later then
    """

    tick: int
    at_s: float
    raw: float | None
    reason: str | None = None
    now: Standardised | None = None
    moment: Moment | None = None


Ready = tuple[Scored, Gated]
Frame = dict[str, Ready]


class InStep(NamedTuple):
    """The machines whose last tick is in `first` … `last`; `behind` of them are at `first`, which all have come to."""

    first: int = NEVER
    last: int = NEVER
    behind: int = 0

    def moved(self, before: int | None, tick: int) -> "InStep | None":
        """Return who is in step after a machine has come from tick `before` to `tick`; None = that is to be found again, since a
        frame is complete, or the machine joins or leaves.

        >>> InStep(first=100, last=105, behind=2).moved(100, 101)
        InStep(first=100, last=105, behind=1)
        """
        if before is None or before < self.first <= tick or before <= self.last < tick:
            return None
        if before != self.first:
            return self
        return InStep(self.first, self.last, self.behind - 1) if self.behind > 1 else None

    def has(self, tick: int | None) -> bool:
        """Return True if a machine that has come to `tick` is in step."""
        return tick is not None and self.first <= tick <= self.last


def in_step(ticks: Collection[int], wait_ticks: int) -> InStep:
    """Find who is in step, by the last ticks of all machines: as many as lie within `wait_ticks`, the latest of those.

    Three machines are at 100, 101 and 103, a fourth is an hour ahead:

    >>> in_step([103, 100, 101, 3700], 5)
    InStep(first=100, last=105, behind=1)
    """
    if not ticks:
        return InStep()
    first = min(ticks)
    if max(ticks) - first > wait_ticks:
        ordered = sorted(ticks)
        _, first = max((bisect_right(ordered, tick + wait_ticks) - place, tick) for place, tick in enumerate(ordered))
    return InStep(first, first + wait_ticks, sum(tick == first for tick in ticks))


def frames(ready: Mapping[str, tuple[Ready, ...]], step: InStep, look_back_ticks: int) -> list[Frame]:
    """Return the frames of waiting scores that can be judged, side by side by tick, oldest first: what all who are in step have
    come to, and all scores of a machine whose clock is ahead of theirs."""
    found: dict[int, Frame] = {}
    up_to, last = step.first - look_back_ticks, step.last - look_back_ticks
    for machine, waiting in ready.items():
        is_ahead = waiting[-1][0].tick > last
        for one in waiting:
            tick = one[0].tick
            if tick > up_to and not is_ahead:
                break
            found.setdefault(tick, {})[machine] = one
    return [found[tick] for tick in sorted(found)]
