"""`cnctwin store`: exit codes, and what a program and a person read."""

import json
from pathlib import Path

import pytest
from typer.testing import CliRunner

from cnctwin.commands.keep.store import import_command, store_app
from cnctwin.errors import UsageError
from cnctwin.memory.store.embedded import EmbeddedStore
from cnctwin.memory.store.opening import open_store
from cnctwin.standins.simulated_machine.description import DEVICES, SPARE_PART
from cnctwin.terminal.moment import moment_ms
from tests.cnctwin.memory.store.told import HOUR_MS, T0_MS, reading, told
from twin.runlog import read_run

RUNNER = CliRunner()


@pytest.fixture
def place(tmp_path: Path) -> str:
    store = EmbeddedStore(tmp_path / "store", writable=True)
    for n in range(200):
        t_ms = n * 1000
        said = [
            reading("axis_x_pos_mm", n / 8, t_ms),
            reading("spindle_load_pct", float(n % 50), t_ms),
            reading("alarm", "none", t_ms),
        ]
        store.append([told(said[: 1 + n % 3], t_ms)])
    store.close()
    return str(tmp_path / "store")


def test_the_plan_of_figures_and_of_a_store(place: str, tmp_path: Path) -> None:
    asked = ["plan", "--machines", "8", "--signals", "10", "--rate-hz", "10", "--disk", "400GB", "--json"]
    done = RUNNER.invoke(store_app, asked)
    told_ = json.loads(done.stdout)
    assert done.exit_code == 0 and told_["fits"] and told_["proposed"]["raw_days"] == 365.0
    done = RUNNER.invoke(store_app, ["plan", "--machines", "8", "--vibration-hz", "2000", "--disk", "40GB"])
    assert done.exit_code == 1 and "do not fit" in done.stdout and "disk_gb = 40\n" in done.stdout
    done = RUNNER.invoke(store_app, ["plan", "--store", place, "--disk", "40GB"])
    assert done.exit_code == 0 and "1 machine as measured over 3 min" in done.stdout
    done = RUNNER.invoke(store_app, ["plan", "--store", str(tmp_path / "none"), "--disk", "40GB", "--json"])
    assert "assumed: there is no store at" in json.loads(done.stdout)["load"]["basis"]


def test_status_and_query(place: str) -> None:
    done = RUNNER.invoke(store_app, ["status", "--store", place, "--json"])
    told_ = json.loads(done.stdout)
    assert told_["samples"] == 399 and told_["machines"]["vmc"]["signals"] == 3 and told_["trouble"] == ""
    span = ["--from", str(T0_MS), "--to", str(T0_MS + 3000), "--store", place]
    done = RUNNER.invoke(store_app, ["query", "vmc", "axis_x_pos_mm", *span])
    assert done.stdout.splitlines() == [
        "signal,t,value,unit,quality,reason",
        "axis_x_pos_mm,2026-09-21T06:00:00.000Z,0.0,mm,good,",
        "axis_x_pos_mm,2026-09-21T06:00:01.000Z,0.125,mm,good,",
        "axis_x_pos_mm,2026-09-21T06:00:02.000Z,0.25,mm,good,",
    ]
    done = RUNNER.invoke(store_app, ["query", "vmc", "axis_x_pos_mm", *span, "--every", "1m", "--json"])
    [column] = json.loads(done.stdout)
    assert (column["value"], column["low"], column["high"], column["count"], column["quality"]) == (
        [0.125],
        [0],
        [0.25],
        [3],
        ["good"],
    )
    done = RUNNER.invoke(store_app, ["query", "mill", "axis_x_pos_mm", *span])
    assert isinstance(done.exception, UsageError) and "it has vmc" in str(done.exception)


def test_a_stretch_becomes_a_run_log(place: str, tmp_path: Path) -> None:
    out = tmp_path / "run.parquet"
    span = ["--from", "2026-09-21T06:00", "--to", str(T0_MS + 60_000)]
    done = RUNNER.invoke(store_app, ["export", "vmc", *span, "--out", str(out), "--store", place])
    assert done.stdout == f"60 rows in {out}\n"
    run = read_run(out)
    assert set(run.columns) == {"x_pos_mm", "spindle_load_pct"} and run.t_s[1] == 1.0
    assert run["x_pos_mm"].tolist() == [n / 8 for n in range(60)]
    assert sum(v == v for v in run["spindle_load_pct"]) == 40
    done = RUNNER.invoke(store_app, ["export", "vmc", *span, "--out", str(out), "--store", place, "--held"])
    assert sum(v == v for v in read_run(out)["spindle_load_pct"]) == 59
    done = RUNNER.invoke(
        store_app, ["export", "vmc", "--from", "2020-01-01", "--to", "2020-01-02", "--out", str(out), "--store", place]
    )
    assert "the store has nothing from" in str(done.exception)


def test_moments() -> None:
    assert moment_ms("2026-09-21T06:00") == moment_ms("2026-09-21T08:00+02:00") == T0_MS
    assert moment_ms("-2h", now_ms=T0_MS) == T0_MS - 2 * HOUR_MS
    with pytest.raises(UsageError, match="is no moment; write"):
        moment_ms("yesterday")


def test_a_recording_goes_into_a_store_is_pinned_and_there_once(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    for _ in range(2):
        import_command(SPARE_PART, devices=DEVICES, machine="vmc", where=str(tmp_path / "store"))
    first, second = capsys.readouterr().out.splitlines()
    assert first.startswith("vmc: ")
    assert second.startswith("vmc: 0 samples of ")
    store = open_store(tmp_path / "store")
    try:
        assert [pin.reason for pin in store.pins("vmc")] == [f"imported from {SPARE_PART.name}"]
        assert "spindle_rpm" in store.latest("vmc")
    finally:
        store.close()
    with pytest.raises(UsageError, match="no such file"):
        import_command(tmp_path / "none.txt", where=str(tmp_path / "store"))
