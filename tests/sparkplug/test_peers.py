"""Ours against the npm packages `sparkplug-payload` and `sparkplug-client`, other people's Sparkplug B.

What `sparkplug-payload` 1.0.3 does otherwise, each point held by a test below:

* UInt32 stands in `long_value` (3.0.0 says 32-bit numbers stand in `int_value`): ours reads it, it reads ours as null;
* arrays (types 22 to 34) do not exist: it reads null and cannot write them;
* cells of datasets and parameters of templates can be Int64, Float, Double, Boolean and String, and never null; else it throws;
* a negative Int64 in a cell comes out as a number above 2^63;
* a null DataSet or Template makes it throw;
* a template without version or reference has empty ones;
* a metric without a datatype, as data metrics are, has no value for it.
"""

from __future__ import annotations

import json
import math
import struct
from collections.abc import Iterator
from typing import Any

import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from sparkplug.codec import decode, encode
from sparkplug.datatype import ARRAYS, DataType
from sparkplug.values import DataSet, MetaData, Metric, Parameter, Payload, PropertyValue, Template
from tests.peers.npm_peer import NodeProcess
from tests.sparkplug.everything import EDGES, EPOCH_MS, METADATA, SCALARS, TEXT, same

pytestmark = pytest.mark.node

NAMES = {
    t: t.name.title().replace("Uint", "UInt").replace("Datetime", "DateTime").replace("_", "")
    for t in DataType
    if t not in ARRAYS
} | {DataType.UUID: "UUID", DataType.DATASET: "DataSet"}
LONGS = frozenset({DataType.INT64, DataType.UINT32, DataType.UINT64, DataType.DATETIME})
CELLS = (DataType.INT64, DataType.FLOAT, DataType.DOUBLE, DataType.BOOLEAN, DataType.STRING)
SHARED = tuple(t for t in SCALARS if t is not DataType.UINT32)
TABLE = DataSet(
    ("i", "f", "d", "b", "s"), CELLS, ((0, 0.5, 0.1, True, "M6"), (2**63 - 1, -0.0, math.inf, False, "")),
)  # fmt: skip
AXIS = Template(None, (Metric("load", 1.5, DataType.DOUBLE),), (Parameter("letter", DataType.STRING, "X"),), "1.0", True)
X_AXIS = Template("Axis", (Metric("inner", Template("Axis", ()), DataType.TEMPLATE),), (Parameter("n", DataType.INT64, -1),))
PROPERTIES = {
    "Quality": PropertyValue(DataType.INT32, 500),
    "negative": PropertyValue(DataType.INT64, -1),
    "nothing": PropertyValue(DataType.STRING, None),
    "set": PropertyValue(DataType.PROPERTY_SET, {"inner": PropertyValue(DataType.PROPERTY_SET, {})}),
    "list": PropertyValue(DataType.PROPERTY_SET_LIST, ({"on": PropertyValue(DataType.BOOLEAN, False)}, {})),
}
QUICK = settings(deadline=None, suppress_health_check=[HealthCheck.too_slow])
METRICS = st.sampled_from(SHARED).flatmap(
    lambda t: st.builds(
        Metric,
        name=st.none() | TEXT,
        value=st.none() | SCALARS[t],
        datatype=st.just(t),
        timestamp_ms=st.none() | st.integers(0, 2**64 - 1),
        alias=st.none() | st.integers(0, 2**64 - 1),
    )
)
PAYLOADS = st.builds(
    Payload,
    timestamp_ms=st.integers(0, 2**64 - 1),
    metrics=st.lists(METRICS, max_size=4).map(tuple),
    seq=st.integers(0, 255),
    uuid=st.none() | TEXT,
    body=st.none() | st.binary(min_size=1, max_size=5),
)
ONE_OF_EACH = [
    *(Metric(f"{t.name}/{i}", v, t, EPOCH_MS, alias=i) for t in SHARED for i, v in enumerate(EDGES[t])),
    *(Metric(f"{t.name}/null", None, t, EPOCH_MS) for t in SHARED),
    Metric("table", TABLE, DataType.DATASET),
    Metric("no table", DataSet((), (), ()), DataType.DATASET),
    Metric("definition", AXIS, DataType.TEMPLATE),
    Metric("instance", X_AXIS, DataType.TEMPLATE),
    Metric("properties", 1, DataType.INT8, properties=PROPERTIES),
    Metric("file", b"M30", DataType.FILE, is_historical=True, is_transient=True, metadata=METADATA),
]


