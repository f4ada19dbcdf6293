"""Training of parts, the default: recordings with program, line and tool become models that know their parts and a threshold."""

import json
import tomllib
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from typer.testing import CliRunner

from cnctwin.commands.learn.train.app import train_app
from cnctwin.errors import UsageError
from cnctwin.training.anomaly.parts_cell import PartTicks, cell_of_parts
from processors.joint_anomaly.processor import PROCESSOR
from tests.twin.anomaly.parts.milled import SIGNALS, parts, recorded
from twin.anomaly.common_mode import Method
from twin.anomaly.errors import ModelError
from twin.anomaly.model import load_golden, load_model
from twin.runlog import RunLog, run_log, write_run

COUNT = 40
OFTEN = ["--alerts-per-week", "4000"]
TICKS = PartTicks(signals=SIGNALS, tick_ms=1000, gap_ms=600_000, tail_s=2.0, look_back_s=0.0)


def log_of(rows: list[dict[str, Any]], without: frozenset[str] = frozenset()) -> RunLog:
    """The rows as a run log, each half a second before its tick."""
    columns: dict[str, Any] = {"t_s": np.arange(len(rows)) + 0.5}
    for name in (*SIGNALS, "tool_number", "tool_change_active"):
        columns[name] = np.array([float(row[name]) for row in rows])
    columns["line"] = np.array([float(row["nc_line"]) for row in rows])
    columns["program"] = np.array([row["program"] for row in rows], dtype=object)
    return run_log({name: column for name, column in columns.items() if name not in without})


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Two machines over an hour, and what training makes of them."""
    place = tmp_path_factory.mktemp("parts")
    for seed, name in enumerate("ab"):
        write_run(log_of(parts(seed, COUNT)), place / f"{name}.parquet")
    done = run("anomaly", *named(place), "--out", place / "models", *OFTEN)
    assert done.exit_code == 0, done.output
    (place / "told.txt").write_text(done.output)
    return place


def named(place: Path) -> list[str]:
    return [f"{name}={place / name}.parquet" for name in "ab"]


def run(*arguments: str | Path) -> Any:
    return CliRunner().invoke(train_app, [str(one) for one in arguments])


def test_a_run_log_becomes_the_ticks_that_the_control_told() -> None:
    rows = parts(1, 3)
    (found,) = cell_of_parts(("a",), [{"a": log_of(rows)}], TICKS)
    expected = recorded(rows, first_tick=1)
    assert found.first_tick == 1
    for name in ("values", "program", "tool", "line", "gated"):
        np.testing.assert_array_equal(getattr(found, name), getattr(expected, name)[: len(found.values)])
    assert len(found.values) == len(rows) - 1  # the last row is half a second after the last tick
    assert found.programs == ("O1",)


def test_stretches_that_were_recorded_apart_leave_a_gap_that_is_not_known() -> None:
    stretches = [{"a": log_of(parts(1, 1)), "b": log_of(parts(2, 1))}, {"a": log_of(parts(3, 1))}]
    a, b = cell_of_parts(("a", "b"), stretches, TICKS)
    assert len(a.values) == len(b.values) == 91 + 3600 + 91
    assert a.is_known is not None and b.is_known is not None
    assert (a.is_known.sum(), b.is_known.sum()) == (182, 91)


def test_the_default_is_parts_and_the_processor_takes_what_is_trained(folder: Path) -> None:
    text = (folder / "told.txt").read_text()
    table = tomllib.loads(text[text.index("[joint_anomaly]") :])["joint_anomaly"]
    configured = PROCESSOR.configured(table)
    assert configured.default.common_mode is Method.PARTS
    for name in "ab":
        model = load_model(folder / "models" / name)
        assert model.features == SIGNALS
        assert model.parts is not None
        assert set(model.parts.usual) == {"O1|T1|1", "O1|T2|1"}
        assert model.calibration is not None and model.calibration.threshold > 0.0
        assert configured.read[name].parts_id == model.parts_id != ""


def test_the_golden_week_can_be_followed_again_and_a_changed_model_fails_on_it(folder: Path) -> None:
    assert run("check", folder / "models").exit_code == 0
    golden = load_golden(folder / "models" / "a")
    assert golden is not None and golden.told is not None
    known = np.isfinite(golden.scores)
    assert known.mean() > 0.9
    assert 0.05 < golden.gated.mean() < 0.5
    other = run("check", folder / "models" / "a", "--against", folder / "models" / "b")
    assert "check another on recordings" in str(other.exception)


def test_alerts_of_a_recording_are_counted_with_the_parts_before_them(folder: Path, tmp_path: Path) -> None:
    write_run(log_of(parts(0, COUNT, dict.fromkeys(range(20, 40, 4), 2.0))), tmp_path / "a.parquet")
    write_run(log_of(parts(1, COUNT)), tmp_path / "b.parquet")
    done = run("check", folder / "models", *named(tmp_path), "--json")
    told = {line["machine"]: line for line in json.loads(done.output)}
    assert told["a"]["alerts"] > 0
    assert told["a"]["weeks"] == pytest.approx(told["b"]["weeks"], rel=0.05)


def test_a_file_of_parts_that_was_changed_is_refused(folder: Path, tmp_path: Path) -> None:
    copy = tmp_path / "model"
    copy.mkdir()
    for file in (folder / "models" / "a" / "current").iterdir():
        (copy / file.name).write_bytes(file.read_bytes())
    (copy / "parts.json").write_bytes((copy / "parts.json").read_bytes() + b" ")
    with pytest.raises(ModelError, match=r"parts\.json: its SHA-256 is .* copy the model again"):
        load_model(copy)


def test_what_the_recordings_do_not_tell_is_said(tmp_path: Path) -> None:
    write_run(log_of(parts(1, COUNT), frozenset({"line", "program"})), tmp_path / "a.parquet")
    done = run("anomaly", f"a={tmp_path / 'a.parquet'}", "--out", tmp_path / "models", *OFTEN)
    assert done.exit_code == 0, done.output
    assert "the recordings tell no program, line: a part is known as far as the others go" in done.output


def test_too_little_is_said_in_one_line(tmp_path: Path) -> None:
    write_run(log_of(parts(1, 2)), tmp_path / "a.parquet")
    done = run("anomaly", f"a={tmp_path / 'a.parquet'}", "--out", tmp_path / "models", *OFTEN)
    assert isinstance(done.exception, UsageError), (done.output, done.exception)
    assert "\n" not in str(done.exception)
    assert not (tmp_path / "models").exists()
