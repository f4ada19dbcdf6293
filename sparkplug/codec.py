"""Payloads to bytes and back (Sparkplug 3.0.0, 6.4).

`encode` refuses what the specification forbids; `decode` accepts what sloppy peers send as far as it has one meaning: a whole
number in the wrong field, a data metric without a datatype (then `types`, from the birth certificate, tells it).
"""

from collections.abc import Callable
from typing import Any

from google.protobuf.message import DecodeError

from sparkplug.datatype import FIELD, DataType
from sparkplug.errors import MetricValueError, PayloadError
from sparkplug.schema import PayloadMessage
from sparkplug.values import (
    DataSet,
    MetaData,
    Metric,
    Parameter,
    Payload,
    PropertySet,
    PropertyValue,
    Template,
    Value,
)
from sparkplug.wire_value import READ, WRITE

PAYLOAD_BYTES_MAX = 4 * 1024 * 1024
TEMPLATE_DEPTH_MAX = 16
# Metrics, properties, rows, cells and parameters of one payload. An empty one takes two bytes on the wire, and a hundred times
# that here; what is smaller than COUNTED_BYTES_MIN cannot hold too many.
PARTS_MAX = 100_000
COUNTED_BYTES_MIN = 64 * 1024
_METADATA = ("is_multi_part", "content_type", "size", "seq", "file_name", "file_type", "md5", "description")
# A field that holds a value of its own shape; every other one is a scalar or packed bytes.
_GUESS = {
    "int_value": DataType.UINT32,
    "long_value": DataType.UINT64,
    "float_value": DataType.FLOAT,
    "double_value": DataType.DOUBLE,
    "boolean_value": DataType.BOOLEAN,
    "string_value": DataType.STRING,
    "bytes_value": DataType.BYTES,
    "dataset_value": DataType.DATASET,
    "template_value": DataType.TEMPLATE,
}
_DATATYPES = {datatype.value: datatype for datatype in DataType}
TypeOf = Callable[[str | None, int | None], DataType | None]


def encode(payload: Payload) -> bytes:
    """The bytes of a payload; raises PayloadError, naming the metric, where a rule or a range is broken."""
    message = PayloadMessage()
    for metric in payload.metrics:
        try:
            write_metric(message.metrics.add(), metric)
        except ValueError as error:
            raise PayloadError(f"metric {metric.name or metric.alias!r}: name, alias, time or metadata: {error}") from error
    try:
        if payload.timestamp_ms is not None:
            message.timestamp = payload.timestamp_ms
        if payload.seq is not None:
            message.seq = payload.seq
        if payload.uuid is not None:
            message.uuid = payload.uuid
        if payload.body is not None:
            message.body = payload.body
    except ValueError as error:
        raise PayloadError(f"payload of {payload.timestamp_ms} ms, seq {payload.seq}: {error}") from error
    data: bytes = message.SerializeToString()
    return data


def parse(data: bytes) -> Any:
    """The protobuf message behind `data`; raises PayloadError where it is none, or too large, or has too many parts."""
    if len(data) > PAYLOAD_BYTES_MAX:
        raise PayloadError(f"payload of {len(data)} bytes is above the limit of {PAYLOAD_BYTES_MAX}")
    try:
        message = PayloadMessage.FromString(data)
    except DecodeError as error:
        raise PayloadError(f"{len(data)} bytes are no Sparkplug payload: {error}") from error
    if len(data) > COUNTED_BYTES_MIN:
        _check_parts(message)
    return message


def _check_parts(payload: Any) -> None:
    left = PARTS_MAX - len(payload.metrics)
    owners: list[Any] = [payload]  # what has metrics that are still to be looked into
    sets: list[Any] = []  # and what has properties
    while (owners or sets) and left >= 0:
        if sets:
            properties = sets.pop()
            left -= len(properties.keys) + len(properties.values)
            for value in properties.values if left >= 0 else ():
                if value.HasField("propertyset_value"):
                    sets.append(value.propertyset_value)
                elif value.HasField("propertysets_value"):
                    left -= len(value.propertysets_value.propertyset)
                    sets += value.propertysets_value.propertyset
            continue
        for metric in owners.pop().metrics:
            if metric.HasField("properties"):
                sets.append(metric.properties)
            if metric.HasField("dataset_value"):
                table = metric.dataset_value
                left -= len(table.columns) + len(table.types) + len(table.rows)
                left -= sum(len(row.elements) for row in table.rows) if left >= 0 else 0
            elif metric.HasField("template_value"):
                left -= len(metric.template_value.metrics) + len(metric.template_value.parameters)
                owners.append(metric.template_value)
            if left < 0:
                break
    if left < 0:
        raise PayloadError(f"payload of more than {PARTS_MAX} metrics, properties, rows and cells")


