"""Quiet hours: times of the week, by the clock on the wall of the shop, in which only high alerts are told at once."""

import re
from datetime import UTC, datetime, timedelta
from functools import lru_cache
from typing import Annotated, Self
from zoneinfo import ZoneInfo

from pydantic import AfterValidator, BaseModel, ConfigDict, field_validator, model_validator

DAYS = ("mon", "tue", "wed", "thu", "fri", "sat", "sun")
_CLOCK = re.compile(r"([01]\d|2[0-3]):([0-5]\d)")


def _known(name: str) -> str:
    try:
        _zone(name)
    except Exception as error:
        raise ValueError(f"no time zone {name!r}; name one as Europe/Berlin, or UTC") from error
    return name


TimeZone = Annotated[str, AfterValidator(_known)]


class QuietHours(BaseModel):
    """The hours from one time of day to another, past midnight where the end is not after the start; the day is the start's."""

    model_config = ConfigDict(extra="forbid", frozen=True)

    time_zone: TimeZone
    start: str
    end: str
    days: tuple[str, ...] = DAYS
    receivers: tuple[str, ...] = ()  # none named: all

    @field_validator("start", "end")
    @classmethod
    def _is_a_time(cls, text: str) -> str:
        if not _CLOCK.fullmatch(text):
            raise ValueError(f"{text!r} is no time of the day; write it as 22:00")
        return text

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
        local = datetime.fromtimestamp(wall_s, UTC).astimezone(_zone(self.time_zone))
        now, start, end = local.hour * 60 + local.minute, _minutes(self.start), _minutes(self.end)
        today, yesterday = DAYS[local.weekday()], DAYS[(local - timedelta(days=1)).weekday()]
        if start < end:
            return start <= now < end and today in self.days
        return (now >= start and today in self.days) or (now < end and yesterday in self.days)


@lru_cache(maxsize=64)
def _zone(name: str) -> ZoneInfo:
    return ZoneInfo(name)


def _minutes(clock: str) -> int:
    hours, minutes = clock.split(":")
    return int(hours) * 60 + int(minutes)
