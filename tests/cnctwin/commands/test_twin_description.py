"""`cnctwin twin`: show, promote, back and withdraw on the folder, with one line for what may not be."""

import json
import os
import time
from pathlib import Path

import pytest

from cnctwin.cli import main
from cnctwin.composing.compose import compose
from cnctwin.machines.change import changing
from cnctwin.machines.evidence import Card, Score
from cnctwin.machines.folder import MachineFolder
from processors.description import version_of
from sparkplug.broker import BrokerAddress
from sparkplug.datatype import DataType
from sparkplug.edge_node import EdgeNode
from sparkplug.metric import MetricSpec, NodeId
from tests.cnctwin.composing.made_up import DESCRIPTION, store_of_days
from tests.wire.mosquitto import Mosquitto

TOLD = '[machine]\nname = "vmc"\nassumed = ["thermal"]\n[spindle]\nrated_power_kw = 11.0\nefficiency = 0.85\n'
COOLED = TOLD.replace("11.0", "12.0")
CARD = Card(sentence="coolant cools", gap_before=3.1, gap_after=1.1, score=Score(live=3.1, challenger=1.1, runs=2))


@pytest.fixture
def machines(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A folder with one machine, and a challenger that has shown that it is better."""
    monkeypatch.setattr(os, "umask", lambda _: 0o022)
    (tmp_path / "vmc.toml").write_text(TOLD)
    with changing(MachineFolder(tmp_path, "vmc"), time.time_ns() // 1_000_000) as change:
        change.file(COOLED, CARD, "loop", "coolant cools")
    return tmp_path


def ran(monkeypatch: pytest.MonkeyPatch, *arguments: str) -> int:
    monkeypatch.setattr("sys.argv", ["cnctwin", *arguments])
    with pytest.raises(SystemExit) as end:
        main()
    return int(end.value.code or 0)


def test_it_shows_what_is_live_what_is_assumed_and_what_waits(
    machines: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    assert ran(monkeypatch, "twin", "show", "vmc", "--machines", str(machines)) == 0
    out = capsys.readouterr().out
    for said in (
        f"{version_of(TOLD)} is live",
        "assumed: thermal",
        "coolant cools",
        "live 3.1, challenger 1.1",
        "it may be promoted",
    ):
        assert said in out


def test_a_promotion_and_the_way_back_are_two_commands(
    machines: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    place = ("--machines", str(machines), "--by", "anna")
    assert ran(monkeypatch, "twin", "promote", "vmc", *place, "--json") == 0
    assert json.loads(capsys.readouterr().out)["step"]["by"] == "anna"
    assert (machines / "vmc.toml").read_text() == COOLED
    assert ran(monkeypatch, "twin", "back", "vmc", *place, "--why", "worse") == 0
    assert (machines / "vmc.toml").read_text() == TOLD
    assert "is back at" in capsys.readouterr().out
    assert ran(monkeypatch, "twin", "back", "vmc", *place) == 1
    assert "nothing to go back to" in capsys.readouterr().err


def test_the_folder_is_found_by_the_environment(
    machines: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setenv("CNCTWIN_MACHINES", str(machines))
    assert ran(monkeypatch, "twin", "show", "vmc", "--json") == 0
    found = json.loads(capsys.readouterr().out)
    assert (found["live"]["version"], found["challenger"]["version"]) == (version_of(TOLD), version_of(COOLED))
    assert found["steps"][-1]["step"] == "filed" and found["may_promote"] is True


@pytest.mark.parametrize(
    ("arguments", "code", "says"),
    [
        (("show", "lathe"), 2, "no description of 'lathe'; there are vmc"),
        (("show", "../vmc"), 2, "cannot name a file"),
        (("promote", "vmc", "--force"), 2, "--force takes --why"),
        (("promote", "vmc", "--version", "ffff"), 2, "0 versions begin with 'ffff'"),
        (("back", "vmc"), 1, "nothing to go back to"),
    ],
)
def test_what_may_not_be_is_one_line(
    machines: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
    arguments: tuple[str, ...],
    code: int,
    says: str,
) -> None:
    assert ran(monkeypatch, "twin", *arguments, "--machines", str(machines)) == code
    said = capsys.readouterr().err
    assert says in said and said.count("\n") == 1


def test_without_a_folder_it_says_how_to_give_one(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(tmp_path)
    assert ran(monkeypatch, "twin", "show", "vmc") == 2
    assert "--machines DIR" in capsys.readouterr().err


@pytest.mark.broker
def test_with_a_broker_it_shows_the_standing_gap_of_both(
    machines: Path, mosquitto: Mosquitto, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    edge = EdgeNode(BrokerAddress(port=mosquitto.port), NodeId("cnc", "twin-gap"))
    gaps = {"twin/gap_spindle_temp_c": 3.1, "twin/challenger/gap_spindle_temp_c": 1.1}
    edge.declare_device("vmc", [MetricSpec(name, DataType.DOUBLE, value=gap) for name, gap in gaps.items()])
    edge.start()
    try:
        place = ("--machines", str(machines), "--broker", f"mqtt://127.0.0.1:{mosquitto.port}")
        assert ran(monkeypatch, "twin", "show", "vmc", *place, "--wait", "30") == 0
    finally:
        edge.stop()
    assert "standing gap of spindle_temp_c: live 3.10, challenger 1.10 × the repeatability" in capsys.readouterr().out


def test_a_diagnosis_of_ones_own_waits_as_the_challenger_with_its_score(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    store = store_of_days(tmp_path / "store", 2, coolant_gain=2.0)
    compose(store, "vmc", DESCRIPTION, tmp_path / "case")
    store.close()
    described = tmp_path / "machines"
    described.mkdir()
    (described / "vmc.toml").write_text(DESCRIPTION)
    cooled = tmp_path / "twin.toml"
    cooled.write_text(DESCRIPTION + '\n[[effects]]\neffect = "coolant_cooling"\nparameters = { gain = 2.0 }\n')
    arguments = ("twin", "challenge", "vmc", str(cooled), "--machines", str(described), "--by", "anna")
    assert ran(monkeypatch, *arguments) == 0
    assert ran(monkeypatch, "twin", "promote", "vmc", "--machines", str(described)) == 1
    assert "no score on runs that it was not fitted to" in capsys.readouterr().err
    assert ran(monkeypatch, "twin", "withdraw", "vmc", "--machines", str(described)) == 0
    assert ran(monkeypatch, *arguments, "--case", str(tmp_path / "case")) == 0
    assert ran(monkeypatch, "twin", "promote", "vmc", "--machines", str(described)) == 0
    assert (described / "vmc.toml").read_text() == cooled.read_text()
