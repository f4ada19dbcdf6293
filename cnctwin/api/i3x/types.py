"""Namespaces, object types and relationship types: what i3X clients need before they read anything of a plant.

A signal's type is that of its name: in the vocabulary, or in the declaration of the processor that publishes it. A metric that
neither knows is a `SparkplugMetric`: a scalar of whatever kind its device says.
"""

from collections.abc import Iterator
from functools import cache
from typing import Any, NamedTuple

from cnctwin.api.fleet import SHOWN
from cnctwin.api.value_object import Plain
from processors.outputs import declared_outputs, kind_of
from twin.vocabulary.signals import AXES, CHOSEN, PLC_PREFIX, SIGNALS, VARIABLE_PREFIX, Kind
from twin.vocabulary.twin_signals import live_name

I3X = "https://cesmii.org/i3x"
VOCABULARY = "urn:cnctwin:vocabulary"
SPARKPLUG = "https://sparkplug.eclipse.org/specification/?projection=cnctwin"
NAMESPACES = (
    {"uri": I3X, "displayName": "i3X"},
    {"uri": VOCABULARY, "displayName": "cnctwin: machines and their signals"},
    {"uri": SPARKPLUG, "displayName": "Sparkplug B: metrics outside the vocabulary"},
)
VERSION = "1.0.0"
PLANT, MACHINE, METRIC = "type/Plant", "type/Machine", "type/SparkplugMetric"
_OF_KIND = {Kind.NUMBER: "number", Kind.INTEGER: "integer", Kind.TEXT: "string", Kind.FLAG: "boolean"}


class ObjectType(NamedTuple):
    """One object type. `source_id` is its name where it is defined."""

    element_id: str
    display_name: str
    namespace: str
    source_id: str
    schema: dict[str, Any]

    def as_json(self) -> dict[str, Any]:
        """Return it as the interface gives it."""
        return {
            "elementId": self.element_id,
            "displayName": self.display_name,
            "namespaceUri": self.namespace,
            "sourceTypeId": self.source_id,
            "version": VERSION,
            "schema": self.schema,
        }

    def holds(self, value: Plain) -> bool:
        """Return True if a scalar is one of this type's."""
        kinds = self.schema["type"]
        return any(_is(value, kind) for kind in ([kinds] if isinstance(kinds, str) else kinds))


_METRIC = ObjectType(
    METRIC,
    "Sparkplug metric",
    SPARKPLUG,
    "Metric",
    {
        "type": ["boolean", "number", "string"],
        "description": "a metric that is not in the vocabulary; its unit, if any, is its device's",
    },
)


def relationship_types() -> list[dict[str, Any]]:
    """Return the four relationship types that the guide defines, each with its reverse."""
    pairs = (("HasParent", "HasChildren"), ("HasComponent", "ComponentOf"))
    return [
        {"elementId": name, "displayName": name, "namespaceUri": I3X, "relationshipId": name, "reverseOf": reverse}
        for pair in pairs
        for name, reverse in (pair, pair[::-1])
    ]


@cache
def object_types() -> dict[str, ObjectType]:
    """Return all object types by element id. They do not depend on the plant."""
    signals = {one.element_id: one for one in _signal_types()}
    properties = {title: {"type": [*_kinds(type_of(name, signals)), "null"]} for title, name in SHOWN.items()}
    machine = {"type": "object", "properties": {"online": {"type": "boolean"}, **properties}, "required": ["online"]}
    plant = {
        "type": "object",
        "properties": {"machines": {"type": "array", "items": {"type": "string"}}},
        "required": ["machines"],
    }
    return {
        PLANT: ObjectType(PLANT, "Plant", VOCABULARY, "Plant", plant),
        MACHINE: ObjectType(MACHINE, "Machine", VOCABULARY, "Machine", machine),
        **signals,
        METRIC: _METRIC,
    }


def type_of(signal: str, known: dict[str, ObjectType] | None = None) -> ObjectType:
    """Return the object type of a machine's signal.

    >>> [type_of(name).element_id for name in ("spindle_rpm", "axis_x_pos_mm", "plc_door", "coolant level")]
    ['type/spindle_rpm', 'type/axis_pos_mm', 'type/plc', 'type/SparkplugMetric']
    """
    types = object_types() if known is None else known
    name = live_name(signal) or signal
    if any(pattern.fullmatch(name) for pattern, _ in AXES):
        name = _axis_name(name)
    elif any(pattern.fullmatch(name) for pattern, _ in CHOSEN):
        name = name.partition("_")[0]
    return types.get(f"type/{name}", _METRIC)


def _signal_types() -> Iterator[ObjectType]:
    for signal in SIGNALS.values():
        yield _signal_type(signal.name, _OF_KIND[signal.kind], signal.unit, signal.meaning)
    for pattern, signal in AXES:
        yield _signal_type(_axis_name(pattern.pattern), _OF_KIND[signal.kind], signal.unit, signal.meaning)
    for prefix, (_, signal) in zip((VARIABLE_PREFIX, PLC_PREFIX), CHOSEN, strict=True):
        name = prefix.removesuffix("_")
        schema = {"type": ["boolean", "number"], "description": signal.meaning}
        yield ObjectType(f"type/{name}", name, VOCABULARY, name, schema)
    for output in declared_outputs().values():
        yield _signal_type(output.name, _OF_KIND[kind_of(output)], output.unit or "", output.meaning)


def _signal_type(name: str, kind: str, unit: str, meaning: str) -> ObjectType:
    schema = {"type": kind, "description": meaning} | ({"unit": unit} if unit else {})
    return ObjectType(f"type/{name}", name.replace("_", " "), VOCABULARY, name, schema)


def _axis_name(name: str) -> str:
    return f"axis_{name.split('_', 2)[2]}"


def _kinds(of: ObjectType) -> list[str]:
    kinds = of.schema["type"]
    return [kinds] if isinstance(kinds, str) else list(kinds)


def _is(value: Plain, kind: str) -> bool:
    if isinstance(value, bool) or kind == "boolean":
        return isinstance(value, bool) and kind == "boolean"
    if kind == "string":
        return isinstance(value, str)
    return isinstance(value, int) or (isinstance(value, float) and (kind == "number" or value.is_integer()))
