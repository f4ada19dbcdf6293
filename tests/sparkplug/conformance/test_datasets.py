"""DataSets (6.4.11)."""

from typing import Any

import pytest

from sparkplug.codec import decode, encode, parse
from sparkplug.datatype import DataType
from sparkplug.errors import PayloadError
from sparkplug.schema import PayloadMessage
from sparkplug.topics import Verb
from sparkplug.values import DataSet, Metric, Payload
from tests.sparkplug.conformance.life import EPOCH_MS, EdgeLife

UINT32, UINT64 = 13, 4
BASIC = [DataType(code) for code in range(DataType.INT8, DataType.TEXT + 1)]
_DATASET = PayloadMessage.DESCRIPTOR.fields_by_name["metrics"].message_type.fields_by_name["dataset_value"].message_type


def _tables(life: EdgeLife) -> list[Any]:
    births = [sent for sent in life.of(Verb.DBIRTH) if sent.topic.device == "okuma"]
    return [sent.metric("offsets").dataset_value for sent in births]


def _raw(columns: list[str], types: list[int], cells: int) -> bytes:
    """A payload with one dataset that was written without our checks."""
    message = PayloadMessage(timestamp=EPOCH_MS)
    table = message.metrics.add(name="x", datatype=DataType.DATASET).dataset_value
    table.num_of_columns = len(columns)
    table.columns.extend(columns)
    table.types.extend(types)
    row = table.rows.add()
    for _ in range(cells):
        row.elements.add(int_value=1)
    data: bytes = message.SerializeToString()
    return data


@pytest.mark.tck("tck-id-payloads-dataset-column-size")
def test_the_number_of_columns_is_told_as_an_unsigned_64_bit_number(life: EdgeLife) -> None:
    assert _DATASET.fields_by_name["num_of_columns"].type == UINT64
    for table in _tables(life):
        assert table.num_of_columns == len(table.columns) == 2


@pytest.mark.tck(
    "tck-id-payloads-dataset-column-num-headers",
    "tck-id-payloads-dataset-types-num",
    "tck-id-payloads-dataset-parameter-type-req",
)
def test_there_are_as_many_types_as_columns(life: EdgeLife) -> None:
    assert len(_tables(life)) >= 4
    for table in _tables(life):
        assert len(table.types) == len(table.columns) == 2
        assert all(len(row.elements) == 2 for row in table.rows)


@pytest.mark.tck(
    "tck-id-payloads-dataset-column-num-headers",
    "tck-id-payloads-dataset-types-num",
    "tck-id-payloads-dataset-parameter-type-req",
)
@pytest.mark.parametrize(("columns", "types"), [(2, 1), (1, 2), (2, 0), (0, 1)])
def test_a_table_with_another_number_of_types_is_neither_written_nor_read(columns: int, types: int) -> None:
    names = [f"c{number}" for number in range(columns)]
    with pytest.raises(PayloadError):
        DataSet(tuple(names), (DataType.INT32,) * types, ())
    with pytest.raises(PayloadError):
        decode(_raw(names, [DataType.INT32] * types, types))


@pytest.mark.tck("tck-id-payloads-dataset-types-def", "tck-id-payloads-dataset-types-type")
def test_the_types_are_unsigned_32_bit_numbers() -> None:
    field = _DATASET.fields_by_name["types"]
    assert (field.type, field.is_repeated, field.number) == (UINT32, True, 3)


@pytest.mark.tck("tck-id-payloads-dataset-types-value")
@pytest.mark.parametrize("datatype", sorted(set(DataType) - set(BASIC)))
def test_a_column_of_a_type_that_is_not_basic_is_neither_written_nor_read(datatype: DataType) -> None:
    with pytest.raises(PayloadError):
        DataSet(("c",), (datatype,), ())
    with pytest.raises(PayloadError):
        decode(_raw(["c"], [datatype], 1))


@pytest.mark.tck("tck-id-payloads-dataset-types-value")
def test_a_column_of_an_unknown_type_is_not_read() -> None:
    with pytest.raises(PayloadError):
        decode(_raw(["c"], [99], 1))


@pytest.mark.parametrize("cells", [0, 1, 3])
def test_a_row_with_another_number_of_cells_is_neither_written_nor_read(cells: int) -> None:
    with pytest.raises(PayloadError):
        DataSet(("a", "b"), (DataType.INT32, DataType.INT32), ((1,) * cells,))
    with pytest.raises(PayloadError):
        decode(_raw(["a", "b"], [DataType.INT32, DataType.INT32], cells))


def test_a_table_with_nulls_and_negative_numbers_comes_back_as_it_was() -> None:
    table = DataSet(("a", "b"), (DataType.INT8, DataType.STRING), ((-1, None), (None, "x")))
    payload = Payload(EPOCH_MS, (Metric("x", table, DataType.DATASET, EPOCH_MS),))
    assert decode(encode(payload)) == payload
    assert parse(encode(payload)).metrics[0].dataset_value.num_of_columns == 2
