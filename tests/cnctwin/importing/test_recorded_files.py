"""Files with columns as one run log: maps, units, times, several files, and what is left out and said."""

import json
import math
from collections.abc import Sequence
from pathlib import Path

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
import pytest

from cnctwin.errors import UsageError
from cnctwin.importing.column_map import read_map
from cnctwin.importing.import_report import as_json
from cnctwin.importing.recorded_files import Account, MapNeededError, import_files
from twin.runlog import RunLog, read_run

SAMPLES = Path(__file__).parent / "dialects" / "samples"


def imported(tmp_path: Path, *files: Path, columns: str | None = None) -> tuple[RunLog, Account]:
    chosen = None
    if columns is not None:
        (tmp_path / "columns.toml").write_text(columns, encoding="utf-8")
        chosen = read_map(tmp_path / "columns.toml")
    account = import_files(files, chosen, tmp_path / "run.parquet")
    return read_run(tmp_path / "run.parquet"), account


def written(path: Path, text: str, encoding: str = "utf-8") -> Path:
    path.write_bytes(text.encode(encoding))
    return path


def held(values: np.ndarray) -> list[float | None]:
    return [None if math.isnan(value) else round(float(value), 9) for value in values]


def test_a_value_that_a_sinumerik_trace_leaves_out_is_that_of_the_record_before(tmp_path: Path) -> None:
    run, account = imported(tmp_path, SAMPLES / "sinumerik_trace.xml")
    assert held(run.t_s) == [0.0, 0.002, 0.004, 0.006]
    assert held(run["x_pos_mm"]) == [1.0, 1.1, 1.1, 1.4]
    assert held(run["x_ref_mm"]) == [1.1, 1.1, 1.3, 1.5]
    assert held(run["x_torque_a"]) == [None, 2.5, 2.5, 2.6]
    (faults,) = account.faults.values()
    assert sum(faults.values()) == 3  # no number, a repeated time, a time that goes back
    assert any("force_per_command_n" in remark for remark in account.remarks)


THREE_AXES = (
    ("nckServoDataCmdPos64[u1,{n}]", "{A}1: Position setpoint", "{a}_ref_mm"),
    ("nckServoDataActPos1stEnc64[u1,{n}]", "{A}1: Position actual value encoder 1 (64 bit)", "{a}_pos_mm"),
    ("nckServoDataActPos2ndEnc64[u1,{n}]", "{A}1: Lageistwert Messsystem 2", "{a}_table_mm"),
    ("nckServoDataActVelMot64[u1,{n}]", "{A}1: Velocity actual value motor", ""),
    ("nckServoDataVelCmd[u1,{n}]", "{A}1: Velocity setpoint", ""),
)
"""Name, description and column of the signals of an axis."""
AS_TORQUE = ("vaTorqueAtMotor[u1,{n}]", "{A}1: torque at motor, current value", "{a}_torque_a")
AS_CURRENT = ("nckServoDataActCurr32[u1,{n}]", "{A}1: Actual current value (torque-generating)", "{a}_torque_a")


def trace_of(path: Path, axes: dict[str, int], signals: Sequence[tuple[str, str, str]]) -> dict[str, float]:
    """Write a SINUMERIK trace, its columns in another order than its signals; return the first value of each known column."""
    told = [(name, text, column, axis, n) for axis, n in axes.items() for name, text, column in signals]
    keys = [str(100 + 7 * at) for at in range(len(told))]
    described = [
        f'<signal key="{key}" name="/Nck/!SD/{name.format(n=n)}" description="{text.format(A=axis.upper())}"/>'
        for key, (name, text, _, axis, n) in zip(keys, told, strict=True)
    ]
    columns = "".join(f'<dataSignal key="{key}"/>' for key in reversed(keys))
    values = [float(at + 1) for at in range(len(told))]
    shown = " ".join(f'f{f}="{value}"' for f, value in enumerate(reversed(values), start=1))
    rows = f'<rec time="0.000" {shown}/><rec time="0.002" f1="{values[-1] + 0.5}"/><rec time="0.004"/>'
    frame = f"<traceData><dataFrame>{columns}{rows}</dataFrame></traceData>"
    written(path, f"<trace><traceDisplaySetup><signals>{''.join(described)}</signals></traceDisplaySetup>{frame}</trace>")
    return {column.format(a=axis): value for (_, _, column, axis, _), value in zip(told, values, strict=True) if column}


