"""The clock on the wall of a shop, in configuration: the days of the week, a time zone by its name, a time of the day."""

import re
from functools import lru_cache
from typing import Annotated
from zoneinfo import ZoneInfo

from pydantic import AfterValidator

DAYS = ("mon", "tue", "wed", "thu", "fri", "sat", "sun")
_CLOCK = re.compile(r"([01]\d|2[0-3]):([0-5]\d)")


def _known_zone(name: str) -> str:
    try:
        zone(name)
    except Exception as error:
        raise ValueError(f"no time zone {name!r}; name one as Europe/Berlin, or UTC") from error
    return name


def _time_of_day(text: str) -> str:
    if not _CLOCK.fullmatch(text):
        raise ValueError(f"{text!r} is no time of the day; write it as 22:00")
    return text


TimeZoneName = Annotated[str, AfterValidator(_known_zone)]
TimeOfDay = Annotated[str, AfterValidator(_time_of_day)]


@lru_cache(maxsize=64)
def zone(name: str) -> ZoneInfo:
    """Return a time zone by its name. Raises where there is none of this name."""
    return ZoneInfo(name)


def minutes(clock: str) -> int:
    """Return the minutes of a time of the day since midnight.

    >>> minutes("22:30")
    1350
    """
    hours, rest = clock.split(":")
    return int(hours) * 60 + int(rest)
