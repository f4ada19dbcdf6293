"""Run logs: what is one, what is not, and that writing loses nothing."""

from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

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
