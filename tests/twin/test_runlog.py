"""Run logs: what is one, what is not, and that writing loses nothing."""

import tracemalloc
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
import pytest
from hypothesis import given
from hypothesis import strategies as st

from twin import run_file
from twin.errors import RunLogError
from twin.runlog import read_run, run_log, write_run

TIMES = np.array([0.0, 0.001, 0.002])


def log(**columns: np.ndarray) -> dict[str, np.ndarray]:
    return {"t_s": TIMES, **columns}


@pytest.mark.parametrize("ending", ["parquet", "csv"])
def test_what_is_written_is_read_back(tmp_path: Path, ending: str) -> None:
    columns = log(
        x_pos_mm=np.array([1.0, np.nan, 0.1 + 0.2]),
        tool_change_active=np.array([0.0, 1.0, 0.0]),
        exec_state=np.array(["ACTIVE", None, "READY"], dtype=object),
    )
    path = tmp_path / f"run.{ending}"
    write_run(run_log(columns), path)
    again = read_run(path)
    np.testing.assert_array_equal(again.t_s, TIMES)
    np.testing.assert_array_equal(again["x_pos_mm"], columns["x_pos_mm"])
    assert again["tool_change_active"].tolist() == [0.0, 1.0, 0.0]
    assert [v or None for v in again.text["exec_state"]] == ["ACTIVE", None, "READY"]


@given(st.lists(st.one_of(st.none(), st.floats(allow_nan=False, width=64)), min_size=1, max_size=20))
def test_every_number_survives(values: list[float | None]) -> None:
    made = run_log({"t_s": np.arange(len(values), dtype=float), "x_pos_mm": np.array(values, dtype=object)})
    for given_value, kept in zip(values, made["x_pos_mm"], strict=True):
        assert (given_value is None and np.isnan(kept)) or given_value == kept


@pytest.mark.parametrize(
    ("columns", "complaint"),
    [
        ({"x_pos_mm": TIMES}, "no column t_s"),
        ({"t_s": np.array([0.0, 2.0, 1.0])}, r"does not increase from row 2 \(2 s\) to 3 \(1 s\)"),
        ({"t_s": np.array([0.0, np.nan, 1.0])}, "not a number in row 2"),
        (log(x_pos_mm=np.array([1.0])), "has 1 rows, t_s has 3"),
        (log(x_pos_mm=np.array(["a", "b", "c"], dtype=object)), "x_pos_mm holds what is not a number"),
    ],
)
def test_what_is_no_run_log_is_refused_with_the_reason(columns: dict[str, np.ndarray], complaint: str) -> None:
    with pytest.raises(RunLogError, match=complaint):
        run_log(columns)


def test_columns_that_are_not_in_the_format_are_named_and_left_out() -> None:
    made = run_log(log(x_pos_mm=TIMES, colour=TIMES))
    assert made.ignored == ("colour",)
    assert made.axes() == ("x",)


def test_a_missing_column_is_named_with_those_there_are() -> None:
    with pytest.raises(RunLogError, match="no column force_x_n; there are x_pos_mm"):
        run_log(log(x_pos_mm=TIMES))["force_x_n"]


@pytest.mark.parametrize("content", [b"", b"PAR1", b"not a table at all", b"\xff\xfe\x00"])
@pytest.mark.parametrize("ending", ["parquet", "csv"])
def test_a_file_that_is_no_recording_gets_one_line(tmp_path: Path, content: bytes, ending: str) -> None:
    path = tmp_path / f"broken.{ending}"
    path.write_bytes(content)
    with pytest.raises(RunLogError) as error:
        read_run(path)
    assert "\n" not in str(error.value)


def test_a_csv_with_a_short_line_is_refused_with_its_number(tmp_path: Path) -> None:
    path = tmp_path / "short.csv"
    path.write_text("t_s,x_pos_mm\n0,1\n1\n")
    with pytest.raises(RunLogError, match="line 3 has 1 fields, the header has 2"):
        read_run(path)


# Files that become far more than they are.


def parquet(path: Path, table: pa.Table, **how: Any) -> Path:
    pq.write_table(table, path, compression="zstd", **how)
    return path


def test_a_file_that_would_become_gigabytes_is_refused_by_its_footer(tmp_path: Path) -> None:
    zeros = pa.array(np.zeros(20_000_000, dtype=np.int8))
    path = parquet(
        tmp_path / "bomb.parquet",
        pa.table(dict.fromkeys(("t_s", "line", "x_pos_mm", "y_pos_mm", "z_pos_mm", "tool_number"), zeros)),
    )
    del zeros
    assert path.stat().st_size < 1_000_000
    before = pa.total_allocated_bytes()
    with pytest.raises(
        RunLogError, match="has 20000000 rows in 6 columns of a run log, 120000000 values; 100000000 are read: read a"
    ):
        read_run(path)
    assert pa.total_allocated_bytes() - before < 1_000_000