@pytest.mark.parametrize(("last", "unit"), [(AS_TORQUE, "N m"), (AS_CURRENT, "A")])
def test_a_trace_of_three_axes_gives_each_axis_its_own_columns_in_their_units(
    last: tuple[str, str, str], unit: str, tmp_path: Path
) -> None:
    """The axes are numbered otherwise than x, y, z: the description says which letter a number has."""
    expected = trace_of(tmp_path / "trace.xml", {"x": 1, "z": 2, "y": 3}, (*THREE_AXES, last))
    run, account = imported(tmp_path, tmp_path / "trace.xml")
    assert {column: run[column][0] for column in run.columns} == expected
    assert len(expected) == 3 * 4 and set(account.columns) == set(expected)
    assert {account.columns[f"{axis}_torque_a"].unit for axis in "xyz"} == {unit}
    assert {source.unit for column, source in account.columns.items() if column.endswith("_mm")} == {"mm"}
    assert held(run["y_torque_a"]) == [18.0, 18.5, 18.5]
    assert len(account.left_out) == 3 * 2
    assert any("force_per_command_n" in remark for remark in account.remarks) is (unit == "N m")


def test_a_trace_that_tells_axes_by_number_alone_is_drafted_to_be_checked(tmp_path: Path) -> None:
    nameless = tuple((name, text.removeprefix("{A}1: "), column) for name, text, column in (*THREE_AXES, AS_TORQUE))
    trace_of(tmp_path / "trace.xml", {"x": 1, "y": 2}, nameless)
    with pytest.raises(MapNeededError) as refused:
        imported(tmp_path, tmp_path / "trace.xml")
    assert '[columns.y_table_mm]\nfrom = "nckServoDataActPos2ndEnc64[u1,2]"' in refused.value.draft


def test_each_group_of_twincat_channels_keeps_its_own_rate(tmp_path: Path) -> None:
    run, account = imported(tmp_path, SAMPLES / "twincat_scope.txt")
    assert held(run.t_s) == [0.0, 0.001, 0.002, 0.003, 0.004]
    assert held(run["x_ref_mm"]) == [0.0, None, 0.2, None, 0.4]
    assert held(run["x_torque_a"]) == [1.5, 1.6, 1.7, 1.8, 1.9]
    assert not account.faults
    assert account.written.first_ns == (132959733843760000 - 116444736000000000) * 100


def test_forces_of_a_dynamometer_become_newtons(tmp_path: Path) -> None:
    run, account = imported(tmp_path, SAMPLES / "dynoware.txt")
    assert (len(run), run.t_s[1]) == (100, 0.0001)
    assert held(run["force_x_n"])[:3] == [0.0, 500.0, 1000.0]
    assert held(run["force_y_n"])[:3] == [0.0, -1.0, -2.0]
    assert account.left_out == ("Fz",)


def test_without_a_map_a_doubt_is_drafted_and_the_draft_is_a_map(tmp_path: Path) -> None:
    with pytest.raises(MapNeededError, match="Zeit states no unit; ms is guessed") as needed:
        imported(tmp_path, SAMPLES / "delimited.csv")
    assert not (tmp_path / "run.parquet").exists()
    run, account = imported(tmp_path, SAMPLES / "delimited.csv", columns=needed.value.draft)
    assert held(run.t_s)[:2] == [0.0, 0.001]
    assert held(run["x_ref_mm"])[:3] == [0.0, 0.1, 0.2]
    assert run["x_pos_mm"][10] == pytest.approx(1.0, abs=0.01)  # inch, with a decimal comma
    assert account.left_out == ("Strom",)


