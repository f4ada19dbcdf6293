"""Scores of the machines of a cell, put side by side as of the same moment.

Each machine ticks by its own control, and the messages of one may come later than those of another. A score waits until all
machines that are in step have come to its tick, and for the look-back of the gate; then the frame of that tick is judged. A
machine whose clock is further than `wait_ticks` from that of most is out of step: nobody waits for it, its frames are its own.
"""

from collections.abc import Mapping
from typing import NamedTuple

PENDING_MAX = 20_000  # scores of one machine that wait


class Scored(NamedTuple):
    """A raw score of tick number `tick`, at `at_s` of the machine's own clock; None with the reason where there is none."""

    tick: int
    at_s: float
    raw: float | None
    reason: str | None = None


Pending = tuple[Scored, ...]


def limits(last_ticks: Mapping[str, int], wait_ticks: int, look_back_ticks: int) -> dict[str, int]:
    """By machine, the tick up to which its scores are judged, of the ticks that the machines have come to.

    Three machines are at 100, 101 and 103, a fourth is an hour behind:

    >>> limits({"a": 103, "b": 100, "c": 101, "d": -3500}, 5, 10)
    {'a': 90, 'b': 90, 'c': 90, 'd': -3510}
    """
    ordered = sorted(last_ticks.values())
    middle = ordered[(len(ordered) - 1) // 2]
    first = next(tick for tick in ordered if tick >= middle - wait_ticks)
    return {
        machine: (first if abs(tick - middle) <= wait_ticks else tick) - look_back_ticks for machine, tick in last_ticks.items()
    }


def frames(pending: Mapping[str, Pending], limit: Mapping[str, int]) -> list[dict[str, Scored]]:
    """The scores up to the limit of each machine, side by side by tick, oldest first."""
    found: dict[int, dict[str, Scored]] = {}
    for machine, waiting in pending.items():
        up_to = limit[machine]
        for scored in waiting:
            if scored.tick > up_to:
                break
            found.setdefault(scored.tick, {})[machine] = scored
    return [found[tick] for tick in sorted(found)]
