"""The commands that run one part: the replay agent, an edge, and the check of its configuration."""

import json
import urllib.request
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest

from cnctwin.cli import main
from cnctwin.running.edges import run
from cnctwin.standins.mtconnect_agent.replay_agent import ReplayAgent
from cnctwin.standins.mtconnect_agent.serve import replay
from cnctwin.standins.simulated_machine.description import DEVICES
from cnctwin.standins.simulated_machine.description import SPARE_PART as RECORDING
from sparkplug.broker import BrokerAddress
from sparkplug.host import HostApplication
from tests.cnctwin.program import until
from tests.until_stopped import until_stopped
from tests.wire.mosquitto import Mosquitto, free_port

LINES = len(RECORDING.read_text(encoding="utf-8").splitlines())


@pytest.fixture
def agent() -> Iterator[ReplayAgent]:
    with ReplayAgent(RECORDING, DEVICES, speed=0) as served:
        served.step(100)
        yield served


def edge_file(tmp_path: Path, agent: ReplayAgent, broker_port: int) -> Path:
    file = tmp_path / "vmc.toml"
    file.write_text(
        f'[machine]\nname = "vmc"\n[broker]\nurl = "mqtt://127.0.0.1:{broker_port}"\n[mtconnect]\nurl = "{agent.url}"\n'
    )
    return file


def test_the_replay_serves_the_recording_and_keeps_its_state_for_whoever_started_it(
    tmp_path: Path, capfd: pytest.CaptureFixture[str]
) -> None:
    file = tmp_path / "agent.json"

    def state() -> dict[str, Any]:
        return json.loads(file.read_text()) if file.exists() else {}

    with until_stopped(replay, RECORDING, DEVICES, speed=float("inf"), state_file=file):
        until(lambda: bool(state().get("finished")), "the recording to end")
        assert state()["device"] == "VMC"
        with urllib.request.urlopen(state()["url"] + "/probe", timeout=60) as answer:
            assert b"MTConnectDevices" in answer.read()
    first, last = capfd.readouterr().out.splitlines()
    assert first == f"{state()['url']} serves {RECORDING.name} as VMC; Ctrl-C ends it"
    assert last.startswith(f"lines {LINES}, ")
    assert state()["ledger"]["lines"] == LINES
    assert list(tmp_path.iterdir()) == [file], "no half-written file stays"


@pytest.mark.broker
def test_the_given_broker_takes_the_place_of_that_in_the_file(agent: ReplayAgent, mosquitto: Mosquitto, tmp_path: Path) -> None:
    broker = BrokerAddress(*mosquitto.address)
    file = edge_file(tmp_path, agent, free_port())
    host = HostApplication(broker, "look", publish_state=False)
    host.start()

    def machine_is_there() -> bool:
        host.poll(0.1)
        return any("vmc" in picture.devices for node in host.nodes() if (picture := host.picture(node)))

    try:
        with until_stopped(run, file, broker):
            until(machine_is_there, "the machine to be born")
    finally:
        host.stop()


def test_a_check_needs_no_broker_and_a_program_can_read_it(
    agent: ReplayAgent, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capfd: pytest.CaptureFixture[str]
) -> None:
    file = edge_file(tmp_path, agent, free_port())
    for option in ([], ["--json"]):
        monkeypatch.setattr("sys.argv", ["cnctwin", "edge", "check", str(file), *option])
        with pytest.raises(SystemExit) as ended:
            main()
        assert not ended.value.code
    table, _, rows = capfd.readouterr().out.rstrip("\n").rpartition("\n")
    assert "spindle_rpm" in table
    by_signal = {row["signal"]: row for row in json.loads(rows)}
    assert by_signal["spindle_rpm"]["unit"] == "rev/min"
    assert f"{len(by_signal)} signals would be published" in table


def test_a_draft_is_a_configuration_that_can_be_checked(
    agent: ReplayAgent, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capfd: pytest.CaptureFixture[str]
) -> None:
    file = tmp_path / "draft.toml"
    for words in (["discover", agent.url], ["check", str(file)]):
        monkeypatch.setattr("sys.argv", ["cnctwin", "edge", *words])
        with pytest.raises(SystemExit) as ended:
            main()
        assert not ended.value.code
        if words[0] == "discover":
            file.write_text(capfd.readouterr().out)
    assert "signals would be published" in capfd.readouterr().out
