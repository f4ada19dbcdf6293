"""The shift calendar as a plant writes it: a TOML file, a typed model, checked before anything is read or computed.

time_zone = "Europe/Berlin"
holidays = ["2026-12-25", "2026-12-26"]

[shifts.early]
start = "06:00"
end = "14:00"
breaks = [["09:00", "09:15"], ["12:00", "12:30"]]

[[exceptions]]
date = "2026-12-19"
shifts = ["early"]
"""

import tomllib
from datetime import date, timedelta
from itertools import pairwise
from pathlib import Path
from typing import Self

from pydantic import BaseModel, ConfigDict, Field, ValidationError, model_validator

from processors.wall_clock import DAYS, TimeOfDay, TimeZoneName, minutes
from twin.vocabulary.faults import faults_of, report

DAY_MIN = 1440
BYTES_MAX = 1_000_000
WORKING_DAYS = DAYS[:5]


class Shift(BaseModel):
    """A shift by the clock on the wall. It belongs to the day on which it begins; `end` not after `start` is on the next day.

    breaks: from and to, within the shift; they are no planned time
    """

    model_config = ConfigDict(extra="forbid", frozen=True)

    start: TimeOfDay
    end: TimeOfDay
    days: tuple[str, ...] = WORKING_DAYS
    breaks: tuple[tuple[TimeOfDay, TimeOfDay], ...] = Field(default=(), max_length=20)

    @model_validator(mode="after")
    def _is_in_order(self) -> Self:
        if set(self.days) - set(DAYS):
            raise ValueError(f"days {list(self.days)} have to be some of {', '.join(DAYS)}")
        pauses = self.pauses_min
        for (begin, end), text in zip(pauses, self.breaks, strict=True):
            if not 0 <= begin < end <= self.length_min:
                raise ValueError(f"break {text[0]} to {text[1]} is not within {self.start} to {self.end}")
        for before, after in pairwise(sorted(pauses)):
            if after[0] < before[1]:
                raise ValueError(f"breaks {[list(one) for one in self.breaks]} overlap")
        return self

    @property
    def length_min(self) -> int:
        """The minutes from start to end by the clock; a whole day where they are the same."""
        return (minutes(self.end) - minutes(self.start)) % DAY_MIN or DAY_MIN

    @property
    def pauses_min(self) -> tuple[tuple[int, int], ...]:
        """Begin and end of each break, in minutes since the start of the shift."""
        start = minutes(self.start)
        return tuple(
            (begin, begin + ((minutes(text[1]) - minutes(text[0])) % DAY_MIN or DAY_MIN))
            for text in self.breaks
            for begin in ((minutes(text[0]) - start) % DAY_MIN,)
        )


class DayException(BaseModel):
    """A date on which other shifts run than on that day of the week: `shifts` empty = closed. machines empty = all."""

    model_config = ConfigDict(extra="forbid", frozen=True)

    date: date
    shifts: tuple[str, ...]
    machines: tuple[str, ...] = ()
    reason: str = Field(default="", max_length=200)


class OfMachine(BaseModel):
    """The shifts that a machine works, None = all; and whether it works on holidays too."""

    model_config = ConfigDict(extra="forbid", frozen=True)

    shifts: tuple[str, ...] | None = None
    works_on_holidays: bool = False


