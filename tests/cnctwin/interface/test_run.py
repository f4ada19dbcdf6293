"""Run logs in Python: what is written is read again, whatever it was made of."""

from pathlib import Path

import numpy as np
import pyarrow as pa
import pytest

import cnctwin

COLUMNS = {
    "t_s": [0.0, 0.1, 0.25],
    "b_pos_deg": [10.0, None, 11.0],
    "x_pos_mm": [1.0, 2.0, 3.0],
    "exec_state": ["ACTIVE", None, "READY"],
    "note": ["not", "a", "column"],
}


@pytest.mark.parametrize("ending", ["parquet", "csv"])
@pytest.mark.parametrize("form", ["mapping", "table", "frame", "frame by t_s"])
def test_what_is_written_is_read_again(tmp_path: Path, ending: str, form: str) -> None:
    pd = pytest.importorskip("pandas")
    frame = pd.DataFrame(COLUMNS)
    given = {"mapping": COLUMNS, "table": pa.table(COLUMNS), "frame": frame, "frame by t_s": frame.set_index("t_s")}[form]
    written = cnctwin.write_run(given, tmp_path / f"run.{ending}")
    assert written.ignored == ("note",)
    run = cnctwin.read_run(tmp_path / f"run.{ending}")
    assert run.columns == written.columns == ("t_s", "b_pos_deg", "x_pos_mm", "exec_state")
    assert (len(run), run.seconds) == (3, 0.25)
    np.testing.assert_array_equal(run["b_pos_deg"], [10.0, np.nan, 11.0])
    assert [text or None for text in run["exec_state"]] == ["ACTIVE", None, "READY"]
    assert run.table().column("b_pos_deg").to_pylist() == [10.0, None, 11.0]
    assert run.frame().index.name == "t_s"


def test_a_run_goes_round_through_its_own_frame(tmp_path: Path) -> None:
    pytest.importorskip("pandas")
    run = cnctwin.Run.of(COLUMNS)
    again = cnctwin.Run.of(run.frame())
    assert again.table().equals(run.table())


@pytest.mark.parametrize(
    ("columns", "line"),
    [
        ({"x_pos_mm": [1.0]}, "mine: there is no column t_s"),
        ({"t_s": [0.0, 0.0]}, "mine: t_s does not increase from row 1"),
        ({"t_s": [0.0, 1.0], "x_pos_mm": [1.0]}, "mine: column x_pos_mm has 1 rows, t_s has 2"),
        ({"t_s": [0.0], "x_pos_mm": ["far"]}, "mine: column x_pos_mm holds what is not a number"),
    ],
)
def test_columns_that_make_no_run_are_refused(columns: dict[str, list[object]], line: str) -> None:
    with pytest.raises(cnctwin.RunError, match=line):
        cnctwin.Run.of(columns, name="mine")


def test_a_column_that_is_missing_is_named_with_those_there_are() -> None:
    with pytest.raises(cnctwin.RunError, match="there is no column z_pos_mm; there are t_s, b_pos_deg, x_pos_mm, exec_state"):
        cnctwin.Run.of(COLUMNS)["z_pos_mm"]
