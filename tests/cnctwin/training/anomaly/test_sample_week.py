"""The sample week: what `train anomaly` learns from by default is in it."""

from pathlib import Path

import numpy as np
import pytest
from typer.testing import CliRunner

from cnctwin.commands.learn.train.app import train_app
from cnctwin.training.anomaly.recorded_cell import shared_features
from cnctwin.training.anomaly.train import FEATURES
from twin.runlog import RunLog, read_run


@pytest.fixture(scope="module")
def made(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, str]:
    folder = tmp_path_factory.mktemp("sample")
    done = CliRunner().invoke(train_app, ["sample", "--out", str(folder), "--days", "1", "--machines", "2"])
    assert done.exit_code == 0, done.output
    return folder, done.output


def weeks(folder: Path) -> tuple[RunLog, RunLog]:
    return read_run(folder / "vmc1.parquet"), read_run(folder / "vmc2.parquet")


def test_it_says_the_command_that_trains_from_it(made: tuple[Path, str]) -> None:
    folder, said = made
    command = f"cnctwin train anomaly vmc1={folder / 'vmc1.parquet'} vmc2={folder / 'vmc2.parquet'}"
    assert said.splitlines()[-1] == f"train from it: {command}"


def test_it_has_all_that_the_default_of_training_judges_and_places_a_cut_by(made: tuple[Path, str]) -> None:
    folder, _ = made
    files = [f"{name}={folder / name}.parquet" for name in ("vmc1", "vmc2")]
    assert set(shared_features(files, FEATURES)) == set(FEATURES) - {"vibration_rms_g"}
    for week in weeks(folder):
        assert week.has("tool_number", "line", "tool_change_active")
        assert len(set(week.text["program"])) == 3
        assert np.nanmax(week["spindle_load_pct"]) > 10.0


def test_no_machine_is_like_the_other(made: tuple[Path, str]) -> None:
    first, second = weeks(made[0])
    assert len(first) != len(second)
