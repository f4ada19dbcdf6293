"""The contents of a birth certificate: a table of metrics with their aliases, types and present values."""

from collections.abc import Callable, Iterable, Sequence
from contextlib import suppress
from dataclasses import dataclass
from functools import lru_cache
from typing import Any

from sparkplug.codec import encode, write_properties, write_value
from sparkplug.datatype import PROPERTY_ONLY, DataType
from sparkplug.errors import MetricValueError, SparkplugError, UnknownMetricError
from sparkplug.layouts.varint import written
from sparkplug.metric import Change, MetricSpec, quality_properties
from sparkplug.metric_bytes import DOUBLE_TAG, STAMP_MS_MAX, STAMP_MS_MIN, DataTemplate, data_template, pack_double
from sparkplug.quality import QUALITY_PROPERTY, REASON_PROPERTY, Quality
from sparkplug.schema import PayloadMessage, PropertySetMessage
from sparkplug.template_rules import Definitions, check_instance, merged
from sparkplug.values import Metric, Payload, PropertySet, PropertyValue, Template, Value
from sparkplug.wire_value import WRITE

_GOOD = Quality.GOOD
GOOD_AGAIN: PropertySet = {QUALITY_PROPERTY: PropertyValue(DataType.INT32, int(Quality.GOOD))}


@dataclass(slots=True)
class _Slot:
    """One declared metric and its present value."""

    spec: MetricSpec
    alias: int
    template: DataTemplate
    properties: tuple[bytes, bytes] | None
    value: Value = None
    timestamp_ms: int = 0
    quality: Quality = Quality.GOOD
    reason: str | None = None


