"""`cnctwin train anomaly`: recordings of a cell become models, thresholds and golden weeks that the processor can take."""

import json
import tomllib
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from typer.testing import CliRunner

from cnctwin.commands.learn.train.app import train_app
from cnctwin.errors import UsageError
from cnctwin.training.anomaly.calibrated_cell import Calibrated, TrainingSettings, calibrated_cell
from cnctwin.training.anomaly.recorded_cell import part, recorded_cell
from cnctwin.training.anomaly.replayed_cell import replayed
from cnctwin.training.anomaly.time_split import split
from processors.errors import ConfigurationError
from processors.joint_anomaly.processor import PROCESSOR
from tests.cnctwin.training.anomaly.cells import FEATURES, machine_log
from twin.anomaly.common_mode import Method
from twin.anomaly.detector import Detector
from twin.anomaly.golden_check import checked
from twin.anomaly.model import load_golden, load_model, load_models
from twin.runlog import run_log, write_run

SMALL = Detector(parameters={"n_estimators": 20, "contamination": 0.25})
OFTEN = 4000.0  # alerts a week that 45 minutes can tell of
HOUR_S = 3600.0


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Three machines over an hour and a half, one with bursts of load near the end, all with tool changes."""
    place = tmp_path_factory.mktemp("runs")
    for number, name in enumerate("abc"):
        write_run(machine_log(5400.0, number, period_s=1.0, sparse=True), place / f"{name}.parquet")
    return place


def named(folder: Path, names: str = "abc") -> list[str]:
    return [f"{name}={folder / name}.parquet" for name in names]


def trained(folder: Path, **asked: Any) -> tuple[Calibrated, ...]:
    asked = {"alerts_per_week": OFTEN, "common_mode": Method.SOURCE, "calm_s": 0.0, **asked}
    given = TrainingSettings(features=FEATURES, detector=SMALL, **asked)
    return calibrated_cell(recorded_cell(named(folder), FEATURES, given.tick_s), given)


def run(*arguments: str | Path) -> Any:
    return CliRunner().invoke(train_app, [str(one) for one in arguments])


QUICK = [
    "--parameter",
    "n_estimators=20",
    "--parameter",
    "contamination=0.25",
    "--alerts-per-week",
    "4000",
    "--common-mode",
    "source",
    "--calm-s",
    "0",
]


def test_what_it_writes_is_what_the_processor_takes(folder: Path, tmp_path: Path) -> None:
    done = run("anomaly", *named(folder), "--out", tmp_path / "models", *QUICK)
    assert done.exit_code == 0, done.output
    assert sorted(load_models(tmp_path / "models")) == ["a", "b", "c"]
    table = tomllib.loads(done.output[done.output.index("[joint_anomaly]") :])["joint_anomaly"]
    assert len(PROCESSOR.configured(table).read) == 3
    with pytest.raises(ConfigurationError, match="dwell_ticks"):
        PROCESSOR.configured({**table, "dwell_ticks": 5})
    with pytest.raises(ConfigurationError, match="calm_s"):
        PROCESSOR.configured({**table, "calm_s": 60.0})


def test_what_is_usual_in_each_operation_goes_with_the_model(folder: Path, tmp_path: Path) -> None:
    done = run("anomaly", *named(folder), "--out", tmp_path / "models", *QUICK, "--common-mode", "features")
    assert done.exit_code == 0, done.output
    for model in load_models(tmp_path / "models").values():
        assert model.preparation is not None
        assert model.preparation.signals == model.features
        assert set(model.preparation.regimes) == {"?|?|?"}  # nothing tells of programs or tools here
    table = tomllib.loads(done.output[done.output.index("[joint_anomaly]") :])["joint_anomaly"]
    assert PROCESSOR.configured(table).default.common_mode is Method.FEATURES
    assert run("check", tmp_path / "models").exit_code == 0
    other = run("check", tmp_path / "models" / "a", "--against", tmp_path / "models" / "b")
    assert "check another on recordings" in str(other.exception)


def test_it_says_rows_hours_threshold_and_the_interval_of_its_alerts(folder: Path, tmp_path: Path) -> None:
    done = run("anomaly", *named(folder), "--out", tmp_path / "models", "--json", *QUICK)
    told = json.loads(done.output)["machines"][0]
    assert told["machine"] == "a"
    assert told["rows"] == pytest.approx(2700, abs=120)
    assert told["calibration_hours"] == pytest.approx(0.75, abs=0.05)
    assert told["gated_share"] == pytest.approx((7.3 + 8.0) / 400.0, abs=0.015)
    assert told["threshold"] > 0.0
    assert told["low"] <= told["estimate"] <= told["high"]
    assert not told["is_extrapolated"]
    assert Path(told["model"]).is_dir()
    words = run("anomaly", *named(folder, "a"), "--out", tmp_path / "other", *QUICK).output
    assert "alerts a machine-week (90 % interval" in words


def test_the_same_recordings_and_seed_give_the_same_model(folder: Path) -> None:
    one, other = trained(folder, at="2026-01-01"), trained(folder, at="2026-01-01")
    assert [found.model.calibration for found in one] == [found.model.calibration for found in other]


@pytest.mark.parametrize(
    "settings",
    [
        {},
        {"common_mode": Method.RESIDUAL},
        {"exclude_gated_peers": True},
        {"common_mode": Method.FEATURES, "dwell_ticks": 2},
        {"look_back_s": 5.0},
        {"tick_s": 2.0},
    ],
)
def test_the_golden_week_is_what_the_processor_made_of_the_recordings(folder: Path, settings: dict[str, Any]) -> None:
    done = trained(folder, **settings)
    assert sum(found.alerts for found in done) > 3
    for found in done:
        assert found.golden.alerts == found.alerts
        assert checked(found.model, found.golden).passes
        assert found.golden.weeks == pytest.approx(2700.0 / 604_800.0, rel=0.1)


def test_raw_scores_of_the_golden_week_are_those_of_the_stream(folder: Path) -> None:
    cell, asked = (
        recorded_cell(named(folder), FEATURES, 1.0),
        TrainingSettings(features=FEATURES, detector=SMALL, alerts_per_week=OFTEN, common_mode=Method.SOURCE),
    )
    models = {found.machine: found.model for found in calibrated_cell(cell, asked)}
    _, calibrating = split(cell, asked.train_share)
    tracks = replayed(calibrating[0], models, {**asked.settings, "threshold": 1.0})
    for found in calibrated_cell(cell, asked):
        raw = tracks[found.machine].raw
        assert np.array_equal(found.golden.scores[: len(raw)], raw, equal_nan=True)


def test_a_tool_change_is_not_trained_on_and_stands_out_in_the_raw_score(folder: Path) -> None:
    found = trained(folder)[0]
    gated = found.golden.gated & np.isfinite(found.golden.scores)
    assert np.nanmedian(found.golden.scores[gated]) > np.nanquantile(found.golden.scores[~gated], 0.9)


def test_several_runs_of_a_machine_are_cut_as_one_time(folder: Path, tmp_path: Path) -> None:
    for number in range(3):
        write_run(machine_log(600.0, number), tmp_path / f"{number}.csv")
    cell = recorded_cell([str(tmp_path / f"{number}.csv") for number in range(3)], FEATURES, 1.0)
    assert cell.machines == ("0",)
    training, calibrating = split(cell, 0.5)
    assert [len(stretch["0"]) for stretch in training] == [1200, 600]
    assert [len(stretch["0"]) for stretch in calibrating] == [600, 1200]


def test_what_was_said_before_a_cut_still_holds_after_it() -> None:
    log = run_log({"t_s": np.arange(6.0), "spindle_rpm": np.array([1.0, np.nan, 3.0, np.nan, np.nan, 6.0])})
    kept = part(log, 3.0, 5.0)
    assert kept is not None
    assert kept["spindle_rpm"].tolist() == pytest.approx([3.0, np.nan], nan_ok=True)


def test_a_model_that_alerts_too_often_on_the_golden_week_is_kept_but_not_promoted(
    folder: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    out = tmp_path / "models"
    run("anomaly", *named(folder, "a"), "--out", out, *QUICK)
    first = load_model(out / "a")
    monkeypatch.setattr("twin.anomaly.golden_check.most_alerts", lambda expected: -1)
    done = run("anomaly", *named(folder, "a"), "--out", out, "--seed", "5", *QUICK)
    assert "NOT promoted" in done.output
    assert load_model(out / "a").trained == first.trained
    versions = sorted(path.name for path in (out / "a").iterdir() if not path.is_symlink())
    assert len(versions) == 2
    current = (out / "a" / "current").resolve().name
    other = next(version for version in versions if version != current)
    assert run("promote", out, "a", other).exit_code == 0
    assert (out / "a" / "current").resolve().name == other


def test_check_passes_on_the_golden_week_and_fails_where_scores_moved(folder: Path, tmp_path: Path) -> None:
    out = tmp_path / "models"
    run("anomaly", *named(folder, "a"), "--out", out, *QUICK)
    assert run("check", out).exit_code == 0
    assert "a: passes" in run("check", out / "a").output
    other = tmp_path / "other"
    run("anomaly", *named(folder, "a"), "--out", other, "--seed", "9", *QUICK)
    champion, challenger = out / "a" / "current", other / "a" / "current"
    (challenger.resolve() / "golden.npz").write_bytes((champion / "golden.npz").read_bytes())
    manifest = json.loads((challenger / "manifest.json").read_text())
    manifest["golden_sha256"] = json.loads((champion / "manifest.json").read_text())["golden_sha256"]
    (challenger.resolve() / "manifest.json").write_text(json.dumps(manifest))
    done = run("check", other, "--json")
    assert done.exit_code == 1
    assert "scores are not the frozen ones" in json.loads(done.output)[0]["faults"][0]
    assert run("check", other, "--against", out).exit_code in {0, 1}  # as a challenger it is its alerts that count


def test_check_counts_alerts_in_recordings(folder: Path, tmp_path: Path) -> None:
    out = tmp_path / "models"
    run("anomaly", *named(folder), "--out", out, *QUICK)
    bursts = machine_log(3000.0, 77, period_s=1.0, burst_s=range(100, 2900, 60))
    write_run(bursts, tmp_path / "burst.parquet")
    for name in "bc":
        write_run(machine_log(3000.0, 80, period_s=1.0), tmp_path / f"{name}.parquet")
    done = run("check", out, f"a={tmp_path / 'burst.parquet'}", *named(tmp_path, "bc"), "--json")
    told = {line["machine"]: line for line in json.loads(done.output)}
    assert done.exit_code == 1
    assert told["a"]["alerts"] > told["a"]["alerts_max"]
    assert not told["b"]["faults"]
    wrong = run("check", out, f"z={tmp_path / 'burst.parquet'}")
    assert isinstance(wrong.exception, UsageError)
    assert "there is no model of z; there are a, b, c" in str(wrong.exception)


def broken(folder: Path, tmp_path: Path) -> dict[str, tuple[list[str | Path], str]]:
    write_run(machine_log(30.0, 1), tmp_path / "short.csv")
    still = machine_log(2000.0, 1)
    write_run(run_log({"t_s": still.t_s, **{name: np.ones(len(still)) for name in FEATURES}}), tmp_path / "still.csv")
    few = machine_log(600.0, 1)
    write_run(run_log({"t_s": few.t_s, "spindle_rpm": few["spindle_rpm"]}), tmp_path / "few.csv")
    write_run(run_log({"t_s": few.t_s + 9000.0, **few.columns}), tmp_path / "later.parquet")
    a = named(folder, "a")
    return {
        "no such file": ([tmp_path / "none.parquet"], "there is no such file"),
        "a signal that is not there": (
            [tmp_path / "few.csv", "--features", "spindle_load_pct,spindle_rpm,feed_mm_min"],
            "no spindle_load_pct, feed_mm_min in it; there are spindle_rpm: choose with --features",
        ),
        "too short": ([tmp_path / "short.csv"], "rows have all features: at least 64"),
        "nothing moves": ([tmp_path / "still.csv"], "the model cannot tell normal from unusual"),
        "other numbers of runs": ([*a, *a, *named(folder, "b")], "different numbers of runs .a 2, b 1."),
        "no common time": ([*a, f"b={tmp_path / 'later.parquet'}"], "have no time in common"),
        "no such detector": ([*a, "--detector", "magic"], "there is no detector 'magic'"),
        "no such parameter": ([*a, "--parameter", "trees=3"], "cannot be trained: .*trees"),
        "a parameter without a value": ([*a, "--parameter", "trees"], "it has to be NAME=VALUE"),
        "no such common mode": ([*a, "--common-mode", "median"], "--common-mode median: it is one of source, residual"),
        "too little for a week": ([*a, "--alerts-per-week", "0.1"], "a: no threshold can be fitted: .* h or more"),
        "no features": ([*a, "--features", ","], "--features is empty"),
    }


CASES = [
    *("no such file", "a signal that is not there", "too short", "nothing moves", "other numbers of runs", "no common time"),
    *(
        "no such detector",
        "no such parameter",
        "a parameter without a value",
        "no such common mode",
        "no features",
        "too little for a week",
    ),
]


@pytest.mark.parametrize("case", CASES)
def test_wrong_input_is_one_line_with_the_way_out(case: str, folder: Path, tmp_path: Path) -> None:
    arguments, message = broken(folder, tmp_path)[case]
    done = run(
        "anomaly", *arguments, "--out", tmp_path / "out", *(() if "--common-mode" in arguments else ("--common-mode", "source"))
    )
    assert isinstance(done.exception, UsageError), (done.output, done.exception)
    assert "\n" not in str(done.exception)
    with pytest.raises(UsageError, match=message):
        raise done.exception
    assert not (tmp_path / "out").exists()


def test_without_a_tool_change_signal_nothing_is_gated_and_it_says_so(tmp_path: Path) -> None:
    log = machine_log(2000.0, 3)
    write_run(run_log({"t_s": log.t_s, **{name: log[name] for name in FEATURES}}), tmp_path / "m.parquet")
    done = run("anomaly", tmp_path / "m.parquet", "--out", tmp_path / "out", *QUICK)
    assert "nothing tells of tool changes" in done.output
    golden = load_golden(tmp_path / "out" / "m")
    assert golden is not None
    assert not golden.gated.any()
