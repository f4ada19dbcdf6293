"""A store in Python: what went in comes out, however it is cut into batches, and nothing that is not good passes for good."""

from collections.abc import Iterator
from datetime import UTC, datetime, timedelta
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

import cnctwin
from cnctwin.interface import store as store_file
from cnctwin.interface.signal_columns import TIME, batch_of, schema_of, type_of
from cnctwin.memory.store.contract import Column, Query
from cnctwin.memory.store.embedded import EmbeddedStore
from sparkplug.host_session import EventKind
from tests.cnctwin.memory.store.told import BAD, GOOD, STALE, T0_MS, reading, steady, told

T0 = datetime.fromtimestamp(T0_MS / 1000, UTC)


@pytest.fixture
def where(tmp_path: Path) -> Path:
    writing = EmbeddedStore(tmp_path, writable=True)
    first = [
        reading("x_mm", 0.5, 0),
        reading("exec_state", "READY", 0),
        reading("coolant_on", True, 0),
        reading("spindle_rpm", None, 0, BAD, "not known yet"),
        reading("odd", 1, 0),
        reading("feed_mm_min", 100.0, 0),
    ]
    writing.append([told(first, 0, kind=EventKind.BIRTH), *steady(100, 600)])
    last = [
        reading("spindle_rpm", 900.0, 60_500),
        reading("spindle_rpm", 901.0, 60_600, STALE, "gone"),
        reading("odd", "two", 60_600),
    ]
    last.append(reading("feed_mm_min", "fast", 60_600))
    writing.append([told(last, 60_600)])
    writing.close()
    return tmp_path


@pytest.fixture
def store(where: Path) -> Iterator[cnctwin.Store]:
    with cnctwin.open_store(where) as opened:
        yield opened


def test_machines_and_signals_say_what_there_is(store: cnctwin.Store) -> None:
    assert store.machines() == ["vmc"]
    by_name = {signal.name: signal for signal in store.signals("vmc")}
    assert list(by_name) == ["coolant_on", "exec_state", "feed_mm_min", "odd", "spindle_rpm", "twin_like", "x_mm"]
    x = by_name["x_mm"]
    assert (x.unit, x.nodes, x.first, x.last) == ("mm", ("cnc/edge-1",), T0, T0 + timedelta(milliseconds=60_000))


def test_a_row_is_a_moment_and_a_signal_that_said_nothing_is_null(store: cnctwin.Store) -> None:
    table = store.table("vmc", ["x_mm", "coolant_on", "exec_state"], end=T0 + timedelta(milliseconds=150))
    assert table.schema.field("t").type == TIME
    assert [str(one) for one in table.schema.types[1:]] == ["double", "bool", "string"]
    assert table.schema.field("x_mm").metadata == {b"unit": b"mm"}
    assert table.to_pylist() == [
        {"t": T0, "x_mm": 0.5, "coolant_on": True, "exec_state": "READY"},
        {"t": T0 + timedelta(milliseconds=100), "x_mm": 0.0, "coolant_on": None, "exec_state": "READY"},
    ]


def test_what_is_not_good_is_null_unless_its_quality_stands_beside_it(store: cnctwin.Store) -> None:
    plain = store.table("vmc", ["spindle_rpm"])
    assert plain.column("spindle_rpm").to_pylist() == [None, 900.0, None]
    detailed = store.table("vmc", ["spindle_rpm"], details=True)
    assert detailed.column("spindle_rpm").to_pylist() == [None, 900.0, 901.0]
    assert detailed.column("spindle_rpm.quality").to_pylist() == ["bad", "good", "stale"]
    assert detailed.column("spindle_rpm.reason").to_pylist() == ["not known yet", None, "gone"]


def test_windows_hold_mean_lowest_highest_and_count(store: cnctwin.Store) -> None:
    table = store.table("vmc", ["twin_like"], T0, T0 + timedelta(seconds=2), every="1s", details=True)
    assert table.column("twin_like.count").to_pylist() == [9, 10]
    assert table.column("twin_like.low").to_pylist() == pytest.approx([0.0, 9.9])
    assert table.column("twin_like").to_pylist() == pytest.approx([4.4, 14.85])
    assert table.equals(store.table("vmc", ["twin_like"], T0_MS, T0_MS + 2000, every=timedelta(seconds=1), details=True))


@pytest.mark.parametrize("every", [None, "700ms"])
def test_however_it_is_cut_into_batches_the_rows_are_the_same(
    store: cnctwin.Store, monkeypatch: pytest.MonkeyPatch, every: str | None
) -> None:
    whole = store.table("vmc", ["x_mm", "exec_state"], every=every, details=True)
    assert whole.num_rows > 80
    monkeypatch.setattr(store_file, "ROWS", 7)
    monkeypatch.setattr(store_file, "SLICE_MS", 1500)
    batches = list(store.batches("vmc", ["x_mm", "exec_state"], every=every, details=True))
    assert len(batches) > 10 and max(batch.num_rows for batch in batches) <= 7
    assert store.table("vmc", ["x_mm", "exec_state"], every=every, details=True).equals(whole)