class CalendarFile(BaseModel):
    """The file as a whole."""

    model_config = ConfigDict(extra="forbid", frozen=True)

    time_zone: TimeZoneName
    shifts: dict[str, Shift] = Field(min_length=1, max_length=50)
    holidays: tuple[date, ...] = Field(default=(), max_length=5000)
    exceptions: tuple[DayException, ...] = Field(default=(), max_length=5000)
    machines: dict[str, OfMachine] = Field(default_factory=dict, max_length=2000)

    @model_validator(mode="after")
    def _names_are_known(self) -> Self:
        named = [(f"exceptions[{n}] of {one.date}", one.shifts) for n, one in enumerate(self.exceptions)]
        named += [(f"machines.{name}", own.shifts or ()) for name, own in self.machines.items()]
        for where, shifts in named:
            for name in shifts:
                if name not in self.shifts:
                    raise ValueError(f"{where}: there is no shift {name!r}; there are: {', '.join(self.shifts)}")
        return self

    @model_validator(mode="after")
    def _shifts_do_not_overlap(self) -> Self:
        """A moment belongs to at most one shift of a machine, in every week and around every exception."""
        named = {name for one in self.exceptions for name in one.machines}
        for machine in ("", *self.machines, *sorted(named - set(self.machines))):
            self._check_week(machine)
            for one in self.exceptions:
                if not one.machines or machine in one.machines:
                    self._check_date(machine, one.date)
        return self

    def _check_week(self, machine: str) -> None:
        spans = [
            (day * DAY_MIN + minutes(shift.start), day * DAY_MIN + minutes(shift.start) + shift.length_min, name)
            for day in range(8)  # the eighth is the first again
            for name, shift in self._of(machine).items()
            if DAYS[day % 7] in shift.days
        ]
        _refuse_overlap(spans, machine, "")

    def _check_date(self, machine: str, day: date) -> None:
        spans = [
            (n * DAY_MIN + minutes(shift.start), n * DAY_MIN + minutes(shift.start) + shift.length_min, name)
            for n in (-1, 0, 1)
            for name in self.shifts_on(machine, day + timedelta(days=n))
            for shift in (self.shifts[name],)
        ]
        _refuse_overlap(spans, machine, f" on {day}")

    def _of(self, machine: str) -> dict[str, Shift]:
        own = self.machines.get(machine)
        allowed = None if own is None else own.shifts
        return {name: shift for name, shift in self.shifts.items() if allowed is None or name in allowed}

    def shifts_on(self, machine: str, day: date) -> tuple[str, ...]:
        """Return the shifts of a machine that begin on a date, in the order of the file.

        An exception goes before everything, one that names the machine before one for all; then a holiday; then the week.
        """
        special = [one for one in self.exceptions if one.date == day and (not one.machines or machine in one.machines)]
        if special:
            chosen = next((one for one in special if one.machines), special[0])
            return tuple(name for name in self.shifts if name in chosen.shifts)
        own = self.machines.get(machine)
        if day in self.holidays and not (own is not None and own.works_on_holidays):
            return ()
        return tuple(name for name, shift in self._of(machine).items() if DAYS[day.weekday()] in shift.days)


def _refuse_overlap(spans: list[tuple[int, int, str]], machine: str, when: str) -> None:
    for before, after in pairwise(sorted(spans)):
        if after[0] < before[1]:
            whose = f" of {machine}" if machine else ""
            raise ValueError(
                f"shifts {before[2]!r} and {after[2]!r}{whose} overlap{when}; a moment belongs to one shift at the most"
            )


def read_calendar_file(path: Path) -> CalendarFile:
    """Return the calendar in a file. Raises ValueError, with a line for each fault that names key and value."""
    try:
        size = path.stat().st_size
        if size > BYTES_MAX:
            raise ValueError(f"calendar {path} has {size} bytes; at most {BYTES_MAX} are read")
        table = tomllib.loads(path.read_text(encoding="utf-8"))
    except OSError as error:
        raise ValueError(f"calendar {path}: {error.strerror or error}; name a readable TOML file") from None
    except (tomllib.TOMLDecodeError, UnicodeDecodeError) as error:
        raise ValueError(f"calendar {path} is no TOML: {error}") from None
    try:
        return CalendarFile.model_validate(table)
    except ValidationError as error:
        faults = faults_of([dict(fault) for fault in error.errors(include_url=False)], CalendarFile)
        raise ValueError(report(f"calendar {path}", faults)) from None
