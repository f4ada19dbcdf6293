"""Alarms in the day of a simulated control: each stops the machine for a while, and what would have come then comes later."""

from collections.abc import Iterable, Iterator
from dataclasses import dataclass, replace

from cnctwin.standins.simulated_control.state import ControlState

STANDS_S = 30.0


@dataclass(frozen=True, slots=True)
class RaisedAlarm:
    """An alarm, and how many seconds of work pass before it comes each time."""

    every_s: float
    number: int
    text: str
    stands_s: float = STANDS_S


def with_alarms(shown: Iterable[ControlState], alarm: RaisedAlarm) -> Iterator[ControlState]:
    """Yield the same day with the alarm in it; a machine that it stops turns no spindle and moves no axis.

    >>> day = (ControlState(at_s, "ACTIVE", spindle_rpm=8500.0) for at_s in (9.0, 11.0))
    >>> [(s.at_s, s.spindle_rpm, s.alarm) for s in with_alarms(day, RaisedAlarm(10.0, 1012, "NO OIL", stands_s=5.0))]
    [(9.0, 8500.0, None), (10.0, 0.0, (1012, 'NO OIL')), (15.0, 8500.0, None), (16.0, 8500.0, None)]
    """
    before, later_s, due_s = ControlState(), 0.0, alarm.every_s
    for state in shown:
        while state.at_s + later_s >= due_s:
            yield replace(_stopped(before), at_s=due_s, alarm=(alarm.number, alarm.text))
            yield replace(before, at_s=due_s + alarm.stands_s)
            later_s += alarm.stands_s
            due_s += alarm.stands_s + alarm.every_s
        before = replace(state, at_s=state.at_s + later_s)
        yield before


def _stopped(state: ControlState) -> ControlState:
    still = (0.0,) * len(state.axis_load_pct)
    return replace(
        state, exec_state="STOPPED", spindle_rpm=0.0, spindle_load_pct=0.0, feed_mm_min=0.0, axis_load_pct=still, coolant_on=False
    )
