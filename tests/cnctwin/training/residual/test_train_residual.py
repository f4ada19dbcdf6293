"""`cnctwin train residual`: from run logs and from a store to a model that the processor takes, or to why there is none."""

import json
import re
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import typer
from typer.testing import CliRunner

from cnctwin.commands.learn.train.residual import train_residual
from cnctwin.errors import UsageError
from cnctwin.memory.store.contract import Message
from cnctwin.memory.store.opening import open_store
from cnctwin.training.residual.recording import from_files, from_store
from processors.residual import PROCESSOR
from sparkplug.host_session import EventKind, HostEvent
from sparkplug.metric import NodeId, Reading
from sparkplug.quality import Quality
from tests.twin.residual.days import PHYSICS_TOLD, recorded, wandering
from twin.residual.features import MEASURED, PHYSICS
from twin.residual.table import Recorded
from twin.runlog import run_log, write_run

app = typer.Typer()
app.command()(train_residual)
SMALL = ("--trees", "8", "--depth", "10", "--row-s", "60")


def _run_log(path: Path, of: Recorded) -> Path:
    columns = {name: values for name, values in of.signals.items() if name != PHYSICS}
    columns = {f"{name[5]}_pos_mm" if name.startswith("axis_") else name: values for name, values in columns.items()}
    write_run(run_log({"t_s": of.t_s, **columns}), path)
    return path


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Run logs, and the constants that the twin is told."""
    found = tmp_path_factory.mktemp("recordings")
    _run_log(found / "good.parquet", recorded())
    _run_log(found / "chance.parquet", wandering(1, 1200.0))
    constants = "\n".join(f"{name} = {value}" for name, value in PHYSICS_TOLD.model_dump().items() if value is not None)
    (found / "processors.toml").write_text(f"[thermal.machines.okuma]\n{constants}\n")
    return found


def _ran(folder: Path, *more: str) -> Any:
    given = ["--machine", "okuma", "--config", str(folder / "processors.toml"), *SMALL, *more]
    return CliRunner().invoke(app, given)


def test_run_logs_become_a_model_that_the_processor_takes(folder: Path, tmp_path: Path) -> None:
    done = _ran(folder, str(folder / "good.parquet"), "--out", str(tmp_path), "--hours-min", "10")
    assert done.exit_code == 0, done.output
    for said in ("gain over the physics alone: ", "90 % interval of", "in the region of training: ", "what a feature is worth",
                 "warm_up", "fewer hours were allowed", f'models = "{tmp_path}"'):  # fmt: skip
        assert said in done.output
    model = PROCESSOR.configured({"models": str(tmp_path)}).read["okuma"]
    assert model.trained.physics == PHYSICS_TOLD
    assert model.version in done.output
    assert (tmp_path / "residual" / "okuma" / model.version / "manifest.json").exists()


def test_a_second_model_waits_to_be_promoted(folder: Path, tmp_path: Path) -> None:
    given = (str(folder / "good.parquet"), "--out", str(tmp_path), "--hours-min", "10", "--features", "lean")
    first = json.loads(_ran(folder, *given, "--json").output)["model"]
    second = _ran(folder, *given, "--seed", "1")
    assert f"{first} goes on counting" in second.output
    assert PROCESSOR.configured({"models": str(tmp_path)}).read["okuma"].version == first


def test_a_worthless_model_is_not_kept(folder: Path, tmp_path: Path) -> None:
    done = _ran(folder, str(folder / "chance.parquet"), "--out", str(tmp_path), "--hours-min", "10", "--features", "published")
    assert done.exit_code == 1
    assert "NO MODEL: gain over" in done.output
    assert list(tmp_path.iterdir()) == []


def test_too_few_hours_are_refused_unless_they_are_allowed(folder: Path, tmp_path: Path) -> None:
    done = _ran(folder, str(folder / "good.parquet"), "--out", str(tmp_path), "--hours-min", "400")
    assert isinstance(done.exception, UsageError)
    first, plan, way_out = str(done.exception).split("\n")
    assert first == "okuma: not enough to train on yet"
    assert re.fullmatch(
        r"  cutting \(.*\): [\d.]+ h of 16.7 days seen in 60 h; .* days more, at the present rate in .* days", plan
    )
    assert way_out.startswith("  record on, or allow fewer with --hours-min ")


WRONG = {
    "no file": (("nothing.parquet", "--out", "x"), "there is no such file"),
    "no time": (("--out", "x", "--store", "s", "--from", "yesterday"), "--from 'yesterday' is no moment"),
    "all held out": (("nothing.parquet", "--out", "x", "--held-share", "0.9"), "can be held out"),
    "no constants": (("nothing.parquet", "--out", "x", "--config", "nothing.toml"), "nothing.toml"),
}


@pytest.mark.parametrize("case", WRONG.values(), ids=WRONG.keys())
def test_wrong_input_is_told_in_one_line(
    folder: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, case: tuple[tuple[str, ...], str]
) -> None:
    monkeypatch.chdir(tmp_path)
    error = _ran(folder, *case[0]).exception
    assert isinstance(error, UsageError)
    assert case[1] in str(error)
    assert "\n" not in str(error)


def test_the_store_gives_what_the_run_log_gives(folder: Path, tmp_path: Path) -> None:
    whole = recorded()
    part = slice(0, 1200)
    begin_ms, node = 1_767_225_600_000, NodeId("cnc", "edge-okuma")
    names = [name for name in whole.signals if name != PHYSICS]
    store = open_store(tmp_path / "store", writable=True)
    told: dict[str, float] = {}
    messages = []
    for place in range(1200):
        at_ms = begin_ms + round(whole.t_s[place] * 1000)
        now = {name: float(whole.signals[name][place]) for name in names}
        readings = tuple(
            Reading(name, value, at_ms, Quality.GOOD, None, None, False) for name, value in now.items() if told.get(name) != value
        )
        kind = EventKind.DATA if told else EventKind.BIRTH
        messages.append(Message(at_ms, HostEvent(kind, node, "okuma", at_ms, readings)))
        told = now
    store.append(messages)
    store.close()
    reader = open_store(tmp_path / "store", writable=False)
    found = from_store(reader, "okuma", (None, None), PHYSICS_TOLD, lambda _: None)
    with pytest.raises(UsageError, match="the store has no signal of it that a residual could be learned from; it has: okuma"):
        from_store(reader, "mazak", (None, None), PHYSICS_TOLD, lambda _: None)
    reader.close()
    cut = _run_log(
        tmp_path / "cut.parquet", Recorded(whole.t_s[part], whole.stretch[part], {n: whole.signals[n][part] for n in names})
    )
    expected = from_files([cut], PHYSICS_TOLD, lambda _: None)
    shared, ours, theirs = np.intersect1d(np.round(found.t_s - begin_ms / 1000), np.round(expected.t_s), return_indices=True)
    assert len(shared) > 30_000
    for name in (PHYSICS, MEASURED):
        apart = np.abs(found.signals[name][ours] - expected.signals[name][theirs])
        assert np.nanquantile(apart, 0.9) < 0.05
