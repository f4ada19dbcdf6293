"""One of everything: a payload with all 34 datatypes at their edges, and strategies that make values of each."""

from __future__ import annotations

import math
from typing import Any

from hypothesis import strategies as st

from sparkplug.datatype import ARRAYS, SIGNED_BITS, UNSIGNED_BITS, DataType
from sparkplug.values import (
    DataSet,
    MetaData,
    Metric,
    Parameter,
    Payload,
    PropertyValue,
    Template,
)

EPOCH_MS = 1_750_000_000_000
FLOAT_MAX = 3.4028234663852886e38
FLOAT_TINY = 1.401298464324817e-45

TABLE = DataSet(
    ("i8", "u64", "f", "b", "s", "t", "when"),
    (
        DataType.INT8,
        DataType.UINT64,
        DataType.FLOAT,
        DataType.BOOLEAN,
        DataType.STRING,
        DataType.TEXT,
        DataType.DATETIME,
    ),
    ((-128, 2**64 - 1, 0.5, True, "", "Größe 2 €", 0), (None, None, None, None, None, None, None)),
)
DEFINITION = Template(
    ref=None,
    metrics=(Metric("position", None, DataType.DOUBLE), Metric("offsets", None, DataType.DATASET)),
    parameters=(
        Parameter("letter", DataType.STRING, "X"),
        Parameter("stroke", DataType.DOUBLE, None),
        Parameter("axis", DataType.INT8, -1),
    ),
    version="1.0",
    is_definition=True,
)
INSTANCE = Template(
    ref="Axis",
    metrics=(
        Metric("position", -0.0, DataType.DOUBLE, EPOCH_MS),
        Metric("offsets", TABLE, DataType.DATASET),
        Metric("inner", Template("Axis", (Metric("load", None, DataType.INT16),)), DataType.TEMPLATE),
    ),
    parameters=(Parameter("letter", DataType.STRING, "Y"),),
)

EDGES: dict[DataType, tuple[Any, ...]] = {
    **{t: (-(1 << bits - 1), -1, 0, 1, (1 << bits - 1) - 1) for t, bits in SIGNED_BITS.items()},
    **{t: (0, 1, 1 << bits - 1, (1 << bits) - 1) for t, bits in UNSIGNED_BITS.items()},
    DataType.FLOAT: (0.0, -0.0, 1.5, FLOAT_MAX, FLOAT_TINY, math.inf, -math.inf, math.nan),
    DataType.DOUBLE: (0.0, -0.0, 0.1, 1.7976931348623157e308, 5e-324, math.inf, -math.inf, math.nan),
    DataType.BOOLEAN: (False, True),
    DataType.STRING: ("", "ACTIVE", "a\0b", "Fräsen 機械 🛠"),
    DataType.TEXT: ("", "N10 G1 X1\nM6 T7\n"),
    DataType.UUID: ("123e4567-e89b-12d3-a456-426614174000",),
    DataType.DATASET: (TABLE, DataSet((), (), ()), DataSet(("a",), (DataType.INT32,), ())),
    DataType.BYTES: (b"", b"\0\xff" * 40),
    DataType.FILE: (b"%PDF",),
    DataType.TEMPLATE: (DEFINITION, INSTANCE),
    DataType.INT8_ARRAY: ((), (-23, 123), (-128, 127)),
    DataType.INT16_ARRAY: ((), (-30000, 30000), (-(2**15), 2**15 - 1)),
    DataType.INT32_ARRAY: ((), (-1, 315338746), (-(2**31), 2**31 - 1)),
    DataType.INT64_ARRAY: ((), (-4270929666821191986, -3601064768563266876), (-(2**63), 2**63 - 1)),
    DataType.UINT8_ARRAY: ((), (23, 250), (0, 255)),
    DataType.UINT16_ARRAY: ((), (30, 52360), (0, 2**16 - 1)),
    DataType.UINT32_ARRAY: ((), (52, 3293969225), (0, 2**32 - 1)),
    DataType.UINT64_ARRAY: ((), (52, 16444743074749521625), (0, 2**64 - 1)),
    DataType.FLOAT_ARRAY: ((), (1.5, -0.0, math.inf, -math.inf, math.nan)),
    DataType.DOUBLE_ARRAY: ((), (12.354213, 1022.9123213), (5e-324, math.nan)),
    DataType.BOOLEAN_ARRAY: ((), (True,), (False,) * 8, (False, False, True, True, False, True, False, False, True, True)),
    DataType.STRING_ARRAY: ((), ("ABC", "hello"), ("", "", "機械")),
    DataType.DATETIME_ARRAY: ((), (1256102875335, 1656107875000), (0,)),
}
PROPERTIES = {
    "Quality": PropertyValue(DataType.INT32, 500),
    "reason": PropertyValue(DataType.STRING, "edge node offline"),
    "engLow": PropertyValue(DataType.DOUBLE, -math.inf),
    "nothing": PropertyValue(DataType.STRING, None),
    "negative": PropertyValue(DataType.INT64, -1),
    "set": PropertyValue(DataType.PROPERTY_SET, {"inner": PropertyValue(DataType.PROPERTY_SET, {})}),
    "list": PropertyValue(DataType.PROPERTY_SET_LIST, ({"on": PropertyValue(DataType.BOOLEAN, False)}, {})),
}
METADATA = MetaData(True, "text/plain", 2**64 - 1, 0, "part.nc", "nc", "d41d8cd98f00b204e9800998ecf8427e", "a program")
EVERYTHING = Payload(
    EPOCH_MS,
    (
        *(
            Metric(f"{datatype.name}/{number}", value, datatype, EPOCH_MS, alias=1000 * datatype + number)
            for datatype, values in EDGES.items()
            for number, value in enumerate(values)
        ),
        *(Metric(f"{datatype.name}/null", None, datatype, EPOCH_MS) for datatype in EDGES),
        Metric(None, 1.0, DataType.DOUBLE, alias=0),
        Metric("flags", b"M6", DataType.FILE, 0, 2**64 - 1, is_historical=True, is_transient=True, metadata=METADATA),
        Metric("properties", 1, DataType.INT8, properties=PROPERTIES),
    ),
    seq=255,
    uuid="SPARKPLUG",
    body=b"\0",
)