MAP = """
[time]
column = "t"
unit = "ms"

[columns.x_pos_mm]
from = "pos"
unit = "in"
scale = -1.0
offset = 2.0

[columns.spindle_temp_c]
from = "temp"
unit = "°F"

[columns.coolant_on]
from = "kss"
true = ["AN"]
false = ["AUS"]

[columns.exec_state]
from = "mode"
values = { RUN = "ACTIVE" }

[columns.feed_override_pct]
from = "ovr"
unit = "1"

[options]
nulls = ["***"]
"""
TABLE = "t;pos;temp;kss;mode;ovr;more\n0;1,5;212;AN;RUN;0,9;x\n1;***;kalt;AUS;IDLE;;x\n2;2,5;;?;RUN;1,0;x\n3;3,5;68;AN"


@pytest.mark.parametrize("encoding", ["utf-8", "utf-8-sig", "utf-16", "utf-16-le"])
def test_a_map_converts_and_what_cannot_be_read_is_no_value_and_counted(tmp_path: Path, encoding: str) -> None:
    run, account = imported(tmp_path, written(tmp_path / "plant.csv", TABLE, encoding), columns=MAP)
    assert held(run.t_s) == [0.0, 0.001, 0.002]
    assert held(run["x_pos_mm"]) == [-36.1, None, -61.5]
    assert held(run["spindle_temp_c"]) == [100.0, None, None]
    assert held(run["coolant_on"]) == [1.0, 0.0, None]
    assert held(run["feed_override_pct"]) == [90.0, None, 100.0]
    assert [*run.text["exec_state"]] == ["ACTIVE", None, "ACTIVE"]
    assert account.tallies["spindle_temp_c"].faults == {"no numbers": 1}
    assert account.tallies["spindle_temp_c"].example == "kalt"
    assert sum(account.tallies["coolant_on"].faults.values()) == 1
    assert sum(account.tallies["exec_state"].faults.values()) == 1
    assert sum(account.faults["plant.csv"].values()) == 1  # the last line is cut
    assert account.left_out == ("more",)
    told = json.loads(as_json(account, tmp_path / "run.parquet"))
    assert (told["rows"], told["columns"]["x_pos_mm"]["scale"], told["not_taken"]) == (3, -25.4, ["more"])


STEADY = '[columns.x_pos_mm]\nfrom = "p"\n[options]\nheader_lines = 2\nnames_line = 1\nseparator = ","\n[time]\n'


@pytest.mark.parametrize(("time", "step_s"), [("rate_hz = 500.0", 0.002), ("period_s = 0.0006", 0.0006)])
def test_rows_without_times_come_at_the_rate_of_the_map(tmp_path: Path, time: str, step_s: float) -> None:
    table = written(tmp_path / "a.csv", "p,q\nsome remark\n1,2\n3,4\n5,6\n")
    run, _ = imported(tmp_path, table, columns=STEADY + time)
    assert held(run.t_s) == [0.0, round(step_s, 9), round(2 * step_s, 9)]
    assert held(run["x_pos_mm"]) == [1.0, 3.0, 5.0]


@pytest.mark.parametrize(
    ("form", "first", "second"),
    [
        ("ISO 8601", "2026-03-01T23:59:59.9999999Z", "2026-03-02T00:00:00.2500000Z"),
        ("ISO 8601", "2026-03-02 00:59:59,75+01:00", "2026-03-02 01:00:00.0+01:00"),
        ("%d.%m.%Y %H:%M:%S.%f", "01.03.2026 23:59:59.75", "02.03.2026 00:00:00.0"),
    ],
)
def test_stamps_are_read_to_the_last_digit(tmp_path: Path, form: str, first: str, second: str) -> None:
    table = written(tmp_path / "a.csv", f"when;p\n{first};1\n{second};2\nsoon;3\n")
    columns = f'[time]\ncolumn = "when"\nformat = "{form}"\n[columns.x_pos_mm]\nfrom = "p"\n[options]\nseparator = ";"'
    columns += "\ndata_line = 2\nnames_line = 1"
    run, account = imported(tmp_path, table, columns=columns)
    assert run.t_s[1] == pytest.approx(0.2500001 if "9999999" in first else 0.25, abs=1e-9)
    assert account.faults == {"a.csv": {"rows whose time cannot be read": 1}}