class Certificate:
    """The metrics of one edge node or device; `alias_of` gives each name its alias, the same one each time."""

    def __init__(
        self,
        owner: str,
        specs: Iterable[MetricSpec],
        alias_of: Callable[[str], int],
        now_ms: int,
        definitions: Definitions | None = None,
    ) -> None:
        self._owner = owner
        self._definitions = definitions or {}
        self._slots: dict[str, _Slot] = {}
        folded: dict[str, str] = {}
        for spec in specs:
            alike = folded.setdefault(spec.name.casefold(), spec.name)
            if alike != spec.name or spec.name in self._slots:
                raise SparkplugError(f"{owner} declares {spec.name!r} beside {alike!r}; names have to differ in more than case")
            if spec.datatype is DataType.UNKNOWN or spec.datatype in PROPERTY_ONLY:
                raise SparkplugError(f"{owner}: metric {spec.name!r}: {spec.datatype.name} is no type of a metric")
            alias = alias_of(spec.name)
            template = data_template(alias, spec.datatype, is_transient=spec.is_transient)
            slot = _Slot(spec, alias, template, _property_parts(spec), *spec.first(now_ms)[1:5])
            self._slots[spec.name] = slot
            self._check(slot, spec.value, whole=True)

    def __contains__(self, name: str) -> bool:
        return name in self._slots

    @property
    def specs(self) -> tuple[MetricSpec, ...]:
        """The declared metrics, in order."""
        return tuple(slot.spec for slot in self._slots.values())

    def keep_values(self, older: "Certificate") -> None:
        """Take over the present values of the metrics that `older` declares with the same type."""
        for name, slot in self._slots.items():
            past = older._slots.get(name)
            if past is not None and past.spec.datatype is slot.spec.datatype:
                slot.value, slot.timestamp_ms, slot.quality, slot.reason = (
                    past.value,
                    past.timestamp_ms,
                    past.quality,
                    past.reason,
                )

    def name_of(self, alias: int) -> MetricSpec | None:
        """The metric with this alias."""
        return next((slot.spec for slot in self._slots.values() if slot.alias == alias), None)

    def spec(self, name: str) -> MetricSpec | None:
        """The metric with this name."""
        slot = self._slots.get(name)
        return None if slot is None else slot.spec

    def check(self, changes: Iterable[Change]) -> None:
        """Raise UnknownMetricError or MetricValueError where a change does not fit the declaration."""
        for change in changes:
            self._check(self._slot(change.name), change.value)

    def note(self, changes: Sequence[Change]) -> None:
        """Keep the new values, the newest of each metric, for the next birth; history does not change the present."""
        slots = self._slots
        for name, value, timestamp_ms, quality, reason, is_historical in _oldest_first(changes):
            if not is_historical:
                slot = slots[name]
                if isinstance(value, Template) and isinstance(slot.value, Template) and value.ref == slot.value.ref:
                    value = merged(slot.value, value)  # noqa: PLW2901
                slot.value, slot.timestamp_ms, slot.quality, slot.reason = value, timestamp_ms, quality, reason

    def birth(self) -> bytes:
        """The metrics of a birth, oldest first: name, alias, type, properties and the present value of each."""
        return b"".join(map(_declared, sorted(self._slots.values(), key=_time_of)))

    def take_plain(self, changes: Sequence[Change]) -> bytes | None:
        """Do what `data` and `note` do for good numbers, oldest first; None, and nothing is noted, where one is anything else."""
        parts: list[bytes] = []
        taken: list[_Slot] = []
        slots, before_ms, stamp = self._slots, 0, b""
        for name, value, timestamp_ms, quality, reason, is_historical in changes:
            if type(value) is not float or quality is not _GOOD or reason is not None or is_historical:
                return None
            slot = slots.get(name)
            if slot is None or slot.quality is not _GOOD or not (head := slot.template.head):
                return None
            if timestamp_ms != before_ms:
                if type(timestamp_ms) is not int or not before_ms <= timestamp_ms <= STAMP_MS_MAX or timestamp_ms < STAMP_MS_MIN:
                    return None
                before_ms, stamp = timestamp_ms, written(timestamp_ms) + DOUBLE_TAG
            parts += (head, stamp, pack_double(value))
            taken.append(slot)
        for slot, change in zip(taken, changes):  # noqa: B905 — slower, and one was taken of each
            slot.value, slot.timestamp_ms, slot.reason = change[1], change[2], None
        return b"".join(parts)

    def data(self, changes: Sequence[Change]) -> bytes:
        """The changes, oldest first, as metrics of a payload: alias, time and value, no name and no type (6.4.5, 6.4.7).

        A quality is told where it is not good, and once when it is good again.
        """
        parts: list[bytes] = []
        for change in _oldest_first(changes):
            name, value, timestamp_ms, quality, reason, is_historical = change
            slot = self._slots.get(name) or self._slot(name)
            tells = quality is not Quality.GOOD or reason is not None or slot.quality is not Quality.GOOD
            raw = None if tells or is_historical or value is None else self._by_template(slot, value, timestamp_ms)
            parts.append(raw or self._by_protobuf(slot, change))
        return b"".join(parts)

    def _by_template(self, slot: _Slot, value: Value, timestamp_ms: int) -> bytes | None:
        try:
            return slot.template.written(value, timestamp_ms)
        except MetricValueError as error:
            raise MetricValueError(f"{self._owner}: metric {slot.spec.name!r}: {error}") from error

    def _by_protobuf(self, slot: _Slot, change: Change) -> bytes:
        _, value, timestamp_ms, quality, reason, is_historical = change
        message = PayloadMessage()
        out = message.metrics.add()
        out.alias = slot.alias
        out.timestamp = timestamp_ms
        if value is None:
            out.is_null = True
        else:
            self._write(out, slot, value)
        if quality is not Quality.GOOD or reason is not None:
            write_properties(out.properties, quality_properties(quality, reason))
        elif slot.quality is not Quality.GOOD:
            write_properties(out.properties, GOOD_AGAIN)
        if is_historical:
            out.is_historical = True
        if slot.spec.is_transient:
            out.is_transient = True
        data: bytes = message.SerializeToString()
        return data

    def _slot(self, name: str) -> _Slot:
        slot = self._slots.get(name)
        if slot is None:
            known = ", ".join(list(self._slots)[:8])
            raise UnknownMetricError(f"{self._owner} has no metric {name!r}; its birth declares {known} …")
        return slot

    def _write(self, out: Any, slot: _Slot, value: Value) -> None:
        try:
            if isinstance(value, Template):
                check_instance(value, self._definitions, whole=False)
            write_value(out, slot.spec.datatype, value)
        except MetricValueError as error:
            raise MetricValueError(f"{self._owner}: metric {slot.spec.name!r}: {error}") from error

    def _check(self, slot: _Slot, value: Value, *, whole: bool = False) -> None:
        """Raise MetricValueError, naming owner and metric, where the declared type cannot carry `value`."""
        if value is None:
            return
        datatype = slot.spec.datatype
        try:
            if datatype in WRITE:
                WRITE[datatype](value)
            else:
                if isinstance(value, Template):
                    check_instance(value, self._definitions, whole=whole)
                write_value(PayloadMessage().metrics.add(), datatype, value)  # else only the next birth would fail, and every one
        except (MetricValueError, ValueError) as error:
            raise MetricValueError(f"{self._owner}: metric {slot.spec.name!r}: {error}") from error


