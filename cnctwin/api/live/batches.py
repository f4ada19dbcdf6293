"""Server-sent events, encoded once for all who read the same thing."""

import json
from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Any, NamedTuple

from cnctwin.api.live.notices import Notices
from cnctwin.api.value_object import QUALITY_NAMES, Plain

Row = tuple[int, str, Plain, int, str | None]  # t, signal, value, quality, reason
ALL = "*"  # readers of the fleet, and of any machine


class Batch(NamedTuple):
    """An event and who is to have it: the readers of a machine, of the fleet (None), or all (`ALL`).

    rows: what has changed of a machine, for readers that take it apart; None where its whole state is to be read again
    """

    machine: str | None
    payload: bytes
    rows: Sequence[Row] | None = ()


@dataclass(slots=True)
class Waiting:
    """Changes of a machine that its readers have not been sent yet."""

    rows: list[Row] = field(default_factory=list)
    left_out: int = 0
    is_anew: bool = False
    told_ms: int = 0
    readers: int = 0


def event(name: str, value: Any) -> bytes:
    """One event as the wire has it. JSON in one line holds no line break, so no text can end the event early.

    >>> event("rows", {"now": 1})
    b'event: rows\\ndata: {"now":1}\\n\\n'
    """
    return b"event: %s\ndata: %s\n\n" % (name.encode(), json.dumps(value, separators=(",", ":"), allow_nan=False).encode())


def state_batch(machine: str, state: dict[str, Any]) -> Batch:
    """The whole state of a machine."""
    return Batch(machine, event("state", state), None)


def machine_rows(machine: str, now_ms: int, rows: Sequence[Row], *, online: bool, left_out: int) -> Batch:
    """Return the changed rows of a machine; `left_out` says how many rows there was no room for."""
    names = QUALITY_NAMES
    said: dict[str, Any] = {
        "now": now_ms,
        "rows": [(t_ms, name, value, names.get(quality, "bad"), reason) for t_ms, name, value, quality, reason in rows],
        "online": online,
    }
    if left_out:
        said["left_out"] = left_out
    return Batch(machine, event("rows", said), None if left_out else rows)


def fleet_rows(now_ms: int, rows: Sequence[tuple[str, Row]]) -> Batch:
    """Return the changed rows of the fleet's key signals."""
    names = QUALITY_NAMES
    said = [(machine, row[0], row[1], row[2], names.get(row[3], "bad")) for machine, row in rows]
    return Batch(None, event("fleet_rows", {"now": now_ms, "rows": said}))


def notices_batch(now_ms: int, notices: Notices) -> Batch:
    """The sentences above every view, or that there is none any more, for everybody."""
    return Batch(ALL, event("processors", {"now": now_ms, **notices._asdict()}))


def alerts_batch(now_ms: int, alerts: dict[str, Any]) -> Batch:
    """The state of alerts, for everybody."""
    return Batch(ALL, event("alerts", {**alerts, "now": now_ms, "available": True, "reason": None}))
