"""A plant's folder is set up with a real agent, a real Mosquitto and a receiver that takes what is sent."""

import json
import stat
import subprocess
from collections.abc import Iterator
from http.server import BaseHTTPRequestHandler, HTTPServer
from pathlib import Path
from threading import Thread
from typing import Any

import pytest
from typer.testing import CliRunner

from cnctwin.cli import app
from cnctwin.standins.mtconnect_agent.replay_agent import ReplayAgent
from cnctwin.standins.simulated_machine.description import DEVICES, SPARE_PART
from edge.config_file import load
from processors.running.runtime import configured
from tests.wire.mosquitto import Mosquitto, free_port
from twin.machine import read_machine

Received = list[dict[str, Any]]


@pytest.fixture
def agent() -> Iterator[str]:
    with ReplayAgent(SPARE_PART, DEVICES, speed=0) as running:
        running.step(200)
        yield running.url


@pytest.fixture
def webhook() -> Iterator[tuple[str, Received]]:
    received: Received = []

    class Taker(BaseHTTPRequestHandler):
        def do_POST(self) -> None:
            received.append(json.loads(self.rfile.read(int(self.headers["Content-Length"]))))
            self.send_response(200)
            self.end_headers()

        def log_message(self, *_: object) -> None:
            """Say nothing."""

    server = HTTPServer(("127.0.0.1", 0), Taker)
    thread = Thread(target=server.serve_forever, daemon=True)
    thread.start()
    yield f"http://127.0.0.1:{server.server_port}/hook/s3cret", received
    server.shutdown()
    thread.join()
    server.server_close()


def init(folder: Path, *options: str, answers: str | None = None) -> tuple[int, str]:
    """Return the exit code, and what was printed or what is wrong."""
    done = CliRunner().invoke(app, ["init", str(folder), *options, *(["--yes"] if answers is None else [])], input=answers)
    return done.exit_code, done.output + (str(done.exception) if done.exception is not None else "")


def contents(folder: Path) -> dict[str, str]:
    return {str(path.relative_to(folder)): path.read_text() for path in folder.rglob("*") if path.is_file()}


def test_answers_by_options_make_files_that_every_program_takes(
    tmp_path: Path, agent: str, mosquitto: Mosquitto, webhook: tuple[str, Received]
) -> None:
    host, port = mosquitto.address
    broker = f"mqtt://{host}:{port}"
    code, said = init(tmp_path, "--control", agent, "--broker", broker, "--alerts", webhook[0], "--class", "vmc-40")
    assert code == 0, said
    assert "spindle_load_pct" in said
    assert f"{broker}: connected" in said
    assert said.splitlines()[-1] == f"start it with `cnctwin up {tmp_path}`; the page is on http://127.0.0.1:8080 then"
    edge = load(tmp_path / "edges" / "vmc.toml")
    assert (edge.machine.name, edge.broker.url, edge.source.url) == ("vmc", broker, agent)
    assert read_machine(tmp_path / "machines" / "vmc.toml").machine.name == "vmc"
    assert [processor.name for processor, _ in configured(["alerts", "historian"], tmp_path / "processors.toml")] == [
        "alerts",
        "historian",
    ]
    assert [one["receiver"] for one in webhook[1]] == ["operators"]
    assert f"CNCTWIN_BROKER={broker}\n" in (tmp_path / "plant.env").read_text()


@pytest.fixture
def guarded(tmp_path_factory: pytest.TempPathFactory, mosquitto_program: str) -> Iterator[str]:
    """A broker that asks for a password."""
    users = tmp_path_factory.mktemp("broker") / "users"
    subprocess.run(["mosquitto_passwd", "-b", "-c", str(users), "ada", "s3cret word"], check=True, capture_output=True)
    with Mosquitto(extra=(f"password_file {users}", "allow_anonymous false")) as running:
        yield f"mqtt://ada@127.0.0.1:{running.port}"


def test_the_password_of_a_broker_is_asked_for_tried_and_kept_apart(tmp_path: Path, agent: str, guarded: str) -> None:
    code, said = init(tmp_path, "--control", agent, "--machine", "vmc", answers=f"{guarded}\ns3cret word\nnone\nvmc-40\ny\n")
    assert code == 0, said
    assert "CNCTWIN_PASSWORD=s3cret word\n" in (tmp_path / "secrets" / "plant.env").read_text()
    edge = load(tmp_path / "edges" / "vmc.toml")
    assert (edge.broker.url, edge.broker.password_env) == (guarded, "CNCTWIN_PASSWORD")
    assert [name for name, text in contents(tmp_path).items() if "s3cret" in text] == ["secrets/plant.env"]


