"""The protobuf message types of a Sparkplug B payload, as tables.

Source: Sparkplug 3.0.0, 6.4 (names and numbers of the fields). Written as tables rather than generated code, so that the whole
schema is one screen and the package needs no protobuf compiler. Extension ranges keep unknown extensions intact.
"""

from typing import Any

from google.protobuf import descriptor_pb2, descriptor_pool, message_factory

_F = descriptor_pb2.FieldDescriptorProto
_TYPES = {
    "string": _F.TYPE_STRING,
    "bytes": _F.TYPE_BYTES,
    "uint32": _F.TYPE_UINT32,
    "uint64": _F.TYPE_UINT64,
    "float": _F.TYPE_FLOAT,
    "double": _F.TYPE_DOUBLE,
    "bool": _F.TYPE_BOOL,
}
_SCALARS = "{0} uint32 int_value|{1} uint64 long_value|{2} float float_value|{3} double double_value"
_SCALARS += "|{4} bool boolean_value|{5} string string_value"

# message: (fields "number type name", "*" = repeated; fields of the oneof "value"; first number of the extensions)
_MESSAGES: dict[str, tuple[str, str, int]] = {
    "Parameter": ("1 string name|2 uint32 type", _SCALARS.format(3, 4, 5, 6, 7, 8), 9),
    "Template": (
        "1 string version|2 *Metric metrics|3 *Parameter parameters|4 string template_ref|5 bool is_definition",
        "",
        6,
    ),
    "DataSetValue": ("", _SCALARS.format(1, 2, 3, 4, 5, 6), 7),
    "Row": ("1 *DataSetValue elements", "", 2),
    "DataSet": ("1 uint64 num_of_columns|2 *string columns|3 *uint32 types|4 *Row rows", "", 5),
    "PropertyValue": (
        "1 uint32 type|2 bool is_null",
        _SCALARS.format(3, 4, 5, 6, 7, 8) + "|9 PropertySet propertyset_value|10 PropertySetList propertysets_value",
        11,
    ),
    "PropertySet": ("1 *string keys|2 *PropertyValue values", "", 3),
    "PropertySetList": ("1 *PropertySet propertyset", "", 2),
    "MetaData": (
        "1 bool is_multi_part|2 string content_type|3 uint64 size|4 uint64 seq|5 string file_name|6 string file_type"
        "|7 string md5|8 string description",
        "",
        9,
    ),
    "Metric": (
        "1 string name|2 uint64 alias|3 uint64 timestamp|4 uint32 datatype|5 bool is_historical|6 bool is_transient"
        "|7 bool is_null|8 MetaData metadata|9 PropertySet properties",
        _SCALARS.format(10, 11, 12, 13, 14, 15) + "|16 bytes bytes_value|17 DataSet dataset_value|18 Template template_value",
        19,
    ),
    "Payload": ("1 uint64 timestamp|2 *Metric metrics|3 uint64 seq|4 string uuid|5 bytes body", "", 6),
}
_EXTENSIONS_END = 536_870_912  # protobuf's largest field number plus one


def _add_field(message: descriptor_pb2.DescriptorProto, text: str, oneof: int | None) -> None:
    number, type_name, name = text.split()
    repeated = type_name.startswith("*")
    type_name = type_name.lstrip("*")
    field = message.field.add(name=name, number=int(number))
    field.label = _F.LABEL_REPEATED if repeated else _F.LABEL_OPTIONAL
    if type_name in _TYPES:
        field.type = _TYPES[type_name]
    else:
        field.type = _F.TYPE_MESSAGE
        field.type_name = f".cnctwin.sparkplug_b.{type_name}"
    if oneof is not None:
        field.oneof_index = oneof


def _file() -> descriptor_pb2.FileDescriptorProto:
    file = descriptor_pb2.FileDescriptorProto(name="cnctwin/sparkplug_b.proto", package="cnctwin.sparkplug_b", syntax="proto2")
    for name, (fields, oneof, extensions) in _MESSAGES.items():
        message = file.message_type.add(name=name)
        message.extension_range.add(start=extensions, end=_EXTENSIONS_END)
        for text in filter(None, fields.split("|")):
            _add_field(message, text, None)
        if oneof:
            message.oneof_decl.add(name="value")
            for text in oneof.split("|"):
                _add_field(message, text, 0)
    return file


# The classes are made at run time, so a type checker can know nothing of their fields.
_CLASSES: dict[str, Any] = message_factory.GetMessages([_file()], pool=descriptor_pool.DescriptorPool())
PayloadMessage: Any = _CLASSES["cnctwin.sparkplug_b.Payload"]
PropertySetMessage: Any = _CLASSES["cnctwin.sparkplug_b.PropertySet"]