TEXT = st.text(st.characters(exclude_categories=("Cs",)), max_size=12)
FLOATS = st.floats(width=32)
_INTEGERS = {
    **{t: st.integers(-(1 << bits - 1), (1 << bits - 1) - 1) for t, bits in SIGNED_BITS.items()},
    **{t: st.integers(0, (1 << bits) - 1) for t, bits in UNSIGNED_BITS.items()},
}
SCALARS: dict[DataType, st.SearchStrategy[Any]] = {
    **_INTEGERS,
    DataType.FLOAT: FLOATS,
    DataType.DOUBLE: st.floats(),
    DataType.BOOLEAN: st.booleans(),
    **dict.fromkeys((DataType.STRING, DataType.TEXT, DataType.UUID), TEXT),
    **dict.fromkeys((DataType.BYTES, DataType.FILE), st.binary(max_size=12)),
}
_ELEMENTS: dict[DataType, st.SearchStrategy[Any]] = {
    **{t: SCALARS[DataType[t.name.removesuffix("_ARRAY")]] for t in ARRAYS},
    DataType.STRING_ARRAY: st.text(st.characters(exclude_categories=("Cs",), exclude_characters="\0"), max_size=5),
    DataType.DATETIME_ARRAY: st.integers(0, 2**63 - 1),
}
ARRAY_VALUES = {t: st.lists(elements, max_size=20).map(tuple) for t, elements in _ELEMENTS.items()}
PLAIN_VALUES = {**SCALARS, **ARRAY_VALUES}


@st.composite
def datasets(draw: st.DrawFn) -> DataSet:
    """A table of basic types with nulls."""
    types = tuple(draw(st.lists(st.sampled_from([t for t in SCALARS if t <= DataType.TEXT]), max_size=4)))
    cells = [st.none() | SCALARS[datatype] for datatype in types]
    rows = draw(st.lists(st.tuples(*cells), max_size=3))
    columns = tuple(draw(st.lists(TEXT, min_size=len(types), max_size=len(types))))
    return DataSet(columns, types, tuple(rows))


def _plain_metrics(values: dict[DataType, st.SearchStrategy[Any]]) -> st.SearchStrategy[Metric]:
    return st.sampled_from(sorted(values)).flatmap(
        lambda datatype: st.builds(
            Metric,
            name=st.none() | TEXT,
            value=st.none() | values[datatype],
            datatype=st.just(datatype),
            timestamp_ms=st.none() | st.integers(0, 2**64 - 1),
            alias=st.none() | st.integers(0, 2**64 - 1),
            is_historical=st.booleans(),
            is_transient=st.booleans(),
            properties=PROPERTY_SETS,
        )
    )


_PROPERTY_VALUES = st.sampled_from([t for t in SCALARS if t <= DataType.UUID]).flatmap(
    lambda t: (st.none() | SCALARS[t]).map(lambda value: PropertyValue(t, value))
)
_FLAT_SETS = st.dictionaries(TEXT, _PROPERTY_VALUES, max_size=2)
PROPERTY_SETS = st.dictionaries(
    TEXT,
    _PROPERTY_VALUES
    | _FLAT_SETS.map(lambda flat: PropertyValue(DataType.PROPERTY_SET, flat))
    | st.lists(_FLAT_SETS, max_size=2).map(lambda sets: PropertyValue(DataType.PROPERTY_SET_LIST, tuple(sets))),
    max_size=2,
)
TEMPLATES = st.recursive(
    st.builds(Template, ref=TEXT.filter(bool), metrics=st.just(())),
    lambda inner: st.builds(
        Template,
        ref=TEXT.filter(bool),
        metrics=st.lists(_plain_metrics({DataType.TEMPLATE: inner, **_INTEGERS}), max_size=2).map(tuple),
        version=st.none() | TEXT,
    ),
    max_leaves=4,
)
ALL_VALUES: dict[DataType, st.SearchStrategy[Any]] = {
    **PLAIN_VALUES,
    DataType.DATASET: datasets(),
    DataType.TEMPLATE: TEMPLATES,
}
METRICS = _plain_metrics(ALL_VALUES)
PAYLOADS = st.builds(
    Payload,
    timestamp_ms=st.none() | st.integers(0, 2**64 - 1),
    metrics=st.lists(METRICS, max_size=4).map(tuple),
    seq=st.none() | st.integers(0, 255),
    uuid=st.none() | TEXT,
    body=st.none() | st.binary(max_size=5),
)


def same(left: Any, right: Any) -> bool:
    """Equality in which NaN equals NaN and −0.0 differs from 0.0; `repr` of our frozen values says all of it."""
    return repr(left) == repr(right)