def log(path: Path, start: float, rows: int, more: str = "") -> Path:
    lines = [f"{start + n / 10:.1f},{n}{more}" for n in range(rows)]
    return written(path, "\n".join(["t_s,x_pos_mm" + (",feed_override_pct" if more else ""), *lines]))


def test_files_in_a_row_go_on_by_their_times_and_a_gap_is_said(tmp_path: Path) -> None:
    run, account = imported(tmp_path, log(tmp_path / "a.csv", 0.0, 10), log(tmp_path / "b.csv", 3.0, 10))
    assert (len(run), run.t_s[10], run.t_s[-1]) == (20, 3.0, 3.9)
    assert "gap of 2.1 s between a.csv and b.csv" in account.remarks


def test_a_file_that_begins_anew_is_put_behind_and_the_gap_is_called_unknown(tmp_path: Path) -> None:
    run, account = imported(tmp_path, log(tmp_path / "a.csv", 0.0, 10), log(tmp_path / "b.csv", 0.0, 10))
    assert (len(run), round(run.t_s[10], 9), round(run.t_s[-1], 9)) == (20, 1.0, 1.9)
    assert any("b.csv begins again at 0 s" in remark and "not known" in remark for remark in account.remarks)


def test_what_two_files_both_have_is_taken_once(tmp_path: Path) -> None:
    run, account = imported(tmp_path, log(tmp_path / "a.csv", 0.0, 10), log(tmp_path / "b.csv", 0.7, 10))
    assert (len(run), round(run.t_s[-1], 9)) == (17, 1.6)
    assert account.faults == {"b.csv": {"rows that an earlier file has already": 3}}


def test_an_override_holds_in_the_file_that_follows(tmp_path: Path) -> None:
    first = log(tmp_path / "a.csv", 0.0, 3, ",80")
    second = log(tmp_path / "b.csv", 1.0, 3)
    run, _ = imported(tmp_path, first, second)
    assert held(run["feed_override_pct"]) == [80.0, 80.0, 80.0, 80.0, None, None]


def test_files_with_dates_are_taken_in_their_order(tmp_path: Path) -> None:
    def dated(name: str, hour: int) -> Path:
        stamps = [f"2026-03-02T{hour:02d}:00:0{n}Z,{hour}" for n in range(3)]
        return written(tmp_path / name, "\n".join(["time,x_pos_mm", *stamps]))

    run, account = imported(tmp_path, dated("late.csv", 9), dated("early.csv", 8))
    assert held(run["x_pos_mm"]) == [8.0] * 3 + [9.0] * 3
    assert run.t_s[3] == 3600.0
    assert any("in the order of their dates: early.csv, late.csv" in remark for remark in account.remarks)


def test_a_run_log_comes_out_as_it_went_in(tmp_path: Path) -> None:
    table = pa.table(
        {"t_s": [0.0, 0.5], "b_ref_deg": [1.0, 2.0], "line": [10, 20], "exec_state": ["ACTIVE", "READY"], "other": [1, 2]}
    )
    pq.write_table(table, tmp_path / "log.parquet")
    import_files([tmp_path / "log.parquet"], None, tmp_path / "out.parquet")
    assert pq.read_table(tmp_path / "out.parquet").to_pydict() == table.drop(["other"]).to_pydict() | {"line": [10.0, 20.0]}


def test_values_that_cannot_be_are_none_and_counted(tmp_path: Path) -> None:
    table = written(tmp_path / "a.csv", "t_s,spindle_load_pct\n0,50\n1,950\n2,60\n")
    run, account = imported(tmp_path, table)
    assert held(run["spindle_load_pct"]) == [50.0, None, 60.0]
    assert account.tallies["spindle_load_pct"].faults == {"outside 0 to 200, so no values": 1}


