"""One value to one protobuf field and back."""

from __future__ import annotations

import math
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from sparkplug.datatype import FIELD, SIGNED_BITS, UNSIGNED_BITS, DataType
from sparkplug.errors import MetricValueError
from sparkplug.wire_value import READ, WRITE
from tests.sparkplug.everything import EDGES, PLAIN_VALUES, same


@pytest.mark.parametrize(
    ("datatype", "value", "field"),
    [
        (DataType.INT8, -23, 0xFFFFFFE9),
        (DataType.INT16, -1, 0xFFFFFFFF),
        (DataType.INT32, -(2**31), 0x80000000),
        (DataType.INT64, -1, 2**64 - 1),
        (DataType.UINT32, 2**32 - 1, 2**32 - 1),
        (DataType.UINT64, 2**63 + 1, 2**63 + 1),
        (DataType.DATETIME, 1_750_000_000_000, 1_750_000_000_000),
        (DataType.DOUBLE, 3, 3.0),
        (DataType.BOOLEAN, True, True),
        (DataType.INT8_ARRAY, (-23,), b"\xe9"),
    ],
)
def test_a_value_has_one_field_value(datatype: DataType, value: Any, field: Any) -> None:
    assert WRITE[datatype](value) == field
    assert READ[datatype](field) == value


@pytest.mark.parametrize(
    ("datatype", "field", "value"),
    [
        (DataType.INT8, 0xE9, -23),
        (DataType.INT8, 0xFFE9, -23),
        (DataType.INT32, 2**64 - 12, -12),  # widened to 64 bits by the peer
        (DataType.INT32, 4294967284, -12),
        (DataType.UINT8, 0xFFFFFFFF, 255),
        (DataType.INT64, 2**63, -(2**63)),
    ],
)
def test_what_a_peer_widened_is_cut_to_the_declared_width(datatype: DataType, field: int, value: int) -> None:
    assert READ[datatype](field) == value


@given(st.sampled_from(sorted(PLAIN_VALUES)).flatmap(lambda t: st.tuples(st.just(t), PLAIN_VALUES[t])))
def test_every_value_survives_the_round_trip(typed: tuple[DataType, Any]) -> None:
    datatype, value = typed
    assert same(READ[datatype](WRITE[datatype](value)), value)


@given(st.sampled_from(sorted({**SIGNED_BITS, **UNSIGNED_BITS})), st.integers())
def test_a_whole_number_is_carried_exactly_or_refused(datatype: DataType, value: int) -> None:
    bits = {**SIGNED_BITS, **UNSIGNED_BITS}[datatype]
    low, high = (-(1 << bits - 1), (1 << bits - 1) - 1) if datatype in SIGNED_BITS else (0, (1 << bits) - 1)
    if low <= value <= high:
        assert 0 <= WRITE[datatype](value) < 1 << max(bits, 32)
    else:
        with pytest.raises(MetricValueError, match=datatype.name):
            WRITE[datatype](value)


@pytest.mark.parametrize("datatype", sorted(WRITE))
@pytest.mark.parametrize("value", [None, object(), {}, [1], 1j, DataType])
def test_what_is_no_value_is_refused(datatype: DataType, value: Any) -> None:
    with pytest.raises(MetricValueError, match=datatype.name):
        WRITE[datatype](value)


@pytest.mark.parametrize("value", [3.5e38, -3.5e38, 10**39])
def test_a_number_too_large_for_32_bits_is_refused_and_infinity_is_not(value: float) -> None:
    with pytest.raises(MetricValueError, match="FLOAT"):
        WRITE[DataType.FLOAT](value)
    assert WRITE[DataType.FLOAT](math.inf) == math.inf


def test_all_types_without_a_shape_of_their_own_can_be_written_and_read() -> None:
    shaped = {DataType.DATASET, DataType.TEMPLATE, DataType.PROPERTY_SET, DataType.PROPERTY_SET_LIST}
    assert WRITE.keys() == READ.keys() == FIELD.keys() - shaped
    assert PLAIN_VALUES.keys() == WRITE.keys() == EDGES.keys() - shaped
