"""The alarms of a control, folded from the events of its conditions (OPC 10000-9).

A condition is listed while its Retain is true: active, or gone but not acknowledged yet. A refresh begins and ends with an event
of its own; between them the server repeats each condition that is retained, so one that was not repeated is gone. Until the first
refresh has ended, nobody knows which alarms were there before: the list says so.

    asked ──refresh_end──► whole          refused: events, but no refresh, so that only alarms raised since are known
      └────refused──────► partial

>>> table = fold(AlarmTable(Phase.PARTIAL), Event(Kind.CONDITION, condition="7", code="25201", retain=True, active=True), 5)
>>> text_of(fold(table, Event(Kind.CONDITION, condition="8", text="Coolant low", severity=500, retain=True), 6))
'Coolant low; 25201'
>>> text_of(fold(table, Event(Kind.CONDITION, condition="7", retain=False), 7))
''
"""

from dataclasses import dataclass, replace
from enum import StrEnum

from edge.controls.opcua.event import Event, Kind
from edge.reading import TEXT_LENGTH_MAX

ALARMS_MAX = 256


class Phase(StrEnum):
    """The phase of reading alarms: how much of them is known."""

    NONE = "none"  # no events are heard
    ASKED = "asked"  # the server was asked for the alarms that are there already
    WHOLE = "whole"
    PARTIAL = "partial"  # it could not say, so only those are known that were told since


@dataclass(frozen=True, slots=True)
class Alarm:
    """One condition, or (with a branch) an earlier state of it that still waits to be acknowledged."""

    key: str
    code: str
    text: str
    severity: int | None
    active: bool | None
    acknowledged: bool | None
    since_ms: int | None


@dataclass(frozen=True, slots=True)
class AlarmTable:
    """All alarms that are retained, in the order in which they were first told.

    unconfirmed: during a refresh, those that it has not repeated yet; None: no refresh goes on
    """

    phase: Phase = Phase.NONE
    alarms: tuple[Alarm, ...] = ()
    unconfirmed: tuple[str, ...] | None = None
    why_not: str = ""  # why the list is not whole


def fold(table: AlarmTable, event: Event, at_ms: int) -> AlarmTable:
    """Return the table after one more event at this time."""
    if event.kind is Kind.REFRESH_START:
        return replace(table, unconfirmed=tuple(alarm.key for alarm in table.alarms))
    if event.kind is Kind.REFRESH_END:
        gone = set(table.unconfirmed or ())
        kept = tuple(alarm for alarm in table.alarms if alarm.key not in gone)
        return AlarmTable(Phase.WHOLE, kept)
    if event.kind is not Kind.CONDITION:
        return table
    key = f"{event.condition}#{event.branch}" if event.branch else event.condition
    before = next((alarm for alarm in table.alarms if alarm.key == key), None)
    rest = tuple(alarm for alarm in table.alarms if alarm.key != key)
    unconfirmed = None if table.unconfirmed is None else tuple(one for one in table.unconfirmed if one != key)
    if event.retain is not True or event.enabled is False:
        return replace(table, alarms=rest, unconfirmed=unconfirmed)
    alarm = _alarm(key, event, before, at_ms)
    alarms = (*rest, alarm) if before is None else tuple(alarm if one.key == key else one for one in table.alarms)
    return replace(table, alarms=alarms[-ALARMS_MAX:], unconfirmed=unconfirmed)


def _alarm(key: str, event: Event, before: Alarm | None, at_ms: int) -> Alarm:
    active = False if event.branch else event.active
    goes_on = before is not None and before.active is not False
    if active is False:  # the time of its transition is when it went
        since_ms = None if before is None else before.since_ms
    else:
        since_ms = event.since_ms or (before.since_ms if before is not None and goes_on else at_ms)
    return Alarm(key, event.code, event.text or event.name, event.severity, active, event.acknowledged, since_ms)


def listed(table: AlarmTable) -> tuple[Alarm, ...]:
    """Return the alarms as a person wants them: the active ones first, of these the severest, then the oldest."""

    def rank(alarm: Alarm) -> tuple[bool, int, int, str]:
        return alarm.active is False, -(alarm.severity or 0), alarm.since_ms or 0, alarm.key

    return tuple(sorted(table.alarms, key=rank))


def text_of(table: AlarmTable) -> str:
    """Return the alarms that are active, as text; "" where there is none; what has no room is counted at the end."""
    active = [alarm for alarm in listed(table) if alarm.active is not False]
    shown = [" ".join(filter(None, (alarm.code, alarm.text))) or alarm.key for alarm in active]
    for room in range(len(shown), 0, -1):
        text = "; ".join((*shown[:room], *([f"{len(shown) - room} more"] if room < len(shown) else [])))
        if len(text) <= TEXT_LENGTH_MAX:
            return text
    return ""
