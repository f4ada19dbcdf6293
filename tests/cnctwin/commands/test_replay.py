"""`cnctwin replay` says where its configuration may be another than that of the day."""

import json
import os
from pathlib import Path

from typer.testing import CliRunner

from cnctwin.cli import app
from cnctwin.commands.keep.replay import configuration_notes
from cnctwin.standins.simulated_machine.description import DEVICES, SPARE_PART

DAY_MS = 1_795_327_200_000


def test_a_replay_without_the_days_configuration_says_so() -> None:
    (note,) = configuration_notes(None, {}, ["thermal", "gap"], DAY_MS)
    assert note == "no --config: thermal, gap ran with default settings, not with those of that day; give the file as it was then"


def test_a_file_that_was_changed_since_or_lacks_a_table_is_told(tmp_path: Path) -> None:
    file = tmp_path / "processors.toml"
    file.write_text("[thermal]\n")
    os.utime(file, (DAY_MS / 1000 - 60, DAY_MS / 1000 - 60))
    assert configuration_notes(file, {"thermal": {}}, ["thermal"], DAY_MS) == []
    os.utime(file, (DAY_MS / 1000 + 60, DAY_MS / 1000 + 60))
    changed, missing = configuration_notes(file, {"thermal": {}}, ["thermal", "gap"], DAY_MS)
    assert "was changed on 2026-11-22 06:01:00 UTC, after this stretch" in changed
    assert missing == f"{file} has no table for gap; default settings were used"


def test_the_answer_has_the_note_for_a_person_and_for_a_program(tmp_path: Path) -> None:
    store = str(tmp_path / "store")
    ran = CliRunner().invoke(
        app, ["store", "import", str(SPARE_PART), "--devices", str(DEVICES), "--machine", "vmc", "--store", store]
    )
    assert ran.exit_code == 0, ran.output
    asked = ["replay", "--machine", "vmc", "--store", store, "--from", "1", "--processors", "thermal"]
    assert "note: no --config: thermal ran with default settings" in CliRunner().invoke(app, asked).output
    told = json.loads(CliRunner().invoke(app, [*asked, "--json"]).output)
    assert told["configuration"]["file"] is None
    assert "default settings" in told["configuration"]["notes"][0]