def test_columns_that_are_not_read_do_not_count(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(run_file, "CELLS_MAX", 6)
    path = parquet(
        tmp_path / "run.parquet", pa.table({"t_s": TIMES, "x_pos_mm": TIMES, "colour": ["a", "b", "c"], "more": TIMES})
    )
    assert read_run(path).ignored == ("colour", "more")
    monkeypatch.setattr(run_file, "CELLS_MAX", 5)
    with pytest.raises(RunLogError, match="6 values; 5 are read"):
        read_run(path)


def test_a_long_text_stands_in_memory_once_however_many_rows_have_it(tmp_path: Path) -> None:
    rows, text = 20_000, "G1 " * 20_000
    program = pa.DictionaryArray.from_arrays(pa.array(np.zeros(rows, dtype=np.int32)), pa.array([text]))
    path = parquet(tmp_path / "run.parquet", pa.table({"t_s": np.arange(rows, dtype=float), "program": program}))
    tracemalloc.start()
    try:
        read = read_run(path)
        _, peak_bytes = tracemalloc.get_traced_memory()
    finally:
        tracemalloc.stop()
    assert set(read.text["program"]) == {text}
    assert peak_bytes < 20_000_000, "1.2 GB as a text for each row"


@pytest.mark.parametrize("texts", [["A", None, "B"], [None, None, None], ["A", "A", "A"]])
@pytest.mark.parametrize("has_dictionary", [True, False])
def test_texts_are_the_same_however_they_were_written(texts: list[str | None], has_dictionary: bool, tmp_path: Path) -> None:
    table = pa.table({"t_s": TIMES, "exec_state": pa.array(texts, type=pa.string())})
    path = parquet(tmp_path / "run.parquet", table, use_dictionary=has_dictionary, row_group_size=2)
    assert read_run(path).text["exec_state"].tolist() == texts


@pytest.mark.parametrize(
    ("column", "how", "complaint"),
    [
        ({"x_pos_mm": pa.array([[1.0] * 1000, [2.0], [3.0]])}, {}, "column x_pos_mm has 1002 values in 3 rows; a row has one"),
        ({"x_pos_mm": pa.array([[1.0], [2.0], [3.0]])}, {}, "column x_pos_mm holds what is not a number"),
        ({"x_pos_mm": pa.array(["1", "2", "3"])}, {}, "column x_pos_mm holds what is not a number"),
        ({"program": pa.array([{"a": 1}, {"a": 2}, {"a": 3}])}, {}, "column program holds what is not a text"),
        (
            {"program": pa.array(["a" * n for n in (1000, 1001, 1002)])},
            {"use_dictionary": False, "column_encoding": {"program": "DELTA_BYTE_ARRAY"}},
            "text program is encoded as DELTA_BYTE_ARRAY, which has no bound; write it as plain or dictionary",
        ),
    ],
)
def test_what_could_unfold_is_refused_before_it_is_decoded(
    column: dict[str, pa.Array], how: dict[str, Any], complaint: str, tmp_path: Path
) -> None:
    with pytest.raises(RunLogError, match=complaint):
        read_run(parquet(tmp_path / "run.parquet", pa.table({"t_s": TIMES} | column), **how))


def test_texts_are_bounded(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    path = parquet(tmp_path / "run.parquet", pa.table({"t_s": TIMES, "program": ["a" * 100, "b" * 100, "c" * 100]}))
    monkeypatch.setattr(run_file, "TEXT_BYTES_MAX", 200)
    with pytest.raises(RunLogError, match=r"the texts of program have \d+ bytes; 200 are read"):
        read_run(path)
    monkeypatch.setattr(run_file, "BYTES_MAX", 100)
    with pytest.raises(RunLogError, match=r"unpacks to \d+ bytes; 100 are read"):
        read_run(path)


def test_a_csv_file_is_bounded_by_its_size(tmp_path: Path) -> None:
    path = tmp_path / "run.csv"
    with path.open("wb") as file:
        file.truncate(run_file.CSV_BYTES_MAX + 1)
    with pytest.raises(RunLogError, match="has 67108865 bytes; of a CSV file 67108864 are read: write it as Parquet"):
        read_run(path)
