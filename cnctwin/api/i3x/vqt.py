"""Values with quality and time (VQT), as i3X has them: a null is Bad or GoodNoData, a value is Good or Uncertain."""

from collections.abc import Mapping
from datetime import UTC, datetime
from typing import Any, NamedTuple

from cnctwin.api.i3x.types import ObjectType, type_of
from cnctwin.api.value_object import Plain

GOOD, NO_DATA, BAD, UNCERTAIN = "Good", "GoodNoData", "Bad", "Uncertain"


class Vqt(NamedTuple):
    """One value. `value` of a plant or a machine is a table, of a signal a scalar."""

    value: Any
    quality: str
    t_ms: int

    def as_json(self) -> dict[str, Any]:
        """Return it as the interface gives it."""
        return {"value": self.value, "quality": self.quality, "timestamp": rfc3339(self.t_ms)}


def vqt(value: Plain, quality: str, t_ms: int, of: ObjectType) -> Vqt:
    """Return a reading as i3X has it. What is not of the type of its signal is Bad: a device of somebody else may send anything.

    >>> kind = type_of("spindle_rpm")
    >>> vqt(6000.0, "good", 0, kind).quality, vqt(6000.0, "stale", 0, kind).quality, vqt(None, "good", 0, kind).quality
    ('Good', 'Uncertain', 'GoodNoData')
    >>> vqt("fast", "good", 0, kind)
    Vqt(value=None, quality='Bad', t_ms=0)
    """
    if value is None:
        return Vqt(None, NO_DATA if quality == "good" else BAD, t_ms)
    if quality == "bad" or not of.holds(value):
        return Vqt(None, BAD, t_ms)
    return Vqt(value, GOOD if quality == "good" else UNCERTAIN, t_ms)


def signal_vqt(name: str, told: Mapping[str, Any]) -> Vqt:
    """Return the value of a signal, as the live plant tells it (cnctwin/api/value_object.py)."""
    return vqt(told["value"], told["quality"], told["t"], type_of(name))


def rfc3339(t_ms: int) -> str:
    """Return a time of 1970 to 3000 in UTC.

    >>> rfc3339(1_644_501_062_250)
    '2022-02-10T13:51:02.250Z'
    """
    return datetime.fromtimestamp(t_ms / 1000, UTC).isoformat(timespec="milliseconds").replace("+00:00", "Z")
