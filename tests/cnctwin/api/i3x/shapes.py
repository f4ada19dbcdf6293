"""The shapes of i3X's records, from the tables of its Implementation Guide (github.com/cesmii/i3X, spec/, at 02dedca)."""

from collections.abc import Mapping, Sequence
from typing import Any

import jsonschema

TEXT, FLAG, OPEN = {"type": "string"}, {"type": "boolean"}, {"type": "object"}
UTC = {"type": "string", "pattern": r"^\d{4}-\d{2}-\d{2}T\d{2}:\d{2}:\d{2}(\.\d+)?Z$"}
QUALITY = {"enum": ["Good", "GoodNoData", "Bad", "Uncertain"]}


def record(optional: Mapping[str, Any] | None = None, **required: Any) -> dict[str, Any]:
    """A record with these fields, and perhaps others."""
    return {"type": "object", "required": list(required), "properties": {**required, **(optional or {})}}


NAMESPACE = record(uri=TEXT, displayName=TEXT)
OBJECT_TYPE = record(
    {"version": TEXT}, elementId=TEXT, displayName=TEXT, namespaceUri=TEXT, sourceTypeId=TEXT, schema=record(type={})
)
RELATIONSHIP_TYPE = record(elementId=TEXT, displayName=TEXT, namespaceUri=TEXT, relationshipId=TEXT, reverseOf=TEXT)
METADATA = record(
    {"description": TEXT, "relationships": OPEN, "schemaExtensions": OPEN, "system": OPEN},
    typeNamespaceUri=TEXT,
    sourceTypeId=TEXT,
)
OBJECT = record(
    {"metadata": METADATA},
    elementId=TEXT,
    displayName=TEXT,
    typeElementId=TEXT,
    parentId={"type": ["string", "null"]},
    isComposition=FLAG,
    isExtended=FLAG,
)
RELATED = {"type": "array", "items": record(sourceRelationship=TEXT, object=OBJECT)}
VQT = {
    **record(value={}, quality=QUALITY, timestamp=UTC),
    "if": {"properties": {"quality": {"enum": ["Bad", "GoodNoData"]}}},
    "then": {"properties": {"value": {"type": "null"}}},
    "else": {"properties": {"value": {"not": {"type": "null"}}}},
}
CURRENT = {"allOf": [VQT, record({"components": {"type": "object", "additionalProperties": VQT}}, isComposition=FLAG)]}
PAST = record(isComposition=FLAG, values={"type": "array", "items": VQT})
UPDATE = {"allOf": [VQT, record(elementId=TEXT)]}
SYNC = {
    "type": "array",
    "items": record(sequenceNumber={"type": "integer", "minimum": 1}, updates={"type": "array", "items": UPDATE}),
}
CREATED = record(clientId=TEXT, subscriptionId=TEXT, displayName=TEXT)
SUBSCRIPTION = record(
    subscriptionId=TEXT,
    displayName=TEXT,
    monitoredObjects={"type": "array", "items": record(elementId=TEXT, maxDepth={"type": "integer"})},
)
INFO = record(
    {"serverVersion": TEXT, "serverName": TEXT},
    specVersion={"const": "1.0"},
    capabilities=record(query=record(history=FLAG), update=record(current=FLAG, history=FLAG), subscribe=record(stream=FLAG)),
)
DETAIL = record(title=TEXT, status={"type": "integer"}, detail=TEXT)
FAILURE = record(success={"const": False}, responseDetail=DETAIL)


def result_of(body: Any, shape: Mapping[str, Any]) -> Any:
    """The result of a success, which has this shape."""
    jsonschema.validate(body, record(success={"const": True}, result=shape))
    return body["result"]


def results_of(body: Any, ids: Sequence[str], shape: Mapping[str, Any], key: str = "elementId") -> list[Any]:
    """The entries of a bulk answer: as many as were asked for, in that order, None for each that failed with a 404."""
    entry = {
        "oneOf": [
            record(success={"const": True}, **{key: TEXT}, result=shape),
            {**FAILURE, "required": [*FAILURE["required"], key]},
        ]
    }
    jsonschema.validate(body, record(success=FLAG, results={"type": "array", "items": entry}))
    assert [one[key] for one in body["results"]] == list(ids)
    assert body["success"] is all(one["success"] for one in body["results"])
    assert {one["responseDetail"]["status"] for one in body["results"] if not one["success"]} <= {404}
    return [one.get("result") if one["success"] else None for one in body["results"]]


def failed(body: Any, status: int) -> str:
    """The sentence of a refusal."""
    jsonschema.validate(body, FAILURE)
    assert body["responseDetail"]["status"] == status
    return str(body["responseDetail"]["detail"])