@pytest.fixture(scope="module")
def decoder() -> Iterator[NodeProcess]:
    """`sparkplug-payload` decoding."""
    with NodeProcess("decode.mjs") as process:
        yield process


@pytest.fixture(scope="module")
def encoder() -> Iterator[NodeProcess]:
    """`sparkplug-payload` encoding."""
    with NodeProcess("encode.mjs") as process:
        yield process


def peer_decodes(decoder: NodeProcess, payload: Payload) -> Any:
    """Return what the peer makes of our bytes."""
    return decoder.ask(encode(payload).hex())


def peer_encodes(encoder: NodeProcess, payload: Any) -> bytes:
    """The peer's bytes for what we tell it."""
    return bytes.fromhex(encoder.ask(json.dumps(payload))["hex"])


@pytest.mark.parametrize("metric", ONE_OF_EACH, ids=lambda metric: str(metric.name))
def test_the_peer_reads_our_metric(decoder: NodeProcess, metric: Metric) -> None:
    assert peer_decodes(decoder, Payload(EPOCH_MS, (metric,), 7)) == {"payload": read_by_peer(Payload(EPOCH_MS, (metric,), 7))}


@pytest.mark.parametrize("metric", ONE_OF_EACH, ids=lambda metric: str(metric.name))
def test_we_read_the_metric_of_the_peer(encoder: NodeProcess, metric: Metric) -> None:
    payload = Payload(EPOCH_MS, (metric,), 7)
    assert same(decode(peer_encodes(encoder, tagged(payload))), payload)


@QUICK
@given(payload=PAYLOADS)
def test_the_peer_reads_every_payload_of_ours(decoder: NodeProcess, payload: Payload) -> None:
    assert peer_decodes(decoder, payload) == {"payload": read_by_peer(payload)}


@QUICK
@given(payload=PAYLOADS)
def test_we_read_every_payload_of_the_peer(encoder: NodeProcess, payload: Payload) -> None:
    assert same(decode(peer_encodes(encoder, tagged(payload))), payload)


@pytest.mark.parametrize("value", EDGES[DataType.UINT32])
def test_the_peer_puts_uint32_into_the_other_field(decoder: NodeProcess, encoder: NodeProcess, value: int) -> None:
    payload = Payload(EPOCH_MS, (Metric("m", value, DataType.UINT32),), 7)
    assert decode(peer_encodes(encoder, tagged(payload))) == payload
    (metric,) = peer_decodes(decoder, payload)["payload"]["metrics"]
    assert metric == {"name": "m", "type": "UInt32", "value": None}


@pytest.mark.parametrize("datatype", sorted(ARRAYS))
def test_the_peer_knows_no_arrays(decoder: NodeProcess, encoder: NodeProcess, datatype: DataType) -> None:
    (metric,) = peer_decodes(decoder, Payload(0, (Metric("m", EDGES[datatype][1], datatype),)))["payload"]["metrics"]
    assert metric == {"name": "m", "value": None}
    data = peer_encodes(encoder, {"metrics": [{"name": "m", "type": datatype.name.replace("_", ""), "value": [1]}]})
    assert decode(data).metrics == (Metric("m", None),)


@pytest.mark.parametrize(
    "value",
    [
        *(DataSet(("c",), (t,), ((EDGES[t][0],),)) for t in SCALARS if t <= DataType.TEXT and t not in CELLS),
        *(DataSet(("c",), (t,), ((None,),)) for t in CELLS),
        Template("T", (), (Parameter("p", DataType.INT32, 1),)),
        Template("T", (), (Parameter("p", DataType.STRING, None),)),
        Template("T", (Metric("m", None, DataType.DATASET),)),
        Template("T", (Metric("m", None, DataType.TEMPLATE),)),
    ],
)
def test_the_peer_throws_at_cells_and_parameters_of_other_types_and_at_nulls(decoder: NodeProcess, value: Any) -> None:
    datatype = DataType.DATASET if isinstance(value, DataSet) else DataType.TEMPLATE
    assert "error" in peer_decodes(decoder, Payload(0, (Metric("m", value, datatype),)))


def test_the_peer_reads_a_negative_cell_without_its_sign(decoder: NodeProcess, encoder: NodeProcess) -> None:
    payload = Payload(EPOCH_MS, (Metric("m", DataSet(("c",), (DataType.INT64,), ((-1,),)), DataType.DATASET),), 7)
    assert decode(peer_encodes(encoder, tagged(payload))) == payload
    (metric,) = peer_decodes(decoder, payload)["payload"]["metrics"]
    assert metric["value"]["rows"] == [[{"long": "18446744073709551615"}]]


