"""Time stamps as adapters write them: UTC, 0 to 9 fractional digits, `2022-08-08T13:51:34.7167146Z`."""

import re
from datetime import UTC, datetime
from typing import NamedTuple

_STAMP = re.compile(r"(\d{4}-\d\d-\d\dT\d\d:\d\d:\d\d)(?:\.(\d{1,9}))?Z?", re.ASCII)


class Stamp(NamedTuple):
    """A stamp as it was recorded, and the same moment in seconds since 1970."""

    text: str
    seconds: float


def read_stamp(text: str) -> Stamp | None:
    """Return the stamp, or None where the text is none.

    >>> read_stamp("1970-01-01T00:01:00.25Z")
    Stamp(text='1970-01-01T00:01:00.25Z', seconds=60.25)
    >>> read_stamp("20175") is None
    True
    """
    match = _STAMP.fullmatch(text)
    if match is None:
        return None
    try:
        whole = datetime.fromisoformat(match[1]).replace(tzinfo=UTC).timestamp()
    except ValueError:  # the thirteenth month
        return None
    return Stamp(text, whole + (float(f"0.{match[2]}") if match[2] else 0.0))


def microsecond_text(text: str) -> str:
    """Write a recorded stamp as agent 2.x does: cut to microseconds, no trailing zeros.

    >>> microsecond_text("2022-08-08T13:51:34.7160006Z")
    '2022-08-08T13:51:34.716Z'
    """
    whole, _, fraction = text.removesuffix("Z").partition(".")
    fraction = fraction[:6].rstrip("0")
    return f"{whole}.{fraction}Z" if fraction else f"{whole}Z"


def stamp_text(seconds: float) -> str:
    """Write a moment as the agent's own stamps are written.

    >>> stamp_text(60.25)
    '1970-01-01T00:01:00.25Z'
    """
    return microsecond_text(datetime.fromtimestamp(seconds, UTC).strftime("%Y-%m-%dT%H:%M:%S.%fZ"))


def whole_second_text(seconds: float) -> str:
    """Write a moment as header stamps are written, to the second.

    >>> whole_second_text(60.25)
    '1970-01-01T00:01:00Z'
    """
    return datetime.fromtimestamp(seconds, UTC).strftime("%Y-%m-%dT%H:%M:%SZ")