def test_a_span_without_samples_is_an_empty_table_of_the_same_columns(store: cnctwin.Store) -> None:
    empty = store.table("vmc", ["x_mm"], T0_MS + 10**9, T0_MS + 2 * 10**9)
    assert (empty.num_rows, empty.column_names) == (0, ["t", "x_mm"])
    assert empty.schema == store.table("vmc", ["x_mm"]).schema


def test_a_frame_is_by_time_and_knows_its_units(store: cnctwin.Store) -> None:
    pytest.importorskip("pandas")
    frame = store.frame("vmc", ["x_mm", "exec_state"], start="-100000d", end=T0_MS + 1000)
    assert frame.attrs["units"] == {"x_mm": "mm"}
    assert frame.index.name == "t" and str(frame.index.tz) == "UTC"
    assert frame["x_mm"].iloc[1] == 0.0


def test_a_signal_that_told_a_number_and_a_text_is_named_and_can_be_read_as_text(store: cnctwin.Store) -> None:
    assert store.table("vmc", ["odd"]).column("odd").to_pylist() == ["1", "two"]  # it told a text last
    fault = r"feed_mm_min: is 'fast' at 2026-.*, which is no double; read it with as_text=\['feed_mm_min'\]"
    with pytest.raises(cnctwin.StoreError, match=fault):
        store.table("vmc", ["feed_mm_min"])
    assert store.table("vmc", ["feed_mm_min"], as_text=["feed_mm_min"]).column("feed_mm_min").to_pylist() == ["100.0", "fast"]


@pytest.mark.parametrize(
    ("asked", "line"),
    [
        ({"machine": "vmx"}, "vmx: the store has no such machine; it has vmc"),
        ({"machine": "vmc", "signals": ["x"]}, "vmc: the store has no signal x; it has coolant_on"),
        ({"machine": "vmc", "signals": []}, "vmc: name at least one signal"),
        ({"machine": "vmc", "start": "soon"}, "start 'soon' is no moment"),
        ({"machine": "vmc", "every": "1 second"}, "every '1 second': write 100ms"),
        ({"machine": "vmc", "start": 2000, "end": 1000}, "to 1000 is not after from 2000"),
    ],
)
def test_what_cannot_be_asked_is_refused_in_one_line(store: cnctwin.Store, asked: dict[str, object], line: str) -> None:
    with pytest.raises(cnctwin.ApplicationError, match=line):
        store.table(**asked)  # type: ignore[arg-type]


PLAIN = {"windows": False, "details": True}


def column(signal: str, t_us: list[int], values: list[object]) -> Column:
    empty: list[float | None] = []
    return Column(signal, None, t_us, values, [GOOD] * len(t_us), [None] * len(t_us), empty, empty, [])  # type: ignore[arg-type]


@given(st.lists(st.lists(st.tuples(st.integers(0, 5), st.floats(allow_nan=False)), max_size=6), min_size=1, max_size=3))
def test_no_sample_is_lost_even_where_several_share_a_moment(samples: list[list[tuple[int, float]]]) -> None:
    columns = []
    for number, told_ in enumerate(samples):
        ordered = sorted(told_, key=lambda one: one[0])
        columns.append(column(f"s{number}", [t for t, _ in ordered], [v for _, v in ordered]))
    types = {one.signal: type_of(one.signal, {}) for one in columns}
    batch = batch_of(columns, schema_of(types, {}, **PLAIN), **PLAIN)
    times = batch.column("t").cast("int64").to_pylist()
    assert times == sorted(times)
    for one in columns:
        rows = zip(times, batch.column(one.signal).to_pylist(), strict=True)
        assert [(t, v) for t, v in rows if v is not None] == list(zip(one.t_us, one.value, strict=True))


def test_a_query_asks_for_whole_windows(store: cnctwin.Store, monkeypatch: pytest.MonkeyPatch) -> None:
    asked: list[Query] = []
    inner = store._inner
    ask = inner.query
    monkeypatch.setattr(inner, "query", lambda query: asked.append(query) or ask(query))
    monkeypatch.setattr(store_file, "SLICE_MS", 1300)
    store.table("vmc", ["x_mm"], T0_MS + 50, T0_MS + 9_000, every="2s")
    assert len(asked) > 1
    assert all(query.to_ms % 2000 == T0_MS % 2000 for query in asked[:-1])
    assert [query.from_ms for query in asked[1:]] == [query.to_ms for query in asked[:-1]]
