"""A host application's picture of one edge node and its devices."""

from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass, field
from functools import lru_cache
from typing import Any, NamedTuple

from sparkplug.codec import datatype_of, read_properties, read_value
from sparkplug.datatype import FIELD, DataType
from sparkplug.errors import PayloadError
from sparkplug.layouts.layout import Packed
from sparkplug.layouts.memory import Memory
from sparkplug.metric import UNIT_PROPERTY, NodeId, Reading
from sparkplug.quality import QUALITY_PROPERTY, REASON_PROPERTY, Quality
from sparkplug.values import PropertySet, Template
from sparkplug.wire_value import READ

METRICS_MAX = 100_000
NAMES_KNOWN_MAX = 64
NAMES_KNOWN_LENGTH_MAX = 1000
BINDINGS_MAX = 16_384
BINDING_NAME_MAX = 256
TOLD_MAX = 4096
TOLD_BYTES_MAX = 1024
_QUALITY_BYTES = QUALITY_PROPERTY.encode()
_REASON_BYTES = REASON_PROPERTY.encode()
_REBIRTH = "Node Control/Rebirth"
_HOST_BUILT = frozenset({"bdSeq", _REBIRTH})
_PLAIN_FIELDS = frozenset({DataType.DOUBLE, DataType.BOOLEAN})


class Binding(NamedTuple):
    """The declaration of a metric in its birth: enough to read its data."""

    name: str
    datatype: DataType
    field: str  # of the protobuf metric; empty where only `read_value` can tell (datasets, templates, no datatype)
    read: Callable[[Any], Any] | None  # None where the protobuf value is the Python value
    unit: str | None


