"""An event of an OPC UA server, as plain text in a fact: of a condition (OPC 10000-9), of a refresh, or a message.

The connection writes one fact for each event, `parse` reads it back, so a recorded frame shows the event as the server told it.

>>> fact = Event(Kind.MESSAGE, "CncMessageType", text="Load pallet 2").fact(7)
>>> Event.read(fact).text, fact.key, fact.t_ms
('Load pallet 2', 'event', 7)
"""

import json
from dataclasses import dataclass, fields
from enum import StrEnum
from typing import Any, Self

from edge.sweep import Fact

# The keys of facts: one event; the node from which events come, or why none do; why the alarms of before are not told.
EVENT, EVENTS, REFRESH = "event", "events", "refresh"
TEXT_LENGTH_MAX = 512


class Kind(StrEnum):
    """The kind of an event."""

    CONDITION = "condition"  # a condition has a new state, or a refresh repeats the state that it has
    MESSAGE = "message"  # something was to be said, and nothing lasts
    SYSTEM = "system"  # the server speaks of itself: audits, changes of its address space
    REFRESH_START = "refresh_start"
    REFRESH_END = "refresh_end"
    REFRESH_REQUIRED = "refresh_required"
    OVERFLOW = "overflow"  # the server's queue of events ran over


@dataclass(frozen=True, slots=True)
class Event:
    """One event. Null is what the server does not tell.

    condition: the ConditionId, which is the same for all states of one condition; branch: of an earlier state that still waits to
    be acknowledged; code: the maker's number; severity: 1 to 1000; since_ms: when it became active
    """

    kind: Kind
    type_name: str = ""
    condition: str = ""
    branch: str = ""
    source: str = ""
    name: str = ""
    code: str = ""
    text: str = ""
    severity: int | None = None
    retain: bool | None = None
    enabled: bool | None = None
    active: bool | None = None
    acknowledged: bool | None = None
    since_ms: int | None = None

    def fact(self, at_ms: int | None) -> Fact:
        """Return the event as a fact, with what is null or empty left out."""
        told = {one.name: value for one in fields(self) if (value := getattr(self, one.name)) not in (None, "")}
        return Fact(EVENT, json.dumps(told, separators=(",", ":"), ensure_ascii=False), "", at_ms)

    @classmethod
    def read(cls, fact: Fact) -> Self | None:
        """Return the event of this fact; None where it is none."""
        try:
            told = json.loads(fact.value) if isinstance(fact.value, str) else None
            return cls(**_checked(told)) if isinstance(told, dict) else None
        except (ValueError, TypeError, RecursionError):
            return None

    @classmethod
    def kind_of(cls, fact: Fact) -> Kind | None:
        """Return the kind of the event of this fact; None where it is none."""
        event = cls.read(fact)
        return None if event is None else event.kind


_KINDS_OF_VALUE: dict[str, type] = {
    **dict.fromkeys(("type_name", "condition", "branch", "source", "name", "code", "text"), str),
    **dict.fromkeys(("severity", "since_ms"), int),
    **dict.fromkeys(("retain", "enabled", "active", "acknowledged"), bool),
}


def _checked(told: dict[str, Any]) -> dict[str, Any]:
    read: dict[str, Any] = {"kind": Kind(told.pop("kind", ""))}
    for name, value in told.items():
        if type(value) is not _KINDS_OF_VALUE[name] if name in _KINDS_OF_VALUE else True:
            raise TypeError(f"{name} of an event is {value!r}")
        read[name] = value[:TEXT_LENGTH_MAX] if isinstance(value, str) else value
    return read