def test_a_wrong_password_is_not_written(tmp_path: Path, guarded: str, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("CNCTWIN_PASSWORD", "guessed")
    code, said = init(tmp_path, "--broker", guarded)
    assert code != 0
    assert "guessed" not in said
    assert contents(tmp_path) == {}


def test_another_broker_becomes_that_of_every_edge(tmp_path: Path, agent: str, mosquitto: Mosquitto) -> None:
    for name in ("one", "two"):
        init(tmp_path, "--control", agent, "--machine", name)
    broker = f"mqtt://127.0.0.1:{mosquitto.port}"
    init(tmp_path, "--machine", "two", "--broker", broker)
    assert [load(tmp_path / "edges" / f"{name}.toml").broker.url for name in ("one", "two")] == [broker, broker]


def test_a_secret_stands_in_its_own_file_alone_and_is_never_shown(
    tmp_path: Path, webhook: tuple[str, Received], mosquitto_program: str
) -> None:
    _, said = init(tmp_path, "--alerts", webhook[0])
    files = contents(tmp_path)
    assert [name for name, text in files.items() if "s3cret" in text] == ["secrets/plant.env"]
    assert "s3cret" not in said
    assert stat.S_IMODE((tmp_path / "secrets" / "plant.env").stat().st_mode) == 0o600
    assert stat.S_IMODE((tmp_path / "secrets").stat().st_mode) == 0o700


def test_answers_at_prompts_do_the_same(tmp_path: Path, agent: str) -> None:
    code, said = init(tmp_path, answers=f"{agent}\nmill\nprivate\nnone\nhmc\ny\n")
    assert code == 0, said
    assert sorted(contents(tmp_path)) == [
        "cnctwin.service",
        "edges/mill.toml",
        "machines/mill.toml",
        "plant.env",
        "processors.toml",
    ]
    assert "b" in read_machine(tmp_path / "machines" / "mill.toml").axes


def test_again_changes_nothing_and_asks_with_what_is_there(tmp_path: Path, agent: str) -> None:
    init(tmp_path, "--control", agent)
    before = contents(tmp_path)
    assert init(tmp_path)[1].splitlines()[-2] == "nothing has changed"
    code, said = init(tmp_path, answers="\n\n\n")
    assert code == 0, said
    assert f"[{agent}]" in said
    assert contents(tmp_path) == before


def test_again_changes_only_what_is_asked_and_shows_it_first(tmp_path: Path, agent: str, webhook: tuple[str, Received]) -> None:
    init(tmp_path, "--control", agent)
    edge, processors = tmp_path / "edges" / "vmc.toml", tmp_path / "processors.toml"
    for file in (edge, processors):
        file.write_text(file.read_text() + "# a note of Ada's\n")
    before = contents(tmp_path)
    code, said = init(tmp_path, "--alerts", webhook[0])
    assert code == 0, said
    assert '+type = "webhook"' in said
    after = contents(tmp_path)
    assert {name for name in after if after[name] != before.get(name)} == {"processors.toml", "secrets/plant.env"}
    assert set(before["processors.toml"].splitlines()) <= set(after["processors.toml"].splitlines())
    init(tmp_path, "--alerts", "none")
    assert "operators" not in processors.read_text()


def test_a_control_that_has_moved_keeps_what_the_file_says_of_its_signals(tmp_path: Path, agent: str) -> None:
    init(tmp_path, "--control", agent)
    edge = tmp_path / "edges" / "vmc.toml"
    edge.write_text(edge.read_text().replace("[signals.spindle_rpm]", "[signals.spindle_rpm]\ndeadband = 5.0"))
    with ReplayAgent(SPARE_PART, DEVICES, speed=0) as other:
        other.step(200)
        code, said = init(tmp_path, "--control", other.url)
        assert code == 0, said
        moved = load(edge)
        assert (moved.source.url, moved.signals["spindle_rpm"].deadband) == (other.url, 5.0)
        assert [line for line in said.splitlines() if line.startswith(("+url", "-url"))] == [
            f'-url = "{agent}"',
            f'+url = "{other.url}"',
        ]


def test_an_identified_description_stays_unless_a_class_is_named(tmp_path: Path) -> None:
    init(tmp_path, "--machine", "vmc")
    file = tmp_path / "machines" / "vmc.toml"
    file.write_text(file.read_text().replace("mass_kg = 1500.0", "mass_kg = 1234.0"))
    init(tmp_path, "--machine", "vmc")
    assert "1234.0" in file.read_text()
    init(tmp_path, "--machine", "vmc", "--class", "vmc-40")
    assert "1234.0" not in file.read_text()


@pytest.mark.parametrize(
    ("options", "fault"),
    [
        (("--control", "http://127.0.0.1:{port}"), "no control answers at http://127.0.0.1:{port}"),
        (("--broker", "mqtt://127.0.0.1:{port}"), "mqtt://127.0.0.1:{port}: "),
        (("--broker", "mqtt://ada:s3cret@127.0.0.1"), "a broker address must hold no password"),
        (("--alerts", "http://127.0.0.1:{port}/"), "the test was not delivered"),
        (("--alerts", "me"), "alerts go to pushover, to an https:// address"),
        (("--class", "mill"), "class 'mill' is not known; there are five-axis, hmc, lathe, router, vmc-40"),
        (("--machine", "a/b"), "machine name"),
    ],
)
def test_what_does_not_work_is_said_in_one_line_and_nothing_is_written(
    tmp_path: Path, options: tuple[str, ...], fault: str
) -> None:
    port = str(free_port())
    code, said = init(tmp_path, *(option.replace("{port}", port) for option in options))
    assert code != 0
    assert fault.replace("{port}", port) in said.splitlines()[-1]
    assert contents(tmp_path) == {}


@pytest.mark.parametrize("answers", ["none\nvmc\n", "none\nvmc\nprivate\nnone\nvmc-40\nn\n"], ids=["end of input", "no"])
def test_answers_that_end_early_leave_nothing(tmp_path: Path, answers: str) -> None:
    code, _ = init(tmp_path, answers=answers)
    assert code == 1
    assert contents(tmp_path) == {}


def test_ctrl_c_leaves_nothing(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def interrupt(*_: object) -> None:
        raise KeyboardInterrupt

    monkeypatch.setattr("cnctwin.setting_up.set_up.starter_text", interrupt)
    code, said = init(tmp_path)
    assert (code, "nothing was written" in said.splitlines()) == (1, True)
    assert contents(tmp_path) == {}


def test_a_disk_that_is_full_halfway_leaves_what_was_there(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def fail(*_: object) -> None:
        raise OSError(28, "No space left on device", "machines/vmc.toml")

    with monkeypatch.context() as broken:
        broken.setattr("os.fchmod", fail)
        code, said = init(tmp_path, "--machine", "vmc")
    assert (code, "No space left on device" in said) == (1, True)
    assert contents(tmp_path) == {}
