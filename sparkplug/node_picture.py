"""What a host application knows of one edge node and its devices."""

from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from typing import Any, NamedTuple

from sparkplug.codec import read_metric, read_properties, read_value
from sparkplug.datatype import FIELD, DataType
from sparkplug.errors import PayloadError
from sparkplug.metric import UNIT_PROPERTY, NodeId, Reading
from sparkplug.quality import QUALITY_PROPERTY, REASON_PROPERTY, Quality
from sparkplug.values import PropertySet, Template
from sparkplug.wire_value import READ

METRICS_MAX = 100_000
_QUALITY_BYTES = QUALITY_PROPERTY.encode()
_REASON_BYTES = REASON_PROPERTY.encode()
_HOST_BUILT = frozenset({"bdSeq", "Node Control/Rebirth"})
_PLAIN_FIELDS = frozenset({DataType.DOUBLE, DataType.BOOLEAN})


class Binding(NamedTuple):
    """What the birth said of a metric: enough to read its data."""

    name: str
    datatype: DataType
    field: str  # of the protobuf metric; empty where only `read_value` can tell (datasets, templates, no datatype)
    read: Callable[[Any], Any] | None  # None where the protobuf value is the Python value
    unit: str | None


@dataclass(slots=True)
class Owner:
    """An edge node's own metrics, or those of one device."""

    online: bool = False
    birth_ms: int = 0
    properties: dict[str, PropertySet] = field(default_factory=dict)
    templates: dict[str, Template] = field(default_factory=dict)
    bindings: dict[str, Binding] = field(default_factory=dict)
    readings: dict[str, Reading] = field(default_factory=dict)

    def bear(self, message: Any, timestamp_ms: int, aliases: dict[int, tuple["Owner", Binding]]) -> tuple[Reading, ...]:
        """Take a birth certificate; everything known before is forgotten. Raises PayloadError before anything changes."""
        metrics = [read_metric(metric) for metric in message.metrics]
        if len(metrics) > METRICS_MAX:
            raise PayloadError(f"birth declares {len(metrics)} metrics; the limit is {METRICS_MAX}")
        for alias in [a for a, (owner, _) in aliases.items() if owner is self]:
            del aliases[alias]
        self.online, self.birth_ms = True, timestamp_ms
        self.properties, self.templates, self.bindings, self.readings = {}, {}, {}, {}
        for metric in metrics:
            if metric.name is None or metric.name in _HOST_BUILT:
                continue
            datatype = metric.datatype or DataType.UNKNOWN
            if isinstance(metric.value, Template) and metric.value.is_definition:
                self.templates[metric.name] = metric.value
                continue
            unit = metric.properties.get(UNIT_PROPERTY)
            binding = Binding(
                metric.name,
                datatype,
                FIELD[datatype] if datatype in READ else "",
                None if datatype in _PLAIN_FIELDS else READ.get(datatype),
                str(unit.value) if unit is not None and unit.value is not None else None,
            )
            self.bindings[metric.name] = binding
            self.properties[metric.name] = metric.properties
            if metric.alias is not None:
                aliases[metric.alias] = (self, binding)
            quality, reason = quality_of(metric.properties)
            stamp = timestamp_ms if metric.timestamp_ms is None else metric.timestamp_ms
            self.readings[metric.name] = Reading(metric.name, metric.value, stamp, quality, binding.unit, reason, False)
        return tuple(self.readings.values())

    def wither(self, timestamp_ms: int, reason: str) -> tuple[Reading, ...]:
        """Go offline: every value becomes stale as of `timestamp_ms` (5.9)."""
        self.online = False
        self.readings = {
            name: reading._replace(timestamp_ms=timestamp_ms, quality=Quality.STALE, reason=reason)
            for name, reading in self.readings.items()
        }
        return tuple(self.readings.values())


@dataclass(slots=True)
class NodePicture:
    """One edge node: its own metrics, its devices, and the alias table that they share."""

    node: NodeId
    bd_seq: int | None = None
    own: Owner = field(default_factory=Owner)
    devices: dict[str, Owner] = field(default_factory=dict)
    aliases: dict[int, tuple[Owner, Binding]] = field(default_factory=dict)

    @property
    def online(self) -> bool:
        """Whether the node is born and not dead."""
        return self.own.online

    def owner(self, device: str | None) -> Owner | None:
        """The node's own metrics (None) or those of a device; None where it was never born."""
        return self.own if device is None else self.devices.get(device)

    def owners(self) -> Iterator[tuple[str | None, Owner]]:
        """The node itself, then its devices."""
        yield None, self.own
        yield from self.devices.items()

    def read_data(
        self, owner: Owner, message: Any, timestamp_ms: int, *, may_tell_quality: bool = True
    ) -> tuple[list[Reading], bool]:
        """The readings of a data message, and whether all of its metrics were known and of their type.

        This is the hot path of every processor: the birth has fixed name, field and type of each alias, so that a metric is
        read with a handful of look-ups. A value that is not the field's default is certainly there and no null; everything
        else takes the longer way. `may_tell_quality` False says that the bytes do not even hold the property's name.
        """
        readings: list[Reading] = []
        complete = True
        aliases, latest, new = self.aliases, owner.readings, tuple.__new__
        for metric in message.metrics:
            alias = metric.alias
            known = aliases.get(alias) if alias or metric.HasField("alias") else None  # 0 is an alias, too, if it is there
            if known is None or known[0] is not owner:
                binding = owner.bindings.get(metric.name) if metric.name else None
                if binding is None:
                    complete = False
                    continue
            else:
                binding = known[1]
            name, datatype, field_name, read, unit = binding
            quality, reason = Quality.GOOD, None
            try:
                value = getattr(metric, field_name) if field_name else None
                if not value or metric.is_null:
                    value = read_value(metric, datatype)
                elif read is not None:
                    value = read(value)
                if may_tell_quality and metric.HasField("properties"):
                    quality, reason = quality_of(read_properties(metric.properties))
            except PayloadError:
                complete = False  # the metric is not, or no longer, what its birth declared
                continue
            historical = metric.is_historical
            reading = new(Reading, (name, value, metric.timestamp or timestamp_ms, quality, unit, reason, historical))
            readings.append(reading)
            if not historical:
                latest[name] = reading
        return readings, complete


def tells_quality(payload: bytes) -> bool:
    """Whether a payload can hold a quality or its reason at all: their names would stand in its bytes."""
    return _QUALITY_BYTES in payload or _REASON_BYTES in payload


def quality_of(properties: PropertySet) -> tuple[Quality, str | None]:
    """The quality and its reason; a metric without the property is good, one with an unknown code is bad."""
    reason = properties.get(REASON_PROPERTY)
    text = None if reason is None or reason.value is None else str(reason.value)
    code = properties.get(QUALITY_PROPERTY)
    if code is None:
        return Quality.GOOD, text
    try:
        return Quality(code.value if isinstance(code.value, int) else -1), text
    except ValueError:
        return Quality.BAD, text or f"quality code {code.value!r} is not 0, 192 or 500"
