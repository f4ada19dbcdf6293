"""`cnctwin train detector`: what it takes, what it writes, what it says."""

import csv
import io
import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from rich.console import Console

from benchmarks import synthetic_changes as drive
from cnctwin.errors import UsageError
from cnctwin.training.detector.recorded_streams import known_changes, streams_of
from cnctwin.training.detector.train import sentences_of, train_detector
from twin.runlog import run_log, write_run
from twin.transient.artefact import load_detector
from twin.transient.replay import replayed
from twin.transient.stream import Stream
from twin.transient.training import TrainingSettings
from twin.transient.training import trained as detector_of

ASKED = TrainingSettings("spindle_load_pct", before_s=9.0, after_s=9.0)


def recorded(path: Path, seed: int, *, labelled: bool) -> Stream:
    """Five changes among other things at 20 dB, written as a run log."""
    rng = np.random.default_rng(seed)
    stream: Stream = drive.stream_of_changes(5, 20.0, rng, stretched=False, stalled=False)
    t_s = np.arange(len(stream.values)) * 0.1
    columns = {"t_s": t_s, "spindle_load_pct": stream.values}
    if labelled:
        columns["tool_change_active"] = np.array([float(any(0.0 <= t - at < 3.0 for at in stream.changes_s)) for t in t_s])
    write_run(run_log(columns), path)
    return stream


@pytest.fixture
def run(tmp_path: Path) -> Path:
    recorded(tmp_path / "run.parquet", 1, labelled=True)
    return tmp_path / "run.parquet"


def trained(runs: list[Path], out: Path | None, *, at: tuple[float, ...] = (), as_json: bool = False, **how: object) -> str:
    console = Console(file=io.StringIO(), width=200)
    candidates = how.pop("candidates", None)
    assert candidates is None or isinstance(candidates, Path)
    asked = how.pop("asked", ASKED)
    assert isinstance(asked, TrainingSettings)
    train_detector(runs, asked, out, at, candidates, float(str(how.pop("period_s", 0.1))), 0, as_json, console)
    assert isinstance(console.file, io.StringIO)
    return console.file.getvalue()


def test_labelled_history_gives_a_detector_that_finds_changes_in_another_run(run: Path, tmp_path: Path) -> None:
    said = trained([run], tmp_path / "model")
    assert "confirms 5 of the 5 changes" in said and "false gates a day" in said and "extrapolated" in said
    detector, _ = load_detector(tmp_path / "model")
    other = recorded(tmp_path / "other.parquet", 2, labelled=False)
    confirmed = replayed(detector, other).confirmed
    assert all(any(abs((one.begun_s + one.at_s) / 2 - at) < 5.0 for one in confirmed) for at in other.changes_s)


def test_what_opening_early_costs_is_said_in_times_and_minutes_a_day(tmp_path: Path) -> None:
    done = detector_of([recorded(tmp_path / "run.csv", 1, labelled=True)], ASKED, np.random.default_rng(0))
    assert "in these runs it never takes anything else for the beginning of a tool change" in sentences_of(done, ASKED)
    said = " ".join(sentences_of(replace(done, provisional_per_day=325.9, provisional_s_per_day=2445.0), ASKED))
    assert "about 326 times a day" in said and "held back for 41 min a day (2.8 %)" in said


def test_one_time_given_by_a_person_is_enough(tmp_path: Path) -> None:
    stream = recorded(tmp_path / "run.csv", 3, labelled=False)
    trained([tmp_path / "run.csv"], tmp_path / "model", at=(stream.changes_s[1],))
    detector, _ = load_detector(tmp_path / "model")
    confirmed = replayed(detector, stream).confirmed
    assert sum(any(abs((one.begun_s + one.at_s) / 2 - at) < 5.0 for one in confirmed) for at in stream.changes_s) >= 4


def test_the_same_runs_give_the_same_bytes(run: Path, tmp_path: Path) -> None:
    trained([run], tmp_path / "one")
    trained([run], tmp_path / "two")
    for name in ("arrays.npz", "manifest.json"):
        assert (tmp_path / "one" / name).read_bytes() == (tmp_path / "two" / name).read_bytes()


def test_json_holds_every_figure(run: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    trained([run], tmp_path / "model", as_json=True)
    figures = json.loads(capsys.readouterr().out)
    assert figures["provisional_per_day"] == figures["provisional_s_per_day"] == 0.0
    assert figures["changes"] == figures["confirmed"] == 5
    assert set(figures["false_gates"]) >= {"per_day", "low", "high", "null_hours", "is_extrapolated"}
    assert figures["out"] == str(tmp_path / "model")


@pytest.mark.parametrize("suffix", [".csv", ".json"])
def test_candidates_are_listed_for_a_person_to_label(tmp_path: Path, suffix: str) -> None:
    pytest.importorskip("ruptures")
    stream = recorded(tmp_path / "run.parquet", 4, labelled=False)
    path = tmp_path / f"candidates{suffix}"
    said = trained([tmp_path / "run.parquet"], None, candidates=path)
    assert str(path) in said
    text = path.read_text()
    listed = json.loads(text) if suffix == ".json" else list(csv.DictReader(text.splitlines()))
    found = [(float(one["begin_s"]), float(one["end_s"])) for one in listed]
    assert all(any(begin - 3.0 <= at <= end + 3.0 for begin, end in found) for at in stream.changes_s)


def test_a_change_is_known_by_its_flag_or_a_new_number_but_once(tmp_path: Path) -> None:
    t_s = np.arange(0.0, 100.0, 0.5)
    active = ((t_s >= 20.0) & (t_s < 23.0)).astype(float)
    number = np.where(t_s < 20.0, 1.0, np.where(t_s < 23.0, np.nan, np.where(t_s < 60.0, 2.0, 3.0)))
    run = run_log({"t_s": t_s, "spindle_rpm": t_s, "tool_change_active": active, "tool_number": number})
    assert known_changes(run) == [20.0, 60.0]


def test_a_silence_of_minutes_parts_a_stream(tmp_path: Path) -> None:
    t_s = np.concatenate([np.arange(0.0, 50.0, 0.5), np.arange(5000.0, 5050.0, 0.5)])
    write_run(run_log({"t_s": t_s, "spindle_rpm": np.ones(len(t_s))}), tmp_path / "run.parquet")
    streams = streams_of([tmp_path / "run.parquet"], "spindle_rpm", 0.1, [])
    assert [round(stream.begin_s) for stream in streams] == [0, 5000]
    assert all(stream.hours < 0.02 for stream in streams)


def test_what_cannot_be_used_is_one_line(run: Path, tmp_path: Path) -> None:
    model = tmp_path / "model"
    unlabelled = tmp_path / "unlabelled.parquet"
    recorded(unlabelled, 5, labelled=False)
    cases = [
        (lambda: trained([run], model, asked=TrainingSettings("feed_mm_min")), "--signal"),
        (lambda: trained([run], model, asked=TrainingSettings("spindle_rpm")), "there is no spindle_rpm"),
        (lambda: trained([unlabelled], model), "--at"),
        (lambda: trained([unlabelled], model, at=(1e6,)), "outside"),
        (lambda: trained([run], None), "--out"),
        (lambda: trained([run], model, period_s=0.001), "--period"),
        (lambda: trained([tmp_path / "none.parquet"], model), "no such file"),
        (lambda: trained([run], run / "below"), "cannot be written"),
    ]
    for attempt, words in cases:
        with pytest.raises(UsageError, match=words) as caught:
            attempt()
        assert "\n" not in str(caught.value)
