"""The systemd units: each starts a command that there is, and those that share a store share a user and a folder."""

import re
import shlex
import shutil
import subprocess
from pathlib import Path

import pytest

from processors.discovery import discover
from processors.running.runtime import configured
from tests.deploy.command_lines import parsed
from tests.deploy.plant import DEPLOY

FOLDER = DEPLOY / "systemd"
SERVICES = sorted(FOLDER.glob("*.service"))
SHARING = ("cnctwin-historian", "cnctwin-jobs", "cnctwin-loop", "cnctwin-page", "cnctwin-validate@")


def words(unit: Path) -> list[str]:
    """Return what the unit starts."""
    line = re.search(r"^ExecStart=/opt/cnctwin/bin/cnctwin (.*)$", unit.read_text(), re.M)
    assert line, unit
    return shlex.split(line[1].replace("%i", "okuma").replace("%d", "/run/credentials/x").replace("%S", "/var/lib"))


@pytest.mark.parametrize("unit", SERVICES, ids=lambda unit: unit.stem)
def test_the_program_takes_the_command_of_a_unit(unit: Path) -> None:
    given = parsed(words(unit))
    assert str(given.get("config", "/etc/cnctwin/")).startswith("/etc/cnctwin/")


def test_every_processor_runs_in_one_unit_and_is_configured_by_the_file_that_is_shipped() -> None:
    names = [name for unit in SERVICES if words(unit)[0] == "process" for name in parsed(words(unit))["names"]]
    assert len(names) == len(set(names))
    # Needs a detector that was trained on this machine.
    assert set(discover()) - set(names) == {"tool_change_detector"}, "name it in the ExecStart of a unit in deploy/systemd/"
    assert len(configured(names, DEPLOY / "processors.toml")) == len(names)


def test_whoever_needs_the_descriptions_reads_the_folder_that_the_loop_changes_and_the_loop_works_where_the_jobs_are() -> None:
    given = {name: parsed(words(FOLDER / f"{name}.service")) for name in (*SHARING, "cnctwin-processors")}
    folder = Path("/var/lib/cnctwin-history/machines")
    for name in ("cnctwin-historian", "cnctwin-loop", "cnctwin-validate@"):
        assert given[name]["machines"] == folder, name
    assert given["cnctwin-page"]["diagnoses"] == folder / "diagnoses"
    assert given["cnctwin-processors"]["machines"] is None, "another user: it takes them up from the broker"
    jobs, loop, page = (given[f"cnctwin-{name}"] for name in ("jobs", "loop", "page"))
    assert (loop["jobs"], loop["jobs_files"]) == (jobs["folder"], jobs["files"])
    assert page["jobs"] == jobs["folder"]


@pytest.mark.parametrize("name", SHARING)
def test_who_reads_the_store_is_the_user_who_writes_it(name: str) -> None:
    text = (FOLDER / f"{name}.service").read_text()
    for line in ("DynamicUser=yes", "User=cnctwin-history", "StateDirectory=cnctwin-history", "StateDirectoryMode=0700"):
        assert f"\n{line}\n" in text, line


@pytest.mark.parametrize("unit", SERVICES, ids=lambda unit: unit.stem)
def test_no_unit_waits_for_a_word_that_nobody_says(unit: Path) -> None:
    text = unit.read_text()
    assert "Type=notify" not in text and "WatchdogSec" not in text, "the program does not speak sd_notify"
    assert re.search(r"^MemoryMax=\d+[MG]$", text, re.M)
    assert "ProtectSystem=strict" in text


def test_the_night_has_its_hour() -> None:
    timer = FOLDER / "cnctwin-validate@.timer"
    when = re.search(r"^OnCalendar=(.*)$", timer.read_text(), re.M)
    assert when
    assert (FOLDER / "cnctwin-validate@.service").is_file()
    if shutil.which("systemd-analyze") is None:
        pytest.skip("no systemd-analyze on this machine")
    told = subprocess.run(["systemd-analyze", "calendar", when[1]], capture_output=True, text=True, check=True).stdout
    assert "00:10:00" in told
    verified = subprocess.run(["systemd-analyze", "verify", str(timer)], capture_output=True, text=True, check=False)
    assert [line for line in verified.stderr.split("\n") if "timer" in line] == []