def decode(data: bytes, type_of: TypeOf | None = None) -> Payload:
    """The payload behind `data`; `type_of(name, alias)` tells the datatype of metrics that carry none."""
    message = parse(data)
    return Payload(
        timestamp_ms=message.timestamp if message.HasField("timestamp") else None,
        metrics=tuple(read_metric(metric, type_of) for metric in message.metrics),
        seq=message.seq if message.HasField("seq") else None,
        uuid=message.uuid if message.HasField("uuid") else None,
        body=message.body if message.HasField("body") else None,
    )


def write_metric(out: Any, metric: Metric) -> None:
    """Fill a protobuf metric."""
    if metric.name is not None:
        out.name = metric.name
    if metric.alias is not None:
        out.alias = metric.alias
    if metric.timestamp_ms is not None:
        out.timestamp = metric.timestamp_ms
    if metric.datatype is not None:
        out.datatype = metric.datatype
    if metric.is_historical:
        out.is_historical = True
    if metric.is_transient:
        out.is_transient = True
    if metric.metadata is not None:
        for name in _METADATA:
            if (field := getattr(metric.metadata, name)) is not None:
                setattr(out.metadata, name, field)
    if metric.properties:
        write_properties(out.properties, metric.properties)
    if metric.value is None:
        out.is_null = True
        return
    if metric.datatype is None:
        raise MetricValueError(f"metric {metric.name or metric.alias!r}: a value needs a datatype")
    try:
        write_value(out, metric.datatype, metric.value)
    except MetricValueError as error:
        raise MetricValueError(f"metric {metric.name or metric.alias!r}: {error}") from error


def write_value(out: Any, datatype: DataType, value: Any) -> None:
    """Set the value of a protobuf metric, parameter, property or cell."""
    write = WRITE.get(datatype)
    if write is not None:
        try:
            setattr(out, FIELD[datatype], write(value))
        except AttributeError as error:  # properties, parameters and cells have fields for basic types only
            raise MetricValueError(f"{datatype.name} cannot be the type of this value") from error
    elif datatype is DataType.DATASET:
        _write_dataset(out.dataset_value, value)
    elif datatype is DataType.TEMPLATE:
        _write_template(out.template_value, value)
    else:
        raise MetricValueError(f"{datatype.name} cannot be the type of this value")


def _write_dataset(out: Any, value: Any) -> None:
    if not isinstance(value, DataSet):
        raise MetricValueError(f"{value!r:.80} is not a DataSet")
    out.num_of_columns = len(value.columns)
    out.columns.extend(value.columns)
    out.types.extend(value.types)
    for row in value.rows:
        elements = out.rows.add().elements
        for datatype, cell in zip(value.types, row, strict=True):
            element = elements.add()
            if cell is not None:
                write_value(element, datatype, cell)


def _write_template(out: Any, value: Any) -> None:
    if not isinstance(value, Template):
        raise MetricValueError(f"{value!r:.80} is not a Template")
    out.is_definition = value.is_definition
    if value.ref is not None:
        out.template_ref = value.ref
    if value.version is not None:
        out.version = value.version
    for metric in value.metrics:
        write_metric(out.metrics.add(), metric)
    for parameter in value.parameters:
        field = out.parameters.add(name=parameter.name, type=parameter.datatype)
        if parameter.value is not None:
            write_value(field, parameter.datatype, parameter.value)


def write_properties(out: Any, properties: PropertySet) -> None:
    """Fill a protobuf property set: as many keys as values, each value with its type."""
    for key, (datatype, value) in properties.items():
        out.keys.append(key)
        field = out.values.add(type=datatype)
        if value is None:
            field.is_null = True
        elif datatype is DataType.PROPERTY_SET and isinstance(value, dict):
            field.propertyset_value.SetInParent()  # an empty set is a value, too
            write_properties(field.propertyset_value, value)
        elif datatype is DataType.PROPERTY_SET_LIST and isinstance(value, tuple):
            field.propertysets_value.SetInParent()
            for item in value:
                write_properties(field.propertysets_value.propertyset.add(), item)  # type: ignore[arg-type]
        else:
            write_value(field, datatype, value)


