"""Events found and alerts that were none.

An alert is the moment at which an alarm comes on. It finds an event where it falls into it, or within `grace_s` after its end.
One that falls into no event, nor into `wake_s` after one, is false: in the wake of an event the machine is not yet as it was.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple

from benchmarks.evaluation.intervals import rate, share
from twin.intervals import Estimate

WEEK_S = 604_800.0


class Event(NamedTuple):
    """Something was really wrong, from start to end, s."""

    start_s: float
    end_s: float


@dataclass(frozen=True, slots=True)
class Detections:
    """delays_s: of each event, None where it was not found; false: alerts in no event; quiet_s: time in which one is false"""

    delays_s: tuple[float | None, ...]
    false: int
    quiet_s: float

    @property
    def hits(self) -> int:
        """Events that were found."""
        return sum(delay is not None for delay in self.delays_s)


def detections(
    events: Sequence[Event], alerts_s: Sequence[float], duration_s: float, grace_s: float = 60.0, wake_s: float = 300.0
) -> Detections:
    """Return the detections on one machine, from 0 to duration_s.

    >>> detections([Event(100.0, 200.0), Event(500.0, 600.0)], [130.0, 150.0, 900.0], 1000.0, wake_s=0.0)
    Detections(delays_s=(30.0, None), false=1, quiet_s=800.0)
    """
    delays = tuple(
        next((alert - event.start_s for alert in sorted(alerts_s) if event.start_s <= alert <= event.end_s + grace_s), None)
        for event in events
    )
    false = sum(not any(event.start_s <= alert <= event.end_s + max(grace_s, wake_s) for event in events) for alert in alerts_s)
    return Detections(delays, false, duration_s - _covered_s(events, wake_s, duration_s))


def _covered_s(events: Sequence[Event], wake_s: float, duration_s: float) -> float:
    covered, reached = 0.0, 0.0
    for event in sorted(events):
        end_s = min(event.end_s + wake_s, duration_s)
        covered += max(0.0, end_s - max(event.start_s, reached))
        reached = max(reached, end_s)
    return covered


def recall(parts: Sequence[Detections]) -> Estimate:
    """Share of the events that were found."""
    return share(sum(part.hits for part in parts), sum(len(part.delays_s) for part in parts))


def false_alerts_a_week(parts: Sequence[Detections]) -> Estimate:
    """Alerts in no event, by machine-week outside of events."""
    return rate(sum(part.false for part in parts), sum(part.quiet_s for part in parts) / WEEK_S)


def delays_s(parts: Sequence[Detections]) -> list[float]:
    """Return the delays of the events that were found."""
    return [delay for part in parts for delay in part.delays_s if delay is not None]