def _time_of(slot: _Slot) -> int:
    return slot.timestamp_ms


def _declared(slot: _Slot) -> bytes:
    """Return the metric of a birth, as a field of its payload."""
    spec, value, timestamp_ms = slot.spec, slot.value, slot.timestamp_ms
    if slot.properties is not None and spec.metadata is None:
        keys, values = slot.properties
        with suppress(MetricValueError, ValueError):  # which protobuf tells better
            more_keys, more_values = _quality_parts(slot.quality, slot.reason)
            raw = slot.template.declared(spec.name, value, timestamp_ms, keys + more_keys + values + more_values)
            if raw is not None:
                return raw
    metric = Metric(
        name=spec.name,
        value=value,
        datatype=spec.datatype,
        timestamp_ms=timestamp_ms,
        alias=slot.alias,
        is_transient=spec.is_transient,
        properties={**spec.property_set(), **quality_properties(slot.quality, slot.reason)},
        metadata=spec.metadata,
    )
    return encode(Payload(None, (metric,)))


def _parts(properties: PropertySet) -> tuple[bytes, bytes]:
    """The bytes of a property set: all keys come before all values."""
    keys, values = PropertySetMessage(), PropertySetMessage()
    write_properties(keys, properties)
    values.CopyFrom(keys)
    keys.ClearField("values")
    values.ClearField("keys")
    return keys.SerializeToString(), values.SerializeToString()


@lru_cache(maxsize=256)
def _quality_parts(quality: Quality, reason: str | None) -> tuple[bytes, bytes]:
    return _parts(quality_properties(quality, reason))


@lru_cache(maxsize=4096)
def _shared(parts: tuple[bytes, bytes]) -> tuple[bytes, bytes]:
    """The same object for equal properties: machines of one kind declare the same units and meanings."""
    return parts


def _property_parts(spec: MetricSpec) -> tuple[bytes, bytes] | None:
    """The parts of the declared properties; None where a birth has to put them together."""
    properties = spec.property_set()
    if QUALITY_PROPERTY in properties or REASON_PROPERTY in properties:
        return None
    try:
        return _shared(_parts(properties))
    except (MetricValueError, ValueError):
        return None  # the birth says what is wrong


def _oldest_first(changes: Sequence[Change]) -> Sequence[Change]:
    """Sorted by time; nearly always they are so already, and this lies on the hot path."""
    before = 0
    for change in changes:
        if change[2] < before:
            return sorted(changes, key=_time)
        before = change[2]
    return changes


def _time(change: Change) -> int:
    return change.timestamp_ms


def definition_metrics(definitions: Definitions, alias_of: Callable[[str], int], now_ms: int) -> tuple[Metric, ...]:
    """The template definitions of an NBIRTH, the only message that may carry them (6.4.15)."""
    return tuple(Metric(name, template, DataType.TEMPLATE, now_ms, alias_of(name)) for name, template in definitions.items())
