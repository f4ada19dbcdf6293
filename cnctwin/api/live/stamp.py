"""Stamps that can be times. The gate of the host session keeps others out; the live plant holds where one comes all the same."""

from sparkplug.metric import Reading
from sparkplug.quality import Quality

STAMP_MS_MAX = 32_503_680_000_000  # the year 3000


def is_time(stamp_ms: int) -> bool:
    """Return True if a stamp is a time between 1970 and the year 3000.

    >>> is_time(1_795_305_600_000), is_time(2**63), is_time(-1)
    (True, False, False)
    """
    return 0 <= stamp_ms <= STAMP_MS_MAX


def without_time(reading: Reading, now_ms: int) -> Reading:
    """Return what is shown of a reading whose stamp is no time: no value, now, and the reason."""
    reason = f"kept out: its stamp {reading.timestamp_ms} ms lies outside the years 1970 to 3000"
    return reading._replace(value=None, timestamp_ms=now_ms, quality=Quality.BAD, reason=reason)
