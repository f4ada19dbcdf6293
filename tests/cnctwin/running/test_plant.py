"""`cnctwin up`: a folder that `cnctwin init` has set up runs, comes back from a kill, and ends with all its processes."""

import os
import signal
import socket
from collections.abc import Iterator
from pathlib import Path

import pytest
from typer.testing import CliRunner

from cnctwin.cli import app
from cnctwin.errors import UsageError
from cnctwin.plant.view import machines
from cnctwin.running.plant import Plant
from cnctwin.running.plant_folder import PlantFolder, variables
from cnctwin.standins.mtconnect_agent.replay_agent import ReplayAgent
from cnctwin.standins.simulated_machine.description import DEVICES, SPARE_PART
from sparkplug.broker import BrokerAddress
from sparkplug.host import HostApplication
from tests.cnctwin.program import Program, children, is_alive, until
from tests.wire.mosquitto import free_port

pytestmark = pytest.mark.broker
PARTS = {"mosquitto", "historian", "process", "serve", "jobs", "twin", "edge"}


@pytest.fixture
def plant(tmp_path: Path, mosquitto_program: str) -> Iterator[Path]:
    """A plant of one machine, whose agent runs."""
    with ReplayAgent(SPARE_PART, DEVICES, speed=0) as agent:
        agent.step(200)
        folder = tmp_path / "plant"
        assert CliRunner().invoke(app, ["init", str(folder), "--yes", "--control", agent.url]).exit_code == 0
        yield folder


def broker_of(program: Program) -> BrokerAddress:
    line = next(line for line in program.out.splitlines() if line.startswith("broker:"))
    return BrokerAddress.from_url(line.split()[1])


def test_everything_begins_comes_back_and_ends(tmp_path: Path, plant: Path) -> None:
    with Program(tmp_path, "up", str(plant), "--port", str(free_port())) as program:
        until(lambda: "Ctrl-C ends it" in program.out, "everything to begin", 120.0)
        assert "machines:  vmc" in program.out
        running = children(program.process.pid)
        assert running.keys() == PARTS
        host = HostApplication(broker_of(program), "look", publish_state=False)
        host.start()
        try:
            until(lambda: bool(host.poll(0.1)) and any(one.name == "vmc" for one in machines(host)), "the machine on the broker")
        finally:
            host.stop()
        os.kill(running["edge"], signal.SIGKILL)
        until(lambda: children(program.process.pid).get("edge", running["edge"]) != running["edge"], "the edge to come back")
        until(lambda: "edge ended and was started again" in program.out, "what is said of it")
        pids = children(program.process.pid).values()
        assert program.ask_to_end(signal.SIGTERM) == 0
        assert not any(map(is_alive, pids))


def test_a_page_whose_port_is_taken_has_another_one(plant: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("cnctwin.running.plant.is_free", lambda port: True)  # taken a moment later
    with socket.socket() as taken:
        taken.bind(("127.0.0.1", 0))
        taken.listen()
        running = Plant(PlantFolder(plant), taken.getsockname()[1])
        running.folder.state.mkdir()
        try:
            url = running._page(["--config", str(running.folder.processors), "--broker", "mqtt://127.0.0.1:1"])
            assert url.startswith("http://127.0.0.1:")
            assert not url.endswith(f":{taken.getsockname()[1]}")
        finally:
            running.stop()


def test_a_folder_that_is_no_plant_is_refused(tmp_path: Path) -> None:
    with pytest.raises(UsageError, match=r"has no processors\.toml; `cnctwin init"):
        Plant(PlantFolder(tmp_path), 8080).start()


def test_secrets_that_others_may_read_are_refused(tmp_path: Path) -> None:
    folder = PlantFolder(tmp_path)
    folder.secrets.parent.mkdir()
    folder.secrets.write_text("CNCTWIN_PASSWORD=s3cret\n")
    folder.secrets.chmod(0o644)
    with pytest.raises(UsageError, match=r"others than its owner may use it; chmod 600") as error:
        folder.environment()
    assert "s3cret" not in str(error.value)


def test_a_line_that_is_no_variable_is_named(tmp_path: Path) -> None:
    file = tmp_path / "plant.env"
    file.write_text("# ours\nA=1\n\nB = two words \nthree\n")
    with pytest.raises(UsageError, match="line 5 is not NAME=VALUE"):
        variables(file)
    file.write_text("# ours\nA=1\n\nB = two words \n")
    assert variables(file) == {"A": "1", "B": "two words"}