def test_the_peer_has_no_value_for_a_metric_without_a_datatype(decoder: NodeProcess) -> None:
    data = bytes.fromhex("12 04 10 07 50 05")
    assert decoder.ask(data.hex()) == {"payload": {"metrics": [{"value": None, "alias": {"long": "7"}}]}}
    assert decode(data, lambda _name, _alias: DataType.INT8).metrics == (Metric(None, 5, DataType.INT8, alias=7),)


def tagged(value: Any, datatype: DataType | None = None) -> Any:
    """A value of ours in the peer's shape, as JSON with the tags of `tagged.mjs`."""
    if isinstance(value, Payload | Metric | Template | DataSet | MetaData | PropertyValue | Parameter):
        return {key: inner for key, inner in _members(value).items() if inner is not _ABSENT}
    if isinstance(value, dict):
        return {key: tagged(inner) for key, inner in value.items()}
    if isinstance(value, tuple):
        return [tagged(inner) for inner in value]
    if isinstance(value, bytes):
        return {"bytes": value.hex()}
    if datatype in LONGS and value is not None:
        return {"long": str(value)}
    if isinstance(value, float):
        return _float(value if datatype is not DataType.FLOAT else struct.unpack("<f", struct.pack("<f", value))[0])
    return value


def read_by_peer(payload: Payload) -> Any:
    """`tagged`, with what the peer fills in when it reads: no metrics, empty versions and references of templates."""

    def filled(value: Any) -> Any:
        if isinstance(value, list):
            return [filled(inner) for inner in value]
        if not isinstance(value, dict):
            return value
        defaults = {"version": "", "templateRef": ""} if "isDefinition" in value else {}
        return defaults | {key: filled(inner) for key, inner in value.items()}

    return {"metrics": []} | filled(tagged(payload))


_ABSENT = object()


def _some(value: Any, datatype: DataType | None = None) -> Any:
    return _ABSENT if value is None else tagged(value, datatype)


def _members(value: Any) -> dict[str, Any]:
    if isinstance(value, Payload):
        return {
            "timestamp": _some(value.timestamp_ms, DataType.UINT64),
            "metrics": tagged(value.metrics) if value.metrics else _ABSENT,
            "seq": _some(value.seq, DataType.UINT64),
            "uuid": _some(value.uuid),
            "body": _some(value.body),
        }
    if isinstance(value, Metric):
        assert value.datatype is not None
        return {
            "name": _some(value.name),
            "alias": _some(value.alias, DataType.UINT64),
            "timestamp": _some(value.timestamp_ms, DataType.UINT64),
            "type": NAMES[value.datatype],
            "value": tagged(value.value, value.datatype),
            "isHistorical": value.is_historical or _ABSENT,
            "isTransient": value.is_transient or _ABSENT,
            "properties": tagged(value.properties) if value.properties else _ABSENT,
            "metadata": _some(value.metadata),
        }
    if isinstance(value, Template):
        return {
            "isDefinition": value.is_definition,
            "templateRef": _some(value.ref),
            "version": _some(value.version),
            "metrics": tagged(value.metrics),
            "parameters": tagged(value.parameters),
        }
    if isinstance(value, DataSet):
        return {
            "numOfColumns": {"long": str(len(value.columns))},
            "columns": list(value.columns),
            "types": [NAMES[t] for t in value.types],
            "rows": [[tagged(cell, t) for cell, t in zip(row, value.types, strict=True)] for row in value.rows],
        }
    if isinstance(value, MetaData):
        names = {"is_multi_part": "isMultiPart", "content_type": "contentType", "file_name": "fileName", "file_type": "fileType"}
        plain = {names.get(n, n): _some(getattr(value, n)) for n in ("is_multi_part", "content_type", "file_name", "file_type")}
        sizes = {n: _some(getattr(value, n), DataType.UINT64) for n in ("size", "seq")}
        return plain | sizes | {n: _some(getattr(value, n)) for n in ("md5", "description")}
    name = {"name": value.name} if isinstance(value, Parameter) else {}
    return {"type": NAMES[value.datatype], "value": tagged(value.value, value.datatype), **name}


def _float(value: float) -> Any:
    if math.isfinite(value) and (value or math.copysign(1, value) > 0):
        return value
    return {"float": {"inf": "Infinity", "-inf": "-Infinity", "nan": "NaN"}.get(str(value), str(value))}
