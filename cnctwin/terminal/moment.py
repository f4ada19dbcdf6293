"""A moment and a length of time as people write them, on the command line or in Python, and a moment as a table shows it."""

import re
import time
from datetime import UTC, datetime
from zoneinfo import ZoneInfo

from cnctwin.errors import UsageError

FORMS = "2026-11-22T06:00 (UTC unless it names a zone), ms since 1970, or -15m for a quarter of an hour ago (s, m, h, d)"
_AGO = re.compile(r"-(\d+(?:\.\d+)?)([smhd])")
_LENGTH = re.compile(r"(\d+)(ms|s|m|h|d)")
_SECONDS = {"s": 1.0, "m": 60.0, "h": 3600.0, "d": 86_400.0}


def moment_ms(text: str, option: str = "", now_ms: int | None = None) -> int:
    """A moment in ms since 1970; `option` is named where it is none. Raises UsageError.

    >>> moment_ms("2026-11-22T06:00"), moment_ms("1970-01-01T01:00+01:00"), moment_ms("1790000000000")
    (1795327200000, 0, 1790000000000)
    >>> moment_ms("-15m", now_ms=1_000_000)
    100000
    """
    if match := _AGO.fullmatch(text):
        now_ms = time.time_ns() // 1_000_000 if now_ms is None else now_ms
        return now_ms - round(float(match[1]) * _SECONDS[match[2]] * 1000)
    if text.isdecimal() and text.isascii():
        return int(text)
    try:
        moment = datetime.fromisoformat(text)
    except ValueError:
        raise UsageError(f"{f'{option} ' if option else ''}{text!r} is no moment; write {FORMS}") from None
    return round((moment if moment.tzinfo else moment.replace(tzinfo=UTC)).timestamp() * 1000)


def stretch_ms(begin: str | None, end: str | None, lasts_ms: int | None = None, *, now_ms: int | None = None) -> tuple[int, int]:
    """A stretch of time as --from and --to name it; the end is not in it. Raises UsageError.

    Without `end` it lasts until now; without `begin` it lasts `lasts_ms`, else it starts at the beginning of all data.

    >>> stretch_ms("1000", "2000"), stretch_ms(None, None, now_ms=9000), stretch_ms(None, "9000", 500)
    ((1000, 2000), (0, 9000), (8500, 9000))
    """
    now_ms = time.time_ns() // 1_000_000 if now_ms is None else now_ms
    to_ms = now_ms if end is None else moment_ms(end, "--to", now_ms)
    unsaid_ms = 0 if lasts_ms is None else to_ms - lasts_ms
    from_ms = unsaid_ms if begin is None else moment_ms(begin, "--from", now_ms)
    if to_ms <= from_ms:
        raise UsageError(f"--to {end or 'now'} is not after --from {begin or from_ms}; give a stretch of time")
    return from_ms, to_ms


def length_ms(text: str, option: str = "--every") -> int:
    """A length of time in ms; `option` is named where it is none. Raises UsageError.

    >>> length_ms("100ms"), length_ms("1s"), length_ms("15m")
    (100, 1000, 900000)
    """
    match = _LENGTH.fullmatch(text)
    if match is None:
        raise UsageError(f"{option} {text!r}: write 100ms, 1s, 1m, 1h or 1d")
    return int(match[1]) * (1 if match[2] == "ms" else round(_SECONDS[match[2]] * 1000))


def moment_text(at_ms: float, time_zone: str = "UTC") -> str:
    """Return a moment as a table shows it, by the clock on the wall of a time zone.

    >>> moment_text(1_795_327_200_999)
    '2026-11-22 06:00:00'
    >>> moment_text(1_795_327_200_999, "Europe/Berlin")
    '2026-11-22 07:00:00'
    """
    return datetime.fromtimestamp(at_ms / 1000, ZoneInfo(time_zone)).strftime("%Y-%m-%d %H:%M:%S")
