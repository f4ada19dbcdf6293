"""The signals `alarm` and `alarms`: the active conditions of a device, as a text and as a list.

A condition is not one value but a set of activations by native code (MTConnect part 3): Fault and Warning add one, Normal without
a code clears all of its data item, Normal with a code that one, Unavailable clears all and says that nothing is known.

>>> alarms = observe((), "servo", "Fault", "414", "X AXIS DETECTION ERROR")
>>> text_of(alarms)
'FAULT 414 X AXIS DETECTION ERROR'
>>> text_of(observe(alarms, "servo", "Normal", "", ""))
''
"""

from datetime import UTC, datetime
from typing import NamedTuple

from edge.alarm_list import ListedAlarm, alarms_text

ALARMS_MAX = 256
TEXT_LENGTH_MAX = 512


class Alarm(NamedTuple):
    """One activation, or (level UNAVAILABLE) a condition that the control does not report. `since_ms`: ms since 1970."""

    data_item_id: str
    level: str
    native_code: str
    text: str
    severity: str = ""
    since_ms: int | None = None


def observe(
    alarms: tuple[Alarm, ...],
    data_item_id: str,
    level: str,
    native_code: str,
    text: str,
    *,
    severity: str = "",
    time_ms: int | None = None,
) -> tuple[Alarm, ...]:
    """The activations after one more observation; past the bound the oldest goes. One told again stands since it began."""
    level = level.upper()
    clears_all = level == "UNAVAILABLE" or (level == "NORMAL" and not native_code)
    rest = tuple(
        a
        for a in alarms
        if a.data_item_id != data_item_id or (not clears_all and a.native_code != native_code and a.level != "UNAVAILABLE")
    )
    if level == "NORMAL":
        return rest
    code = native_code[:80]
    before = next(
        (a for a in alarms if (a.data_item_id, a.native_code) == (data_item_id, code) and a.level != "UNAVAILABLE"), None
    )
    since_ms = time_ms if before is None or level == "UNAVAILABLE" else before.since_ms
    return (*rest, Alarm(data_item_id, level, code, text[:TEXT_LENGTH_MAX], severity[:80], since_ms))[-ALARMS_MAX:]


def text_of(alarms: tuple[Alarm, ...]) -> str:
    """Return what a person reads: faults first, "" where there is none."""
    return "; ".join(" ".join(filter(None, (a.level, a.native_code, a.text))) or a.level for a in _active(alarms))


def list_of(alarms: tuple[Alarm, ...]) -> str:
    """Return the JSON list, faults first. The severity is the control's own, or the level where it gives none.

    >>> list_of(observe((), "servo", "Fault", "414", "ERROR", severity="A", time_ms=1_700_000_000_000))
    '[{"code":"414","text":"ERROR","severity":"A","active":true,"acknowledged":null,"since":"2023-11-14T22:13:20.000Z"}]'
    """
    return alarms_text(
        [
            ListedAlarm(
                a.native_code or None, a.text or None, a.severity or a.level.lower(), active=True, since=_stamp(a.since_ms)
            )
            for a in _active(alarms)
        ]
    )


def _active(alarms: tuple[Alarm, ...]) -> list[Alarm]:
    active = (a for a in alarms if a.level != "UNAVAILABLE")
    return sorted(active, key=lambda a: (a.level != "FAULT", a.data_item_id, a.native_code))


def _stamp(time_ms: int | None) -> str | None:
    if time_ms is None:
        return None
    return datetime.fromtimestamp(time_ms / 1000, UTC).isoformat(timespec="milliseconds").replace("+00:00", "Z")


def all_unavailable(alarms: tuple[Alarm, ...], conditions: int) -> bool:
    """Return whether none of the device's conditions is known."""
    return conditions > 0 and sum(a.level == "UNAVAILABLE" for a in alarms) >= conditions
