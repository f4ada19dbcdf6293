"""An alarm of a stand-in, by the real edge and a real broker, up to the processor of alerts and the page."""

import json
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager
from pathlib import Path

import pytest

from edge.check import discover
from sparkplug.broker import BrokerAddress
from sparkplug.host import HostApplication
from tests.cnctwin.api.served_plant import get, served
from tests.cnctwin.program import Program, until
from tests.wire.mosquitto import Mosquitto

ALARMS = {"focas": "EX1012 SPINDLE LUBRICATION FAILURE", "opcua": "700012 Spindle lubrication failure"}
SETTINGS = "[control_alarms]\nunknown_severity_counts = true\n"  # FOCAS tells none


@contextmanager
def started(folder: Path, name: str, *arguments: str) -> Iterator[Program]:
    (folder / name).mkdir()
    with Program(folder / name, *arguments) as program:
        yield program


@pytest.fixture
def control(request: pytest.FixtureRequest, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[str]:
    """The address of a stand-in that raises an alarm after each minute of work, which are three seconds here."""
    if request.param == "opcua":
        pytest.importorskip("asyncua")
    monkeypatch.setenv("CNCTWIN_STATE_DIR", str(tmp_path / "state"))
    file = tmp_path / "control.json"
    options = ["--port", "0", "--speed", "20", "--alarm-every-s", "60", "--state-file", str(file)]
    with started(tmp_path, "control", "simulate-control", request.param, *options):
        until(file.exists, "the stand-in to say where it is")
        state = json.loads(file.read_text())
        yield state["url"] + (f"?server_fingerprint={state['fingerprint']}" if "fingerprint" in state else "")


@pytest.mark.parametrize(("control", "text"), ALARMS.items(), indirect=["control"])
def test_an_alarm_is_raised_shown_counted_and_gone_again(tmp_path: Path, mosquitto: Mosquitto, control: str, text: str) -> None:
    host, port = mosquitto.address
    broker = ("--broker", f"mqtt://{host}:{port}")
    (tmp_path / "edge.toml").write_text(discover(control, device="vmc"), encoding="utf-8")
    (tmp_path / "processors.toml").write_text(SETTINGS, encoding="utf-8")
    viewer = HostApplication(BrokerAddress(host, port), "trial", ("spBv1.0/cnc/#",), publish_state=False)
    shown, counted = list[str](), list[bool]()
    with ExitStack() as stack:
        viewer.start()
        stack.callback(viewer.stop)
        server = stack.enter_context(served(mosquitto))
        process = ("process", "control_alarms", "--config", str(tmp_path / "processors.toml"))
        stack.enter_context(started(tmp_path, "processors", *process, *broker))
        stack.enter_context(started(tmp_path, "edge", "edge", "run", str(tmp_path / "edge.toml"), *broker))

        def came_and_went() -> bool:
            for event in viewer.poll(0.05):
                counted.extend(one.value for one in event.readings if one.name == "twin/control_alarm" and one.value is not None)
            shown.extend(str(one["alarm"]) for one in get(f"{server.url}/machines").json())
            return text in shown and True in counted and False in counted[counted.index(True) :]

        until(came_and_went, "the alarm to come and to go", 120.0)
