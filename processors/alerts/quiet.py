"""Quiet hours: times of the week, by the clock on the wall of the shop, in which only high alerts are told at once."""

from datetime import UTC, datetime, timedelta
from typing import Self

from pydantic import BaseModel, ConfigDict, model_validator

from processors.wall_clock import DAYS, TimeOfDay, TimeZoneName, minutes, zone


class QuietHours(BaseModel):
    """The hours from one time of day to another, past midnight where the end is not after the start; the day is the start's."""

    model_config = ConfigDict(extra="forbid", frozen=True)

    time_zone: TimeZoneName
    start: TimeOfDay
    end: TimeOfDay
    days: tuple[str, ...] = DAYS
    receivers: tuple[str, ...] = ()  # none named: all

    @model_validator(mode="after")
    def _has_days(self) -> Self:
        if not self.days or set(self.days) - set(DAYS):
            raise ValueError(f"days {list(self.days)} have to be some of {', '.join(DAYS)}")
        if self.start == self.end:
            raise ValueError(f"start and end are both {self.start}: for a whole day write 00:00 to 23:59, or a silence")
        return self

    def holds(self, receiver: str, wall_s: float) -> bool:
        """Return True if it is quiet for this receiver.

        >>> night = QuietHours(time_zone="Europe/Berlin", start="22:00", end="06:00", days=("fri",))
        >>> friday = datetime(2026, 11, 20, tzinfo=UTC).timestamp()
        >>> [night.holds("phone", friday + 3600.0 * hours) for hours in (22, 28, 29)]
        [True, True, False]
        """
        if self.receivers and receiver not in self.receivers:
            return False
        local = datetime.fromtimestamp(wall_s, UTC).astimezone(zone(self.time_zone))
        now, start, end = local.hour * 60 + local.minute, minutes(self.start), minutes(self.end)
        today, yesterday = DAYS[local.weekday()], DAYS[(local - timedelta(days=1)).weekday()]
        if start < end:
            return start <= now < end and today in self.days
        return (now >= start and today in self.days) or (now < end and yesterday in self.days)
