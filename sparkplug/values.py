"""The values that a metric can carry, as frozen Python values (Sparkplug 3.0.0, 6.4.6 to 6.4.15)."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import NamedTuple

from sparkplug.datatype import DataType
from sparkplug.errors import PayloadError


@dataclass(frozen=True, slots=True)
class DataSet:
    """A table: each column has a name and a basic datatype, each row has one cell a column.

    Raises PayloadError where names, types and cells do not agree in number, or a type is not a basic one
    (6.4.11: every column has exactly one type, every row as many cells as there are columns).

    >>> DataSet(("t", "load"), (DataType.INT64, DataType.DOUBLE), ((1, 37.5), (2, 38.0))).rows[1][1]
    38.0
    """

    columns: tuple[str, ...]
    types: tuple[DataType, ...]
    rows: tuple[tuple[Value, ...], ...]

    def __post_init__(self) -> None:
        if len(self.columns) != len(self.types):
            raise PayloadError(f"dataset has {len(self.columns)} columns and {len(self.types)} types; give each column one type")
        for column, datatype in zip(self.columns, self.types, strict=True):
            if not DataType.INT8 <= datatype <= DataType.TEXT:
                raise PayloadError(f"dataset column {column!r}: {datatype.name} is not a basic type; use INT8 to TEXT")
        for number, row in enumerate(self.rows):
            if len(row) != len(self.columns):
                raise PayloadError(f"dataset row {number} has {len(row)} cells for {len(self.columns)} columns")


class PropertyValue(NamedTuple):
    """A property's value with its type; `value` None is a null property."""

    datatype: DataType
    value: Value | Mapping[str, PropertyValue] | tuple[Mapping[str, PropertyValue], ...]


PropertySet = Mapping[str, PropertyValue]


class Parameter(NamedTuple):
    """A parameter of a template: a name, a basic type and its value (None = the definition states no default)."""

    name: str
    datatype: DataType
    value: Value


@dataclass(frozen=True, slots=True)
class Template:
    """A template definition (`ref` None) or an instance that names its definition (6.4.15).

    A definition carries its metrics with name and datatype and all of its parameters; an instance only names `ref`.
    """

    ref: str | None
    metrics: tuple[Metric, ...]
    parameters: tuple[Parameter, ...] = ()
    version: str | None = None
    is_definition: bool = False

    def __post_init__(self) -> None:
        if self.is_definition and self.ref is not None:
            raise PayloadError(f"template definition names the template {self.ref!r}; a definition refers to none: ref=None")
        if not self.is_definition and not self.ref:
            raise PayloadError("template instance names no definition; give the definition's metric name as ref")
        for parameter in self.parameters:
            if not parameter.name or not DataType.INT8 <= parameter.datatype <= DataType.TEXT:
                raise PayloadError(
                    f"template parameter {parameter.name!r} of type {parameter.datatype.name}: needs a name and a basic type"
                )


@dataclass(frozen=True, slots=True)
class MetaData:
    """Metadata of a BYTES or FILE value (6.4.8)."""

    is_multi_part: bool | None = None
    content_type: str | None = None
    size: int | None = None
    seq: int | None = None
    file_name: str | None = None
    file_type: str | None = None
    md5: str | None = None
    description: str | None = None


Value = None | bool | int | float | str | bytes | tuple[int, ...] | tuple[float, ...] | tuple[str, ...] | DataSet | Template


@dataclass(frozen=True, slots=True)
class Metric:
    """One metric of a payload. `value` None is a null; `datatype` None means that the birth certificate tells it."""

    name: str | None
    value: Value
    datatype: DataType | None = None
    timestamp_ms: int | None = None
    alias: int | None = None
    is_historical: bool = False
    is_transient: bool = False
    properties: PropertySet = field(default_factory=dict)
    metadata: MetaData | None = None


@dataclass(frozen=True, slots=True)
class Payload:
    """One Sparkplug message body (6.4.3)."""

    timestamp_ms: int | None
    metrics: tuple[Metric, ...] = ()
    seq: int | None = None
    uuid: str | None = None
    body: bytes | None = None
