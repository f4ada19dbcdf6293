"""Metrics as an application declares, changes and reads them; the wire forms are in `values`."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import NamedTuple

from sparkplug.datatype import DataType
from sparkplug.errors import TopicError
from sparkplug.quality import QUALITY_PROPERTY, REASON_PROPERTY, Quality
from sparkplug.topics import NodeId
from sparkplug.values import MetaData, PropertySet, PropertyValue, Value

__all__ = ["Change", "MetricSpec", "NodeId", "Reading", "is_command_metric", "quality_properties"]

UNIT_PROPERTY = "engUnit"
LOW_PROPERTY = "engLow"
HIGH_PROPERTY = "engHigh"
COMMAND_PREFIXES = ("Node Control/", "Device Control/")
_PROPERTY_TYPES = ((bool, DataType.BOOLEAN), (int, DataType.INT64), (float, DataType.DOUBLE), (str, DataType.STRING))


@dataclass(frozen=True, slots=True)
class MetricSpec:
    """One metric of a birth certificate: name, type, and what a reader should know of it.

    `low` and `high` are the limits of the engineering range in `unit`. `value` is what the first birth carries, as of
    `timestamp_ms` (None: of the declaration); without a value it is a null that says so.
    """

    name: str
    datatype: DataType
    unit: str | None = None
    low: float | None = None
    high: float | None = None
    properties: Mapping[str, str | float | int | bool] = field(default_factory=dict)
    value: Value = None
    timestamp_ms: int | None = None
    quality: Quality = Quality.GOOD
    reason: str | None = None
    is_transient: bool = False
    metadata: MetaData | None = None

    def __post_init__(self) -> None:
        if not self.name:
            raise TopicError("a metric needs a name")

    def first(self, now_ms: int) -> "Change":
        """Return what is true before anything was published.

        >>> MetricSpec("spindle_rpm", DataType.DOUBLE).first(0).reason
        'not known yet'
        """
        stamp_ms = now_ms if self.timestamp_ms is None else self.timestamp_ms
        if self.value is None and self.quality is Quality.GOOD:
            return Change(self.name, None, stamp_ms, Quality.BAD, self.reason or "not known yet")
        return Change(self.name, self.value, stamp_ms, self.quality, self.reason)

    def property_set(self) -> PropertySet:
        """The properties that the birth certificate states."""
        known = {UNIT_PROPERTY: self.unit, LOW_PROPERTY: self.low, HIGH_PROPERTY: self.high, **self.properties}
        return {name: _property(value) for name, value in known.items() if value is not None}


class Change(NamedTuple):
    """A new value of a declared metric, with the time at which it became true. `value` None is a null."""

    name: str
    value: Value
    timestamp_ms: int
    quality: Quality = Quality.GOOD
    reason: str | None = None
    is_historical: bool = False


class Reading(NamedTuple):
    """A metric's value as a host application knows it."""

    name: str
    value: Value
    timestamp_ms: int
    quality: Quality
    unit: str | None
    reason: str | None
    is_historical: bool


def is_command_metric(name: str) -> bool:
    """Return True for a metric by which hosts command a node or a device; it measures nothing.

    >>> is_command_metric("Device Control/Receipt"), is_command_metric("spindle_rpm")
    (True, False)
    """
    return name.startswith(COMMAND_PREFIXES)


def _property(value: str | float | int | bool) -> PropertyValue:
    for python_type, datatype in _PROPERTY_TYPES:
        if isinstance(value, python_type):
            return PropertyValue(datatype, value)
    raise TypeError(f"property {value!r} is not a bool, int, float or str")


def quality_properties(quality: Quality, reason: str | None) -> PropertySet:
    """The properties that say how far a value may be trusted; none for a good value without a reason.

    >>> quality_properties(Quality.BAD, "outside 0 to 200 %")["Quality"].value
    0
    """
    properties: dict[str, PropertyValue] = {}
    if quality is not Quality.GOOD:
        properties[QUALITY_PROPERTY] = PropertyValue(DataType.INT32, int(quality))
    if reason is not None:
        properties[REASON_PROPERTY] = PropertyValue(DataType.STRING, reason)
    return properties
