"""The metrics that a pairing exchanges, the same for all peers: one of each scalar type at each of its limits, and what else the
checks need. A metric is a line of the language of process.py; `our_value` is what it stands for with us.
"""

from __future__ import annotations

import struct
from typing import Any

from sparkplug.datatype import BINARIES, SIGNED_BITS, UNSIGNED_BITS, DataType
from sparkplug.metric import MetricSpec
from sparkplug.values import DataSet, Metric, Template, Value

Line = dict[str, Any]

SCALARS: dict[str, tuple[str, ...]] = {
    "Int8": ("-128", "127"),
    "Int16": ("-32768", "32767"),
    "Int32": ("-2147483648", "2147483647"),
    "Int64": ("-9223372036854775808", "9223372036854775807"),
    "UInt8": ("0", "255"),
    "UInt16": ("0", "65535"),
    "UInt32": ("0", "4294967295"),
    "UInt64": ("0", "18446744073709551615"),
    "Float": ("-1.5", "3.4028234663852886e+38"),
    "Double": ("0.1", "-1.7976931348623157e+308"),
    "Boolean": ("true", "false"),
    "String": ("", "G01 X-12.5 Größe 刀具"),
    "DateTime": ("0", "1750000000123"),
    "Text": ("", "two\nlines"),
    "UUID": ("00112233-4455-6677-8899-aabbccddeeff",),
    "Bytes": ("00ff80",),
}
TABLE: Line = {"columns": ["tool", "length", "name"], "types": ["Int64", "Double", "String"], "rows": [["7", "120.5", "drill"]]}
AXIS: Line = {"definition": True, "metrics": [{"name": "load", "type": "Double", "value": "0.0"}]}
X_AXIS: Line = {"definition": False, "ref": "Axis", "metrics": [{"name": "load", "type": "Double", "value": "37.5"}]}

PART: Line = {"name": "part", "type": "Int32", "value": "0", "alias": 101, "unit": "pieces"}
BY_NAME: Line = {"name": "by name", "type": "Double", "value": "0.5"}
NOTHING: Line = {"name": "nothing", "type": "Int64", "value": None, "alias": 102}
OFFSETS: Line = {"name": "offsets", "type": "DataSet", "value": TABLE, "alias": 103}
DEFINITION: Line = {"name": "Axis", "type": "Template", "value": AXIS}
INSTANCE: Line = {"name": "x axis", "type": "Template", "value": X_AXIS, "alias": 104}
NODE_PART: Line = {"name": "part", "type": "Int32", "value": "-1", "alias": 105}


def scalars(without: tuple[str, ...]) -> list[Line]:
    """Return a metric for each limit of each scalar type."""
    lines = [(kind, at, text) for kind, texts in SCALARS.items() if kind not in without for at, text in enumerate(texts)]
    return [{"name": f"{kind}/{at}", "type": kind, "value": text, "alias": i} for i, (kind, at, text) in enumerate(lines, 1)]


def datatype_of(line: Line) -> DataType:
    """Return the datatype of a line."""
    return DataType[line["type"].upper()]


def our_value(line: Line) -> Value:
    """Return the value of a line as ours has it."""
    kind, value = datatype_of(line), line["value"]
    if value is None:
        return None
    if kind in SIGNED_BITS or kind in UNSIGNED_BITS:
        return int(value)
    if kind in (DataType.FLOAT, DataType.DOUBLE):
        return float(value)
    if kind is DataType.BOOLEAN:
        return bool(value == "true")
    if kind in BINARIES:
        return bytes.fromhex(value)
    if kind is DataType.DATASET:
        types = tuple(DataType[name.upper()] for name in value["types"])
        rows = tuple(
            tuple(our_value({"type": t, "value": cell}) for t, cell in zip(value["types"], row, strict=True))
            for row in value["rows"]
        )
        return DataSet(tuple(value["columns"]), types, rows)
    if kind is DataType.TEMPLATE:
        members = tuple(Metric(member["name"], our_value(member), datatype_of(member)) for member in value["metrics"])
        return Template(value.get("ref"), members, version="1", is_definition=value["definition"])
    return str(value)


def spec_of(line: Line) -> MetricSpec:
    """Return what an edge node of ours declares for a line."""
    return MetricSpec(line["name"], datatype_of(line), unit=line.get("unit"), value=our_value(line))


def agree(line: Line, heard: Line) -> bool:
    """Return True where what a peer says of a metric is what the line states: the same value, whatever its digits."""
    if line["value"] is None or heard["value"] is None or isinstance(line["value"], dict):
        return bool(line["value"] == heard["value"])
    try:
        if datatype_of(line) is DataType.FLOAT:  # told in as many digits as tell one 32-bit number from the next
            return struct.pack("<f", float(line["value"])) == struct.pack("<f", float(heard["value"]))
        return our_value(line) == our_value({**line, "value": heard["value"]})
    except ValueError:
        return False
