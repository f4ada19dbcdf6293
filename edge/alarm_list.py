"""The signals `alarms` and `alarm_history`: alarms of a control as a JSON list, the same from every kind of control.

>>> alarms_text([ListedAlarm("414", "X AXIS DETECTION ERROR", "fault", active=True)])
'[{"code":"414","text":"X AXIS DETECTION ERROR","severity":"fault","active":true,"acknowledged":null,"since":null}]'
"""

import json
from collections.abc import Sequence
from dataclasses import dataclass

from edge.reading import TEXT_LENGTH_MAX
from twin.vocabulary.signals import ALARM_FIELDS

ALARM_TEXT_MAX = 512


@dataclass(frozen=True, slots=True)
class ListedAlarm:
    """One alarm; None where the control does not tell.

    severity: as the control tells it, a word ("fault") or a number (1 to 1,000 of OPC UA)
    since: ISO 8601; with a Z in UTC, without as the control's own calendar shows it
    """

    code: str | None = None
    text: str | None = None
    severity: str | int | None = None
    active: bool | None = None
    acknowledged: bool | None = None
    since: str | None = None


def alarms_text(alarms: Sequence[ListedAlarm], *, newest_last: bool = False) -> str:
    """Return the list as text of at most `TEXT_LENGTH_MAX` characters; what does not fit is counted in an entry of its own.

    `newest_last`: the first ones go where there is no room, else the last ones.
    """
    kept = list(alarms)
    while len(text := _json(kept, len(alarms) - len(kept), newest_last)) > TEXT_LENGTH_MAX:
        kept = kept[1:] if newest_last else kept[:-1]
    return text


def _json(kept: Sequence[ListedAlarm], left_out: int, newest_last: bool) -> str:
    note = [ListedAlarm(text=f"{left_out} more, for which there is no room")] if left_out else []
    rows = [*note, *kept] if newest_last else [*kept, *note]
    return json.dumps([_row(alarm) for alarm in rows], separators=(",", ":"), ensure_ascii=False)


def _row(alarm: ListedAlarm) -> dict[str, object]:
    row = {field: getattr(alarm, field) for field in ALARM_FIELDS}
    return row | {"text": None if alarm.text is None else alarm.text[:ALARM_TEXT_MAX]}
