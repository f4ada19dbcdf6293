"""Two data messages of a device as one: the newest value of each signal wins, and no change of a state is lost.

A state is a text, a flag, or the tool number: execution, mode, program, alarms, tool changes. A value that passes between two
others of a number can be left out; a state cannot.
"""

from sparkplug.host_event import EventKind, HostEvent
from sparkplug.metric import Reading

STATES = frozenset({"tool_number"})
NAMES_MAX = 10_000  # tuples of names that are kept
_together: dict[tuple[tuple[str, ...], tuple[str, ...]], tuple[str, ...]] = {}


def conflated(old: HostEvent, new: HostEvent) -> HostEvent | None:
    """Return one event for two of a device, or None where that would lose more than values that have been followed by newer ones.

    History is never conflated, nor a message that names a signal twice.
    """
    if old.kind is not EventKind.DATA or new.kind is not EventKind.DATA or not old.names or not new.names:
        return None
    if old.names is new.names and new.oldest_ms >= old.newest_ms:
        if any(_is_change(before, after) for before, after in zip(old.readings, new.readings, strict=True)):
            return None
        return new
    readings = dict(zip(old.names, old.readings, strict=True))
    if len(readings) != len(old.names) or len(set(new.names)) != len(new.names):
        return None
    for reading in new.readings:
        before = readings.get(reading.name)
        if before is None:
            readings[reading.name] = reading
        elif _is_change(before, reading):
            return None
        elif reading.timestamp_ms >= before.timestamp_ms:
            readings[reading.name] = reading
    stamps_ms = [reading.timestamp_ms for reading in readings.values()]
    return new._replace(
        timestamp_ms=max(old.timestamp_ms, new.timestamp_ms),
        readings=tuple(readings.values()),
        names=_names(old.names, new.names, tuple(readings)),
        oldest_ms=min(stamps_ms),
        newest_ms=max(stamps_ms),
    )


def _is_change(before: Reading, after: Reading) -> bool:
    """Return True if `after` changes a state."""
    one, other = before.value, after.value
    is_state = isinstance(one, (str, bool)) or isinstance(other, (str, bool)) or before.name in STATES
    return is_state and (one != other or before.quality is not after.quality)


def _names(old: tuple[str, ...], new: tuple[str, ...], both: tuple[str, ...]) -> tuple[str, ...]:
    """Return the names of both, the same tuple each time: it is recognised by identity."""
    if len(_together) >= NAMES_MAX:
        _together.clear()
    return _together.setdefault((old, new), both)
