"""Which shift a machine is in at a moment, and whether the moment is planned: a pure function of a calendar and a time.

Shifts are written by the clock on the wall and counted in real seconds: in the night in which the clocks go forward a shift of
eight hours lasts seven. A time that the clock jumps over is the moment of the jump; one that comes twice is its first.
"""

from collections.abc import Iterator
from dataclasses import dataclass, field
from datetime import UTC, date, datetime, timedelta
from typing import NamedTuple
from zoneinfo import ZoneInfo

from processors.production.calendar_file import DAY_MIN, CalendarFile
from processors.wall_clock import minutes, zone

DAY_S = 86_400.0
DAYS_KEPT = 4000


class Slot(NamedTuple):
    """A stretch of time in which nothing of the calendar changes.

    shift: its name, None outside all shifts; begin_s, end_s: of the shift, or of the time without one within a day; until_s: the
    end of the stretch: of the shift, or where a break begins or ends; is_planned: in a shift and in no break
    """

    shift: str | None
    begin_s: float
    end_s: float
    until_s: float
    is_planned: bool


class ShiftTime(NamedTuple):
    """A shift of one date, in seconds since 1970."""

    shift: str
    begin_s: float
    end_s: float
    breaks: tuple[tuple[float, float], ...]


@dataclass(frozen=True, eq=False)
class Calendar:
    """See the module. The dates that were worked out are remembered, up to a bound; that changes no answer."""

    file: CalendarFile
    _known: dict[tuple[str, date], tuple[ShiftTime, ...]] = field(default_factory=dict, repr=False)

    def slot_at(self, machine: str, at_s: float) -> Slot:
        """Return the slot of a machine that holds a moment: its begin belongs to it, its end to the next one."""
        local = zone(self.file.time_zone)
        day = datetime.fromtimestamp(at_s, UTC).astimezone(local).date()
        begin_s, end_s = _instant_s(local, day, 0), _instant_s(local, day, DAY_MIN)
        for shift in self._around(machine, day):
            if shift.begin_s <= at_s < shift.end_s:
                return _within(shift, at_s)
            if shift.end_s <= at_s:
                begin_s = max(begin_s, shift.end_s)
            else:
                end_s = min(end_s, shift.begin_s)
        return Slot(None, begin_s, end_s, end_s, is_planned=False)

    def shifts(self, machine: str, from_s: float, to_s: float) -> Iterator[ShiftTime]:
        """Yield the shifts of a machine that begin in [from_s, to_s), oldest first."""
        local = zone(self.file.time_zone)
        day = datetime.fromtimestamp(from_s, UTC).astimezone(local).date() - timedelta(days=1)
        while _instant_s(local, day, 0) < to_s:
            yield from (one for one in self.on(machine, day) if from_s <= one.begin_s < to_s)
            day += timedelta(days=1)

    def on(self, machine: str, day: date) -> tuple[ShiftTime, ...]:
        """Return the shifts of a machine that begin on a date, oldest first; one that a jump swallows is left out."""
        key = (machine, day)
        known = self._known.get(key)
        if known is None:
            if len(self._known) >= DAYS_KEPT:
                self._known.clear()
            known = self._known[key] = tuple(sorted(self._made(machine, day), key=lambda one: one.begin_s))
        return known

    def _around(self, machine: str, day: date) -> tuple[ShiftTime, ...]:
        """Return the shifts that can reach into a date: a shift is a day long at the most."""
        before, after = day - timedelta(days=1), day + timedelta(days=1)
        return self.on(machine, before) + self.on(machine, day) + self.on(machine, after)

    def _made(self, machine: str, day: date) -> Iterator[ShiftTime]:
        local = zone(self.file.time_zone)
        for name in self.file.shifts_on(machine, day):
            shift = self.file.shifts[name]
            start = minutes(shift.start)
            begin_s, end_s = (_instant_s(local, day, start + offset) for offset in (0, shift.length_min))
            spans = sorted((_instant_s(local, day, start + a), _instant_s(local, day, start + b)) for a, b in shift.pauses_min)
            if begin_s < end_s:
                yield ShiftTime(name, begin_s, end_s, tuple(span for span in spans if span[0] < span[1]))


def day_slot(at_s: float) -> Slot:
    """Return the slot where there is no calendar: the day in UTC, of which nobody has said when work is planned.

    >>> day_slot(90_000.0)
    Slot(shift=None, begin_s=86400.0, end_s=172800.0, until_s=172800.0, is_planned=False)
    """
    begin_s = at_s // DAY_S * DAY_S
    return Slot(None, begin_s, begin_s + DAY_S, begin_s + DAY_S, is_planned=False)


def _within(shift: ShiftTime, at_s: float) -> Slot:
    until_s, is_planned = shift.end_s, True
    for begin_s, end_s in shift.breaks:
        if begin_s <= at_s < end_s:
            until_s, is_planned = end_s, False
            break
        if at_s < begin_s:
            until_s = begin_s
            break
    return Slot(shift.shift, shift.begin_s, shift.end_s, until_s, is_planned)


def _instant_s(local: ZoneInfo, day: date, clock_min: int) -> float:
    """Return the moment at which the clock shows so many minutes since the midnight that began a date.

    >>> berlin = ZoneInfo("Europe/Berlin")
    >>> [_instant_s(berlin, date(2026, 3, 29), 60 * hour) / 3600 % 24 for hour in (1, 2, 3, 4)]
    [0.0, 1.0, 1.0, 2.0]
    """
    shown = datetime(day.year, day.month, day.day) + timedelta(minutes=clock_min)  # noqa: DTZ001 — of the clock on the wall
    first_s = shown.replace(tzinfo=local, fold=0).timestamp()
    second_s = shown.replace(tzinfo=local, fold=1).timestamp()
    if second_s >= first_s:
        return first_s
    low_s, high_s = int(second_s), int(first_s)  # the clock never shows it: between these two it jumps
    after = _offset(local, high_s)
    while high_s - low_s > 1:
        middle_s = (low_s + high_s) // 2
        low_s, high_s = (low_s, middle_s) if _offset(local, middle_s) == after else (middle_s, high_s)
    return float(high_s)


def _offset(local: ZoneInfo, at_s: int) -> timedelta | None:
    return datetime.fromtimestamp(at_s, UTC).astimezone(local).utcoffset()