def read_metric(metric: Any, type_of: TypeOf | None = None, depth: int = 0) -> Metric:
    """The frozen value of a protobuf metric."""
    name = READ[DataType.STRING](metric.name) if metric.HasField("name") else None
    alias = metric.alias if metric.HasField("alias") else None
    datatype = datatype_of(metric.datatype) if metric.HasField("datatype") else None
    known = datatype or (type_of(name, alias) if type_of is not None else None)
    metadata = metric.metadata if metric.HasField("metadata") else None
    return Metric(
        name=name,
        value=read_value(metric, known, depth),
        datatype=known,
        timestamp_ms=metric.timestamp if metric.HasField("timestamp") else None,
        alias=alias,
        is_historical=metric.is_historical,
        is_transient=metric.is_transient,
        properties=read_properties(metric.properties) if metric.HasField("properties") else {},
        metadata=None
        if metadata is None
        else MetaData(**{n: getattr(metadata, n) if metadata.HasField(n) else None for n in _METADATA}),
    )


def datatype_of(code: int) -> DataType:
    """The datatype with this code; raises PayloadError for a code that 3.0.0 does not know."""
    datatype = _DATATYPES.get(code)
    if datatype is None:
        raise PayloadError(f"datatype {code} is not one of Sparkplug 3.0.0 (1 to 34)")
    return datatype


def read_value(field: Any, datatype: DataType | None, depth: int = 0) -> Value:
    """The Python value of a protobuf metric, parameter, property or cell; None where it is null or carries no value."""
    which = field.WhichOneof("value")
    if which is None or getattr(field, "is_null", False):
        return None
    value = getattr(field, which)
    if datatype is None or datatype is DataType.UNKNOWN:
        if which not in _GUESS:
            raise PayloadError(f"a value without a datatype came in the field {which}")
        datatype = _GUESS[which]
    if which == "dataset_value":
        return _read_dataset(value)
    if which == "template_value":
        return _read_template(value, depth + 1)
    expected = FIELD.get(datatype)
    if expected != which and {expected, which} != {"int_value", "long_value"}:
        raise PayloadError(f"a {datatype.name} came in the field {which}")
    decoded: Value = READ[datatype](value)
    return decoded


def _read_dataset(message: Any) -> DataSet:
    types = tuple(datatype_of(code) for code in message.types)
    rows = []
    for row in message.rows:
        if len(row.elements) != len(types):
            raise PayloadError(f"dataset row has {len(row.elements)} cells for {len(types)} columns")
        rows.append(tuple(read_value(cell, datatype) for cell, datatype in zip(row.elements, types, strict=True)))
    return DataSet(tuple(message.columns), types, tuple(rows))


def _read_template(message: Any, depth: int) -> Template:
    if depth > TEMPLATE_DEPTH_MAX:
        raise PayloadError(f"templates are nested deeper than {TEMPLATE_DEPTH_MAX}")
    parameters = []
    for parameter in message.parameters:
        datatype = datatype_of(parameter.type)
        parameters.append(Parameter(parameter.name, datatype, read_value(parameter, datatype)))
    return Template(
        ref=message.template_ref if message.HasField("template_ref") else None,
        metrics=tuple(read_metric(metric, None, depth) for metric in message.metrics),
        parameters=tuple(parameters),
        version=message.version if message.HasField("version") else None,
        is_definition=message.is_definition,
    )


def read_properties(message: Any, depth: int = 0) -> PropertySet:
    """The property set of a protobuf message; raises PayloadError where keys and values differ in number."""
    if len(message.keys) != len(message.values):
        raise PayloadError(f"property set has {len(message.keys)} keys and {len(message.values)} values")
    if depth > TEMPLATE_DEPTH_MAX:
        raise PayloadError(f"property sets are nested deeper than {TEMPLATE_DEPTH_MAX}")
    properties = {}
    for key, field in zip(message.keys, message.values, strict=True):
        datatype = datatype_of(field.type)
        value: Any
        if field.is_null:
            value = None
        elif datatype is DataType.PROPERTY_SET:
            value = read_properties(field.propertyset_value, depth + 1)
        elif datatype is DataType.PROPERTY_SET_LIST:
            value = tuple(read_properties(item, depth + 1) for item in field.propertysets_value.propertyset)
        else:
            value = read_value(field, datatype)
        properties[key] = PropertyValue(datatype, value)
    return properties
