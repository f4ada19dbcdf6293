"""Importing an adapter's recording: the run logs hold what an edge would have published, in stretches without a gap."""

import math
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from cnctwin.importing.shdr import recorded_runs
from cnctwin.standins.simulated_machine.description import DEVICES, SPARE_PART
from tests.recordings import recording
from twin.runlog import read_run


def imported(*arguments: object) -> subprocess.CompletedProcess[str]:
    command = [sys.executable, "-m", "cnctwin", "import", *map(str, arguments)]
    return subprocess.run(command, capture_output=True, text=True, timeout=300, check=False)


def test_the_recording_that_ships_with_the_project_has_its_tool_changes() -> None:
    (run,) = recorded_runs(SPARE_PART, DEVICES)
    active = run["tool_change_active"]
    told = active[np.isfinite(active)]
    assert (np.diff(told) > 0).sum() == 5
    assert run["spindle_rpm"][np.isfinite(run["spindle_rpm"])].max() > 1000.0
    assert {"ACTIVE", "READY"} <= set(run.text["exec_state"])


def test_the_stretches_of_the_okuma_are_runs_of_their_own_with_eleven_changes() -> None:
    log, devices = recording("mtconnect/okuma.txt"), recording("mtconnect/okuma_devices.xml")
    runs = recorded_runs(log, devices, "OKUMA")
    assert [round(run.t_s[-1]) for run in runs] == [189, 609, 552, 25]
    changes = [np.diff(run["tool_change_active"][np.isfinite(run["tool_change_active"])]) for run in runs]
    assert [int((steps > 0).sum()) for steps in changes] == [1, 7, 3, 0]


def test_the_command_writes_a_file_for_each_stretch(tmp_path: Path) -> None:
    lines = SPARE_PART.read_text().splitlines()
    later = [line.replace("2026-03-02T08", "2026-03-02T15") for line in lines[:200]]
    log = tmp_path / "log.txt"
    log.write_text("\n".join([*lines[:200], *later]))
    done = imported(log, "--devices", DEVICES, "--out", tmp_path / "run.csv")
    assert (done.returncode, done.stderr) == (0, "")
    assert "2 stretches in log.txt" in done.stdout
    first, second = (read_run(tmp_path / f"run-{number}.csv") for number in (1, 2))
    assert len(first) == pytest.approx(len(second), abs=2)
    assert not math.isnan(second["spindle_rpm"][0])  # what was known before holds


def test_a_device_model_that_does_not_belong_to_it_is_said(tmp_path: Path) -> None:
    log = tmp_path / "log.txt"
    log.write_text("2026-03-02T08:00:00Z|nothing|1\n2026-03-02T08:00:01Z|nothing|2\n")
    done = imported(log, "--devices", DEVICES, "--out", tmp_path / "run.csv")
    assert done.returncode == 2
    assert done.stderr.count("\n") == 1
    assert "is it the Devices.xml that belongs to it?" in done.stderr


def test_what_a_log_said_holds_in_the_log_that_follows(tmp_path: Path) -> None:
    lines = SPARE_PART.read_text().splitlines()
    (tmp_path / "a.txt").write_text("\n".join(lines[:400]) + "\n")
    (tmp_path / "b.txt").write_text("\n".join(lines[400:]) + "\n")
    (whole,) = recorded_runs(SPARE_PART, DEVICES)
    (joined,) = recorded_runs(tmp_path / "a.txt", DEVICES, None, [tmp_path / "b.txt"])
    assert np.array_equal(joined.t_s, whole.t_s)
    for name, values in whole.columns.items():
        assert np.array_equal(joined[name], values, equal_nan=True), name
    done = imported(tmp_path / "a.txt", tmp_path / "b.txt", "--devices", DEVICES, "--out", tmp_path / "run.csv")
    assert (done.returncode, done.stderr) == (0, "")
    assert "1 stretch in a.txt, b.txt" in done.stdout
    assert len(read_run(tmp_path / "run.csv")) == len(whole)