class Owner:
    """An edge node's own metrics, or those of one device.

    An alias means what the owner's own birth says. The specification has it unique over the node and its devices; Tahu Java gives
    one to metrics of the same name on a node and its device, and then the topic tells which is meant.
    """

    __slots__ = (
        "_latest",
        "_names",
        "_names_known",
        "_newest",
        "_packed",
        "aliases",
        "aliases_shared",
        "bindings",
        "birth_ms",
        "layouts",
        "offers_rebirth",
        "online",
        "properties",
        "templates",
    )

    def __init__(self, *, online: bool = False, readings: dict[str, Reading] | None = None) -> None:
        self.online = online
        self.birth_ms = 0
        self.properties: dict[str, PropertySet] = {}
        self.templates: dict[str, Template] = {}
        self.bindings: dict[str, Binding] = {}
        self.aliases: dict[int, Binding] = {}
        self.aliases_shared = 0  # aliases of the last birth that another owner of the same node has, too
        self.offers_rebirth = False
        self.layouts: Memory | None = None  # of its data messages; None until one came
        self._latest = readings or {}
        self._names: tuple[str, ...] = ()
        self._newest: tuple[Reading, ...] = ()
        self._packed: Packed | None = None  # in place of the newest
        self._names_known: dict[tuple[str, ...], tuple[str, ...]] = {}

    @property
    def readings(self) -> dict[str, Reading]:
        """The latest reading of each metric that the birth declared."""
        self._settle()
        return self._latest

    def take(self, readings: tuple[Reading, ...]) -> tuple[str, ...]:
        """Note what a data message said; hand back the names of its readings, () where one of them is historical."""
        names = tuple([reading[0] for reading in readings])
        if any(reading[6] for reading in readings):
            self.take_history(readings)
            return ()
        if len(names) <= NAMES_KNOWN_LENGTH_MAX:
            if len(self._names_known) >= NAMES_KNOWN_MAX:
                self._names_known.clear()
            names = self._names_known.setdefault(names, names)
        self.take_present(names, readings)
        return names

    def take_present(self, names: tuple[str, ...], readings: tuple[Reading, ...]) -> None:
        """Note readings of which none is historical, with their names as `take` gave them.

        They are laid aside until somebody asks for the latest ones: as a rule the next message says all of them again.
        """
        if names is not self._names:
            self._settle()
            self._names = names
        self._newest, self._packed = readings, None

    def take_packed(self, packed: Packed) -> None:
        """Note a message that is taken apart only where somebody asks for the latest readings."""
        self.take_present(packed.layout.names, ())
        self._packed = packed

    def replace(self, readings: Iterable[Reading]) -> None:
        """Have other readings stand for those of the birth."""
        self.readings.update({reading.name: reading for reading in readings})

    def take_history(self, readings: tuple[Reading, ...]) -> None:
        """Note readings of which some may be historical."""
        self.readings.update({reading.name: reading for reading in readings if not reading.is_historical})

    def forget_layouts(self) -> None:
        """Aliases and names may mean something else now."""
        if self.layouts is not None:
            self.layouts.forget()

    def _settle(self) -> None:
        if self._names:
            newest = self._newest if self._packed is None else self._packed.readings()
            self._latest.update(zip(self._names, newest, strict=True))
            self._names, self._newest, self._packed = (), (), None

    def bear(self, message: Any, timestamp_ms: int, holders: dict[int, "Owner"]) -> tuple[Reading, ...]:
        """Take a birth certificate; everything known before is forgotten. Raises PayloadError before anything changes.

        holders: of each alias of the node, who has it
        """
        if len(message.metrics) > METRICS_MAX:
            raise PayloadError(f"birth declares {len(message.metrics)} metrics; the limit is {METRICS_MAX}")
        declared = [_declared(metric, timestamp_ms) for metric in message.metrics]
        self.leave(holders)
        self.online, self.birth_ms = True, timestamp_ms
        self.properties, self.templates, self.bindings, self.aliases = {}, {}, {}, {}
        self.aliases_shared, self.offers_rebirth = 0, False
        readings: dict[str, Reading] = {}
        for alias, binding, properties, reading in declared:
            if binding is None:
                self.offers_rebirth = self.offers_rebirth or reading.name == _REBIRTH
                continue
            name = binding.name
            if isinstance(reading.value, Template) and reading.value.is_definition:
                self.templates[name] = reading.value
                continue
            self.bindings[name], self.properties[name], readings[name] = binding, properties, reading
            if alias is not None:
                self.aliases[alias] = binding
                holder = holders.setdefault(alias, self)
                self.aliases_shared += holder is not self and holder.online
        self._latest, self._names, self._newest, self._packed, self._names_known = readings, (), (), None, {}
        return tuple(readings.values())

    def leave(self, holders: dict[int, "Owner"]) -> None:
        """Take its aliases out of the table; what it says from now on is read again."""
        for old in self.aliases:
            if holders.get(old) is self:
                del holders[old]
        self.forget_layouts()

    def binding(self, metric: Any) -> Binding | None:
        """Return what the birth said of a data metric: by its alias, else by its name."""
        alias = metric.alias
        known = self.aliases.get(alias) if alias or metric.HasField("alias") else None  # 0 is an alias, too, if it is there
        if known is not None:
            return known
        return self.bindings.get(metric.name) if metric.name else None

    def forget_birth(self) -> None:
        """Forget what the birth said: the node was born again, and another birth of the device follows."""
        self.bindings, self.aliases = {}, {}
        self.forget_layouts()

    def wither(self, timestamp_ms: int, reason: str) -> tuple[Reading, ...]:
        """Go offline: every value becomes stale as of `timestamp_ms` (5.9)."""
        self.online = False
        self.forget_layouts()
        new, stale = tuple.__new__, Quality.STALE
        known = self.readings
        for name, (_, value, _, _, unit, _, historical) in known.items():
            known[name] = new(Reading, (name, value, timestamp_ms, stale, unit, reason, historical))
        return tuple(known.values())


