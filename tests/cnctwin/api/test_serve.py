"""`cnctwin serve` as a user starts it."""

import json
import signal
from pathlib import Path
from threading import Event

import httpx
import pytest

from cnctwin.api.application import create_app
from cnctwin.api.serve import ServeOptions, serve
from cnctwin.api.server import Server
from cnctwin.api.sources import Sources
from cnctwin.errors import UsageError
from cnctwin.memory.store.contract import Message
from cnctwin.memory.store.opening import open_store
from processors.errors import ConfigurationError
from sparkplug.broker import BrokerAddress
from tests.cnctwin.api.served_plant import LOAD, PATIENCE_S, get, machine, tell
from tests.cnctwin.api.small_plant import birth, data, small_plant
from tests.cnctwin.program import Program, until
from tests.wire.mosquitto import Mosquitto

TOKEN = "a-token-of-more-than-sixteen"
T0 = 1_760_000_000_000
DEAD = "mqtt://127.0.0.1:1"  # a port that no test is given


def told(file: Path) -> dict[str, object]:
    found: dict[str, object] = json.loads(file.read_text()) if file.exists() else {}
    return found


@pytest.mark.broker
def test_it_serves_a_plant_keeps_its_state_file_and_ends_when_it_is_asked(mosquitto: Mosquitto, tmp_path: Path) -> None:
    file, url = tmp_path / "state.json", f"mqtt://127.0.0.1:{mosquitto.port}"
    options = ("--broker", url, "--port", "0", "--no-open", f"--state-file={file}", f"--store={tmp_path / 'store'}")
    with machine(mosquitto) as edge, Program(tmp_path, "serve", *options) as program:
        until(lambda: bool(tell(edge, 12.5)) and told(file).get("machines") == 1, "the state file to have the machine", 60.0)
        state = told(file)
        assert state["pid"] == program.process.pid
        assert get(f"{state['url']}/state/vmc").json()["measured"][LOAD]["value"] == 12.5
        assert f"{state['url']} shows the plant of {url}" in program.out
        assert program.ask_to_end(signal.SIGTERM) == 0
        assert program.err == ""


def test_it_starts_green_without_a_broker_gives_the_same_answers_after_a_kill_and_logs_no_secret(tmp_path: Path) -> None:
    store = open_store(tmp_path / "store", writable=True)
    store.append([Message(T0, birth({LOAD: 0.0}, T0)), *(Message(T0 + n, data({LOAD: float(n)}, T0 + n)) for n in range(1, 50))])
    store.close()
    file, secret, none = tmp_path / "state.json", tmp_path / "token", str(tmp_path / "none")
    secret.write_text(TOKEN)
    secret.chmod(0o600)
    paths = {"state-file": file, "token-file": secret, "store": tmp_path / "store", "models": none, "diagnoses": none}
    options = ["--broker", DEAD, "--port", "0", "--no-open", *(f"--{name}={path}" for name, path in paths.items())]
    query, answers = f"/history/vmc?signals={LOAD}&from={T0}&to={T0 + 100}", []
    for number in (signal.SIGKILL, signal.SIGINT):
        file.unlink(missing_ok=True)
        with Program(tmp_path, "serve", *options) as program:
            until(lambda: "url" in told(file), "the state file", 60.0)
            bearer = {"Authorization": f"Bearer {TOKEN}"}
            with httpx.Client(base_url=str(told(file)["url"]), headers=bearer, timeout=PATIENCE_S) as client:
                assert client.get("/readyz").json() == {"ready": True}
                parts = client.get("/health").json()["parts"]
                assert {"broker", "machines", "models", "alerts", "diagnoses"} <= {
                    one["part"] for one in parts if one["state"] == "missing"
                }
                assert client.post("/login", json={"token": TOKEN}).status_code == 204
                assert client.get(f"/machines?token={TOKEN}").status_code == 200
                answers.append(client.get(query).json())
            assert get(f"{told(file)['url']}/machines").status_code == 401
            code = program.ask_to_end(number)
            said = program.out + program.err + (file.read_text() if file.exists() else "")
            assert TOKEN not in said
            assert "/machines" not in said
    assert (code, program.err) == (0, "")
    assert answers[0] == answers[1]
    assert len(answers[0]["columns"][0]["t"]) == 50


@pytest.mark.parametrize(
    ("options", "line"),
    [
        (ServeOptions(host="0.0.0.0"), "open to the network"),
        (ServeOptions(proxy="10.0.0.5"), "go together"),
        (ServeOptions(token_file=Path("/nowhere")), "--token-file /nowhere"),
        (ServeOptions(config=Path("/nowhere.toml")), "/nowhere.toml"),
        (ServeOptions(host="not-a-name.invalid", token_file=None), "not-a-name.invalid is"),
    ],
)  # fmt: skip
def test_what_must_not_be_is_refused_before_anything_is_served(options: ServeOptions, line: str) -> None:
    with pytest.raises((UsageError, ConfigurationError), match=line):
        serve(options, BrokerAddress(), Event())


def test_a_port_that_is_taken_is_said_in_one_line() -> None:
    with Server(create_app(Sources(small_plant()))) as first, pytest.raises(UsageError, match="cannot be had") as refused:
        serve(ServeOptions(port=first.port), BrokerAddress(), Event())
    assert f"port {first.port} of 127.0.0.1" in str(refused.value)