def test_entities_of_a_trace_are_refused(tmp_path: Path) -> None:
    bomb = '<?xml version="1.0"?><!DOCTYPE t [<!ENTITY a "aaaa">]><t><traceData><dataFrame><rec time="0"/>'
    with pytest.raises(UsageError, match="entities"):
        imported(tmp_path, written(tmp_path / "bomb.xml", bomb))


def test_a_trace_that_is_cut_keeps_what_came(tmp_path: Path) -> None:
    text = (SAMPLES / "sinumerik_trace.xml").read_text()
    run, account = imported(tmp_path, written(tmp_path / "cut.xml", text[: text.index('<rec time="0.006"') + 20]))
    assert len(run) == 3
    assert any("end of the file" in what for what in account.faults["cut.xml"])


@pytest.mark.parametrize(
    ("columns", "message"),
    [
        ('[columns.wrong]\nfrom = "p"', "columns.wrong is no column of a run log"),
        ('[columns.x_pos_mm]\nfrom = "p"\nunit = "kg"', "unit = 'kg' does not become its unit; there are mm"),
        ('[time]\ncolumn = "t"\n[columns.x_pos_mm]\nfrom = "q"', "no file has its column q; there are t, p"),
        ('[time]\ncolumn = "u"\n[columns.x_pos_mm]\nfrom = "p"', "there is no column u for the times; there are t, p"),
        ('[columns.x_pos_mm]\nfrom = "p"', "which column is the time, or period_s"),
        ("[time]\nperiod_s = 1.0\nrate_hz = 1.0", "has period_s and rate_hz"),
        ('[columns.x_pos_mm]\nfrom = "p"\nfactor = 2', "columns.x_pos_mm.factor is not known"),
        ("[columns", "is no TOML"),
        (
            '[time]\ncolumn = "t"\n[columns.axis_x_pos_mm]\nfrom = "p"\n[columns.x_pos_mm]\nfrom = "p"',
            "x_pos_mm is given twice",
        ),
        (
            '[time]\ncolumn = "t"\n[columns.b_pos_deg]\nfrom = "p"\n[columns.b_pos_mm]\nfrom = "p"',
            "an axis turns or goes straight",
        ),
    ],
)
def test_a_map_that_cannot_be_used_is_refused_in_one_line(tmp_path: Path, columns: str, message: str) -> None:
    table = written(tmp_path / "a.csv", "t,p\n1,2\n3,4\n")
    with pytest.raises(UsageError) as error:
        imported(tmp_path, table, columns=columns)
    assert message in str(error.value)
    assert "\n" not in str(error.value)
    assert [path.name for path in tmp_path.iterdir() if "run" in path.name] == []


def test_a_large_file_is_read_in_blocks(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("cnctwin.importing.dialects.delimited.BLOCK_BYTES", 2000)
    run, _ = imported(tmp_path, log(tmp_path / "a.csv", 0.0, 5000))
    assert len(run) == 5000
    assert np.array_equal(run["x_pos_mm"], np.arange(5000.0))
    assert pq.ParquetFile(tmp_path / "run.parquet").num_row_groups > 10


def test_columns_between_spaces_are_a_table(tmp_path: Path) -> None:
    text = "TNCscope\n   time    s act.    s nom.\n  0.000   1.00   1.01\n  0.003   1.10   1.11\n  0.006   1.20   1.21\n"
    columns = (
        '[time]\ncolumn = "time"\nunit = "s"\n[columns.x_pos_mm]\nfrom = "column_2"\n[columns.x_ref_mm]\nfrom = "column_3"\n'
    )
    table = written(tmp_path / "a.txt", text)
    run, _ = imported(tmp_path, table, columns=columns.replace('"time"', '"column_1"'))
    assert held(run.t_s) == [0.0, 0.003, 0.006]
    assert held(run["x_ref_mm"]) == [1.01, 1.11, 1.21]
