"""Values that break a rule of the specification cannot be made."""

from __future__ import annotations

from typing import Any

import pytest

from sparkplug.datatype import DataType
from sparkplug.errors import PayloadError
from sparkplug.values import DataSet, Metric, Parameter, Payload, Template


@pytest.mark.parametrize(
    ("columns", "types", "rows", "says"),
    [
        (("a",), (), (), "1 columns and 0 types"),
        ((), (DataType.INT8,), (), "0 columns and 1 types"),
        (("a",), (DataType.BYTES,), (), "column 'a': BYTES is not a basic type"),
        (("a",), (DataType.UNKNOWN,), (), "UNKNOWN"),
        (("a",), (DataType.DATASET,), (), "DATASET"),
        (("a",), (DataType.INT8_ARRAY,), (), "INT8_ARRAY"),
        (("a",), (DataType.INT8,), ((1,), (1, 2)), "row 1 has 2 cells for 1 columns"),
    ],
)
def test_a_table_whose_parts_do_not_agree_cannot_be_made(columns: Any, types: Any, rows: Any, says: str) -> None:
    with pytest.raises(PayloadError, match=says):
        DataSet(columns, types, rows)


@pytest.mark.parametrize(
    ("make", "says"),
    [
        (lambda: Template("T", (), is_definition=True), "definition names the template 'T'"),
        (lambda: Template(None, ()), "instance names no definition"),
        (lambda: Template("", ()), "instance names no definition"),
        (lambda: Template("T", (), (Parameter("", DataType.INT8, 1),)), "needs a name and a basic type"),
        *(
            (lambda t=t: Template("T", (), (Parameter("p", t, None),)), t.name)
            for t in (DataType.UNKNOWN, DataType.BYTES, DataType.DATASET, DataType.TEMPLATE, DataType.INT8_ARRAY)
        ),
    ],
)
def test_a_template_that_is_neither_definition_nor_instance_cannot_be_made(make: Any, says: str) -> None:
    with pytest.raises(PayloadError, match=says):
        make()


@pytest.mark.parametrize(
    ("value", "name"), [(DataSet((), (), ()), "rows"), (Template("T", ()), "ref"), (Metric("m", 1), "value"), (Payload(0), "seq")]
)
def test_values_are_frozen(value: Any, name: str) -> None:
    with pytest.raises(AttributeError):
        setattr(value, name, 1)
