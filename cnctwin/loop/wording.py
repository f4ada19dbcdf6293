"""The loop in words: what a promotion has changed, since when; gaps in floors, times in hours."""

from datetime import datetime, tzinfo

from cnctwin.loop.state import Last


def promotion(last: Last, zone: tzinfo | None = None, *, is_since: bool = True) -> str:
    """Return what a promotion has led to, in one sentence.

    zone: None is that of this computer; is_since: whether it says since when

    >>> from datetime import UTC
    >>> found = Last(says="coolant cools", signal="t", words="the temperature", before=3.1, after=1.1, since=1_795_521_780_000)
    >>> promotion(found, UTC)
    'coolant cools: gap of the temperature 3.1 → 1.1 × the repeatability since Tuesday 12:03'
    """
    since = datetime.fromtimestamp(last.since / 1000.0, zone).astimezone(zone)
    when = f" since {since:%A %H:%M}" if is_since else ""
    if last.before is None:
        return f"{last.says}: live{when}"
    of = f" of {last.words}" if last.words else ""
    if last.after is None:
        return f"{last.says}: live{when}; the gap{of} was {floors(last.before)} × the repeatability"
    return f"{last.says}: gap{of} {floors(last.before)} → {floors(last.after)} × the repeatability{when}"


def floors(gap: float) -> str:
    """Return a gap in floors, to a tenth.

    >>> floors(3.14)
    '3.1'
    """
    return f"{gap:.1f}"


def hours(milliseconds: float) -> str:
    """Return a length of time as a person says it.

    >>> hours(90_000), hours(5_400_000), hours(200_000_000), hours(864_000_000)
    ('90 s', '90 min', '56 h', '10 days')
    """
    seconds = milliseconds / 1000.0
    for unit, length, most in (("s", 1.0, 120.0), ("min", 60.0, 120.0), ("h", 3600.0, 72.0)):
        if seconds <= most * length:
            return f"{seconds / length:.0f} {unit}"
    return f"{seconds / 86_400.0:.0f} days"