@dataclass(slots=True)
class NodePicture:
    """One edge node: its own metrics, its devices, and who has which alias."""

    node: NodeId
    bd_seq: int | None = None
    own: Owner = field(default_factory=Owner)
    devices: dict[str, Owner] = field(default_factory=dict)
    holders: dict[int, Owner] = field(default_factory=dict)

    @property
    def online(self) -> bool:
        """Return whether the node is born and not dead."""
        return self.own.online

    def owner(self, device: str | None) -> Owner | None:
        """The node's own metrics (None) or those of a device; None where it was never born."""
        return self.own if device is None else self.devices.get(device)

    def owners(self) -> Iterator[tuple[str | None, Owner]]:
        """The node itself, then its devices."""
        yield None, self.own
        yield from self.devices.items()

    def forget_one(self) -> str | None:
        """Make room for a device: the one that has been offline the longest is forgotten; None where all are online."""
        device = next((device for device, owner in self.devices.items() if not owner.online), None)
        if device is not None:
            self.devices.pop(device).leave(self.holders)
        return device

    def read_data(
        self, owner: Owner, message: Any, timestamp_ms: int, *, may_tell_quality: bool = True
    ) -> tuple[list[Reading], bool]:
        """The readings of a data message, and whether all of its metrics were known and of their type.

        The birth has fixed name, field and type of each alias, so that a metric is read with a handful of look-ups. A value that
        is not the field's default is certainly there and no null; everything else takes the longer way. `may_tell_quality` False
        says that the bytes do not even hold the property's name.
        """
        readings: list[Reading] = []
        complete = True
        binding_of, new = owner.binding, tuple.__new__
        for metric in message.metrics:
            binding = binding_of(metric)
            if binding is None:
                complete = False
                continue
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
            stamp_ms = metric.timestamp or timestamp_ms
            readings.append(new(Reading, (name, value, stamp_ms, quality, unit, reason, metric.is_historical)))
        return readings, complete


class Told(NamedTuple):
    """The properties of a metric, and the quality and unit in them."""

    properties: PropertySet
    unit: str | None
    quality: Quality
    reason: str | None


_NOTHING_TOLD = Told({}, None, Quality.GOOD, None)
_told_before: dict[bytes, Told] = {}  # by their bytes: machines of one kind declare the same units and meanings


def told_of(message: Any) -> Told:
    """Return what a property set says; sets of the same bytes are read once."""
    raw: bytes = message.SerializeToString()
    told = _told_before.get(raw)
    if told is None:
        properties = read_properties(message)
        unit = properties.get(UNIT_PROPERTY)
        of_birth = None if unit is None or unit.value is None else str(unit.value)
        told = Told(properties, of_birth, *quality_of(properties))
        if len(raw) <= TOLD_BYTES_MAX:
            if len(_told_before) >= TOLD_MAX:
                _told_before.clear()
            _told_before[raw] = told
    return told


def _binding(name: str, datatype: DataType, unit: str | None) -> Binding:
    read = None if datatype in _PLAIN_FIELDS else READ.get(datatype)
    return Binding(name, datatype, FIELD[datatype] if datatype in READ else "", read, unit)


_shared_binding = lru_cache(maxsize=BINDINGS_MAX)(_binding)


def _declared(metric: Any, timestamp_ms: int) -> tuple[int | None, Binding | None, PropertySet, Reading]:
    """Return a birth's metric: alias, binding (None where it is none of the application's), properties, and first reading."""
    name = READ[DataType.STRING](metric.name)
    code = metric.datatype
    datatype = datatype_of(code) if code or metric.HasField("datatype") else DataType.UNKNOWN
    value = read_value(metric, datatype)
    told = told_of(metric.properties) if metric.HasField("properties") else _NOTHING_TOLD
    stamp_ms = metric.timestamp
    if not stamp_ms and not metric.HasField("timestamp"):
        stamp_ms = timestamp_ms
    alias = metric.alias
    if not alias and not metric.HasField("alias"):
        alias = None
    given = name not in _HOST_BUILT if name else metric.HasField("name")
    binding = None
    if given:
        is_short = len(name) + len(told.unit or "") <= BINDING_NAME_MAX
        binding = (_shared_binding if is_short else _binding)(name, datatype, told.unit)
        name = binding.name
    reading = tuple.__new__(Reading, (name, value, stamp_ms, told.quality, told.unit, told.reason, False))
    return alias, binding, told.properties, reading


def tells_quality(payload: bytes) -> bool:
    """Return whether a payload can hold a quality or its reason at all: their names would stand in its bytes."""
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
