"""Programs are planned by a version, published with it, and what the twin of program times is."""

import json
from dataclasses import replace
from pathlib import Path

import pytest
from typer.testing import CliRunner

from cnctwin.cli import app
from cnctwin.errors import UsageError
from cnctwin.machines.folder import MachineFolder
from cnctwin.machines.planned import keep_planned, planned
from processors.description import Description, DescriptionMessage, Role
from processors.description_folder import DescriptionFolder
from processors.gap.comparison import times_compared
from processors.gap.config import Config
from processors.gap.described import described
from processors.gap.timing import Timed
from twin.errors import MachineError
from twin.vocabulary.program_names import program_key

TOML = "[machine]\nname = 'vmc'\n[program]\nrapid_mm_min = 30000.0\nacceleration_mm_s2 = 1e6\ntool_change_s = 5.0\n"
TEXT = "%\nO7\nG21 G90 G94 G1 X100. F6000.\nT2 M6\nX300.\nM30\n%\n"


@pytest.fixture
def plant(tmp_path: Path) -> Path:
    """A folder of descriptions with one machine, and its programs."""
    (tmp_path / "machines").mkdir()
    (tmp_path / "machines" / "vmc.toml").write_text(TOML)
    (tmp_path / "nc").mkdir()
    (tmp_path / "nc" / "O7.NC").write_text(TEXT)
    (tmp_path / "nc" / "broken.nc").write_text("G1 X100.\n")
    (tmp_path / "nc" / "read.me").write_text("no program")
    return tmp_path


def test_the_command_plans_what_it_can_and_says_what_it_cannot(plant: Path) -> None:
    command = ["twin", "programs", "vmc", "--programs", str(plant / "nc"), "--machines", str(plant / "machines")]
    found = CliRunner().invoke(app, command)
    assert found.exit_code == 0, found.output
    assert "o7: 3.0 s in 2 sections" in found.output
    assert "broken.nc is not planned" in found.output
    version = MachineFolder(plant / "machines", "vmc").live_version()
    kept = json.loads((plant / "machines" / "history" / "vmc" / f"{version}.programs.json").read_text())
    assert kept == {"o7": [1.0, 2.0]}


def test_what_is_missing_is_named(plant: Path) -> None:
    machine = Description.from_toml(TOML).machine
    with pytest.raises(UsageError, match="no such folder"):
        planned(machine, plant / "elsewhere")
    with pytest.raises(MachineError, match=r"\[program\] is missing"):
        planned(Description.from_toml("[machine]\nname = 'bare'").machine, plant / "nc")


def test_a_version_is_published_again_once_its_programs_are_planned(plant: Path) -> None:
    of, folder = MachineFolder(plant / "machines", "vmc"), DescriptionFolder(plant / "machines")
    later_s = 4e9
    (first,) = folder.look(later_s)
    assert first.message is not None and not first.message.programs
    keep_planned(of, of.live_version(), {"o7": (1.0, 2.0)})
    (second,) = folder.look(later_s)
    assert (second.machine, second.role) == ("vmc", Role.LIVE)
    assert second.message is not None and second.message.programs == {"o7": (1.0, 2.0)}
    assert second.message.version == first.message.version != second.message.edition
    assert not folder.look(later_s)
    again = DescriptionMessage.model_validate_json(second.message.payload())
    assert again.description("vmc").edition == second.message.edition


def test_a_section_is_compared_with_its_planned_time(plant: Path) -> None:
    found, _ = planned(Description.from_toml(TOML).machine, plant / "nc")
    given = described(Config(), replace(Description.from_toml(TOML), programs=found))
    ended = [Timed("program_time_s", f"section {n} of /P/O7", 2.5, 2.5, program="/P/O7", section=n) for n in (1, 2)]
    one, unplanned = times_compared(given, tuple(ended))
    assert (one.gap, one.is_learned) == (pytest.approx(-0.5), False)
    assert unplanned.is_learned
    assert program_key("/P/O7") in found
