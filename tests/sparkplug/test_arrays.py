"""Arrays in bytes: the corrected vectors of the specification, and laws."""

from __future__ import annotations

import struct
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from sparkplug.arrays import pack, unpack
from sparkplug.datatype import ARRAYS, DataType
from sparkplug.errors import MetricValueError, PayloadError
from tests.sparkplug.everything import ARRAY_VALUES, same

WIDTHS = {
    DataType.INT8_ARRAY: 1,
    DataType.INT16_ARRAY: 2,
    DataType.INT32_ARRAY: 4,
    DataType.INT64_ARRAY: 8,
    DataType.UINT8_ARRAY: 1,
    DataType.UINT16_ARRAY: 2,
    DataType.UINT32_ARRAY: 4,
    DataType.UINT64_ARRAY: 8,
    DataType.FLOAT_ARRAY: 4,
    DataType.DOUBLE_ARRAY: 8,
    DataType.DATETIME_ARRAY: 8,
}


@pytest.mark.parametrize(
    ("datatype", "values", "data"),
    [
        (DataType.INT8_ARRAY, (-23, 123), "E9 7B"),
        (DataType.INT16_ARRAY, (-30000, 30000), "D0 8A 30 75"),
        (DataType.INT32_ARRAY, (-1, 315338746), "FF FF FF FF FA AF CB 12"),
        (DataType.INT64_ARRAY, (-4270929666821191986, -3601064768563266876), "CE 06 72 AC 18 9C BA C4 C4 BA 9C 18 AC 72 06 CE"),
        (DataType.UINT8_ARRAY, (23, 250), "17 FA"),
        (DataType.UINT16_ARRAY, (30, 52360), "1E 00 88 CC"),
        (DataType.UINT32_ARRAY, (52, 3293969225), "34 00 00 00 49 FB 55 C4"),
        (DataType.UINT64_ARRAY, (52, 16444743074749521625), "34 00 00 00 00 00 00 00 D9 9E 02 D1 B2 76 37 E4"),
        (DataType.FLOAT_ARRAY, (1.23, 89.341), "A4 70 9D 3F 98 AE B2 42"),
        (DataType.DOUBLE_ARRAY, (12.5, -1022.5), "00 00 00 00 00 00 29 40 00 00 00 00 00 F4 8F C0"),
        (
            DataType.BOOLEAN_ARRAY,
            (False, False, True, True, False, True, False, False, True, True, False, True),
            "0C 00 00 00 34 D0",
        ),
        (DataType.STRING_ARRAY, ("ABC", "hello"), "41 42 43 00 68 65 6C 6C 6F 00"),
        (DataType.DATETIME_ARRAY, (1256102875335, 1656107875000), "C7 D0 90 75 24 01 00 00 B8 BA B8 97 81 01 00 00"),
    ],
)
def test_the_corrected_vectors_of_the_specification(datatype: DataType, values: tuple[Any, ...], data: str) -> None:
    assert pack(datatype, values) == bytes.fromhex(data)
    back = unpack(datatype, bytes.fromhex(data))
    if datatype is DataType.FLOAT_ARRAY:
        values = struct.unpack("<2f", struct.pack("<2f", *values))
    assert back == values


@given(st.sampled_from(sorted(ARRAYS)).flatmap(lambda t: st.tuples(st.just(t), ARRAY_VALUES[t])))
def test_every_array_survives_the_round_trip(typed: tuple[DataType, tuple[Any, ...]]) -> None:
    datatype, values = typed
    data = pack(datatype, values)
    assert same(unpack(datatype, data), values)
    if datatype in WIDTHS:
        assert len(data) == WIDTHS[datatype] * len(values)


@given(st.sampled_from(sorted(ARRAYS)), st.binary(max_size=40))
def test_any_bytes_are_an_array_or_a_payload_error(datatype: DataType, data: bytes) -> None:
    try:
        values = unpack(datatype, data)
    except PayloadError:
        return
    if datatype is not DataType.BOOLEAN_ARRAY:  # which may carry more bits than its count says
        assert pack(datatype, values) == data or datatype is DataType.FLOAT_ARRAY  # a NaN may lose its quiet bit


@given(st.integers(0, 70))
def test_booleans_are_counted_not_guessed_from_the_bytes(count: int) -> None:
    data = pack(DataType.BOOLEAN_ARRAY, (True,) * count)
    assert len(data) == 4 + (count + 7) // 8
    assert unpack(DataType.BOOLEAN_ARRAY, data) == (True,) * count


@pytest.mark.parametrize("datatype", sorted(ARRAYS))
def test_an_empty_array_is_empty(datatype: DataType) -> None:
    assert unpack(datatype, pack(datatype, ())) == ()


@pytest.mark.parametrize(
    ("datatype", "values"),
    [
        (DataType.INT8_ARRAY, (128,)),
        (DataType.UINT64_ARRAY, (-1,)),
        (DataType.UINT64_ARRAY, (2**64,)),
        (DataType.INT32_ARRAY, (1.5,)),
        (DataType.INT32_ARRAY, (None,)),
        (DataType.FLOAT_ARRAY, (1e39,)),
        (DataType.DOUBLE_ARRAY, ("1",)),
        (DataType.BOOLEAN_ARRAY, (1,)),
        (DataType.STRING_ARRAY, ("a\0b",)),
        (DataType.STRING_ARRAY, (1,)),
        (DataType.STRING_ARRAY, ("\ud800",)),
    ],
)
def test_an_element_that_does_not_fit_is_refused(datatype: DataType, values: tuple[Any, ...]) -> None:
    with pytest.raises(MetricValueError, match=datatype.name):
        pack(datatype, values)


@pytest.mark.parametrize(
    ("datatype", "data", "says"),
    [
        (DataType.INT16_ARRAY, "01", "2-byte elements"),
        (DataType.DATETIME_ARRAY, "01 02 03 04 05 06 07", "8-byte elements"),
        (DataType.BOOLEAN_ARRAY, "01 00", "lacks its 4-byte count"),
        (DataType.BOOLEAN_ARRAY, "09 00 00 00 ff", "says 9 elements and carries 8"),
        (DataType.BOOLEAN_ARRAY, "ff ff ff ff ff", "says 4294967295 elements"),
        (DataType.STRING_ARRAY, "41", "does not end with a zero byte"),
        (DataType.STRING_ARRAY, "ff 00", "not UTF-8"),
    ],
)
def test_bytes_that_do_not_fit_are_refused(datatype: DataType, data: str, says: str) -> None:
    with pytest.raises(PayloadError, match=says):
        unpack(datatype, bytes.fromhex(data))
