"""Each value comes back bit for bit, from SQLite's form and from Parquet's."""

import math
from typing import Any

import numpy as np
import pytest
from hypothesis import given as drawn
from hypothesis import settings
from hypothesis import strategies as st

from cnctwin.memory.store.sealed.column import forms_of, sealed_column
from cnctwin.memory.store.value_form import CannotKeepError, Kind, given, kept, same
from sparkplug.datatype import DataType
from sparkplug.values import DataSet

ANY = st.one_of(
    st.floats(), st.integers(-(2**70), 2**70), st.booleans(), st.text(st.characters(codec="utf-8")), st.binary(),
    st.lists(st.floats()).map(tuple), st.lists(st.integers(-(2**65), 2**65)).map(tuple), st.lists(st.booleans()).map(tuple),
)  # fmt: skip
TABLE = DataSet(("t",), (DataType.INT64,), ((1,),))


@settings(max_examples=200, deadline=None)
@drawn(value=ANY)
def test_every_value_comes_back_from_sqlites_form(value: Any) -> None:
    assert same(given(*kept(value)), value)


@pytest.mark.parametrize("value", [TABLE, object(), "\ud800", (1, 2.0), (None,)])
def test_what_cannot_be_kept_is_refused(value: Any) -> None:
    with pytest.raises(CannotKeepError):
        kept(value)


@pytest.mark.parametrize(
    ("values", "ending"),
    [
        ([12.345, -0.001, 7.0], "e3"),
        ([12.5, -0.0, 0.0], "z1"),
        ([0.1 + 0.2, 1.0], "d"),
        ([float(np.float32(0.1)), 1e-30], "d"),
        ([float(np.float32(0.1)), math.inf], "f"),
        ([math.nan, 1.5], "f"),
        ([1e300], "d"),
        ([123456789.123456789], "d"),
    ],
)
def test_the_smallest_lossless_way_is_taken(values: list[float], ending: str) -> None:
    forms, at = [kept(v)[1] for v in values], np.arange(0, 2 * len(values), 2)
    column = sealed_column(Kind.FLOAT, forms, at, 2 * len(values))
    assert column.ending == ending
    found_at, found = forms_of(column.values, column.ending)
    assert found_at.tolist() == at.tolist()
    assert all(same(a, b) for a, b in zip(found, values, strict=True))


@settings(max_examples=100, deadline=None)
@drawn(values=st.lists(st.one_of(st.floats(), st.decimals(-1000, 1000, places=3).map(float)), min_size=1, max_size=20))
def test_a_column_of_any_floats_is_lossless(values: list[float]) -> None:
    column = sealed_column(Kind.FLOAT, [kept(v)[1] for v in values], np.arange(len(values)), len(values))
    assert all(same(a, b) for a, b in zip(forms_of(column.values, column.ending)[1], values, strict=True))


@settings(max_examples=60, deadline=None)
@drawn(
    values=st.lists(
        st.lists(st.one_of(st.floats(), st.sampled_from([0.25, -0.0])), max_size=4).map(tuple), min_size=1, max_size=6
    )
)
def test_a_column_of_arrays_is_lossless(values: list[tuple[float, ...]]) -> None:
    column = sealed_column(Kind.FLOATS, [kept(v)[1] for v in values], np.arange(1, len(values) + 1), len(values) + 2)
    _, forms = forms_of(column.values, column.ending)
    assert all(same(given(Kind.FLOATS, form), value) for form, value in zip(forms, values, strict=True))
