"""What Grafana takes as a dashboard, as JSON schema: made of the types of Grafana's own SDK.

They are generated from Grafana's schemas. Unlike its JSON schema of dashboards, which leaves them open, they also say what
options and what field configuration each kind of panel has; so these are checked too.
"""

import ast
import enum
import inspect
import textwrap
import types
import typing
import warnings
from collections.abc import Iterator
from functools import cache
from typing import Any

from jsonschema import Draft7Validator
from jsonschema.exceptions import best_match

with warnings.catch_warnings():
    warnings.simplefilter("ignore", DeprecationWarning)  # the SDK says so at import, of the form of dashboards that we write
    from grafana_foundation_sdk.models import common, dashboard, prometheus, stat, statetimeline, timeseries, units

Schema = dict[str, Any]
PLAIN = {str: "string", int: "integer", bool: "boolean", float: "number"}
PANELS: dict[str, tuple[type, type | None]] = {
    "timeseries": (timeseries.Options, common.GraphFieldConfig),
    "state-timeline": (statetimeline.Options, statetimeline.FieldConfig),
    "stat": (stat.Options, None),
}
UNITS = {value for name, value in vars(units).items() if not name.startswith("_") and isinstance(value, str)}
INFLUX: Schema = {
    "type": "object",
    "additionalProperties": False,
    "required": ["datasource", "query", "rawQuery", "refId"],
    "properties": {
        **{name: {"type": "string"} for name in ("query", "refId", "alias", "titleColumn", "textColumn", "tagsColumn")},
        "resultFormat": {"enum": ["time_series", "table", "logs"]},
        **{name: {"type": "boolean"} for name in ("rawQuery", "fromAnnotations")},
        "datasource": {"type": "object"},
    },
}


def _keys(model: type) -> Iterator[tuple[str, str, bool]]:
    """The JSON key, the attribute, and whether it is always there, of each field that `to_json` writes."""
    tree = ast.parse(textwrap.dedent(inspect.getsource(model.to_json)))  # type: ignore[attr-defined]
    for node in ast.walk(tree):
        if isinstance(node, ast.Dict):
            for key, value in zip(node.keys, node.values, strict=True):
                if isinstance(key, ast.Constant) and isinstance(value, ast.Attribute):
                    yield key.value, value.attr, True
            continue
        target = node.targets[0] if isinstance(node, ast.Assign) and isinstance(node.value, ast.Attribute) else None
        if isinstance(target, ast.Subscript) and isinstance(target.slice, ast.Constant):
            yield target.slice.value, node.value.attr, False


def _schema(kind: Any, definitions: dict[str, Schema]) -> Schema:
    if kind in PLAIN:
        return {"type": PLAIN[kind]}
    origin, parts = typing.get_origin(kind), typing.get_args(kind)
    if origin in (typing.Union, types.UnionType):
        return {"anyOf": [_schema(part, definitions) for part in parts]}
    if kind is type(None):
        return {"type": "null"}
    if origin is typing.Literal:
        return {"enum": list(parts)}
    if origin is list:
        return {"type": "array", "items": _schema(parts[0], definitions)}
    if origin is dict:
        return {"type": "object", "additionalProperties": _schema(parts[1], definitions)}
    if isinstance(kind, type) and issubclass(kind, enum.Enum):
        return {"enum": [member.value for member in kind]}
    if isinstance(kind, type) and hasattr(kind, "from_json"):
        name = f"{kind.__module__}.{kind.__qualname__}".replace("grafana_foundation_sdk.models.", "")
        if name not in definitions:
            definitions[name] = {}  # so that a type that holds itself comes to an end
            definitions[name] = _of_model(kind, definitions)
        return {"$ref": f"#/definitions/{name}"}
    return {}


def _of_model(model: type, definitions: dict[str, Schema]) -> Schema:
    hints = typing.get_type_hints(model.__init__)
    keys = list(_keys(model))
    assert keys, model
    return {
        "type": "object",
        "additionalProperties": False,
        "required": [key for key, attribute, always in keys if always and attribute in hints],
        # What no argument sets is a constant, like the `type` of a link.
        "properties": {key: _schema(hints.get(attribute), definitions) for key, attribute, _ in keys},
    }


@cache
def of(model: type) -> Schema:
    """The schema of a type of the SDK: its keys and no others, each of its type."""
    definitions: dict[str, Schema] = {}
    return {**_of_model(model, definitions), "definitions": definitions}


def _complaints(value: Any, schema: Schema, where: str) -> Iterator[str]:
    for found in Draft7Validator(schema).iter_errors(value):
        error = best_match([found])
        yield f"{where} {error.json_path}: {error.message[:200]}"


def _unit(unit: str | None) -> bool:
    return unit is None or unit in UNITS or unit.startswith(("suffix:", "prefix:"))


def _of_panel(panel: dict[str, Any]) -> Iterator[str]:
    where = f"panel {panel.get('title')}"
    if panel["type"] not in PANELS:
        yield f"{where}: {panel['type']} is no kind of panel that we use"
        return
    options, custom = PANELS[panel["type"]]
    yield from _complaints(panel.get("options", {}), of(options), f"{where} options")
    defaults = panel["fieldConfig"]["defaults"]
    custom_schema = of(custom) if custom else {"type": "object", "maxProperties": 0}
    yield from _complaints(defaults.get("custom", {}), custom_schema, f"{where} custom")
    known = {*of(dashboard.FieldConfig)["properties"], *(f"custom.{key}" for key in custom_schema.get("properties", {}))}
    given = [(one["id"], one["value"]) for override in panel["fieldConfig"]["overrides"] for one in override["properties"]]
    yield from (f"{where}: overrides {name}, which there is not" for name, _ in given if name not in known)
    for unit in (defaults.get("unit"), *(value for name, value in given if name == "unit")):
        if not _unit(unit):
            yield f"{where}: {unit} is no unit of Grafana"
    for target in panel["targets"]:
        yield from _complaints(target, target_schema(target), f"{where} target")


def target_schema(target: dict[str, Any]) -> Schema:
    """The schema of a query, by the kind of its data source. The SDK has none for InfluxDB: ours."""
    return INFLUX if target["datasource"]["type"] == "influxdb" else of(prometheus.Dataquery)


def complaints(document: dict[str, Any]) -> list[str]:
    """Return what is wrong with a dashboard; nothing = []."""
    found = list(_complaints(document, of(dashboard.Dashboard), "dashboard"))
    for panel in document.get("panels", []):
        found += _of_panel(panel)
    for mark in document.get("annotations", {}).get("list", []):
        found += _complaints(mark["target"], target_schema(mark["target"]), "annotation")
    return found
