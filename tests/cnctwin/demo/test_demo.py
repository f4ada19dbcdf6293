"""The demo, as real processes: what it sums up is right, what is killed comes back, and nothing of it stays behind."""

import json
import os
import signal
import socket
from collections.abc import Callable, Iterator
from dataclasses import replace
from pathlib import Path
from threading import Event
from typing import Any

import pytest

from cnctwin.demo import demo as demo_module
from cnctwin.demo.demo import Summary, ToolChanges, greeting, run
from cnctwin.demo.parts import PROCESSORS, Demo, DemoOptions, machine_name
from cnctwin.errors import UsageError
from cnctwin.plant.view import StageLedger, ledgers
from cnctwin.processes.private_broker import answers
from cnctwin.standins.simulated_machine.description import DEVICES, SPARE_PART
from cnctwin.standins.simulated_machine.hidden_effect import hidden_effects
from sparkplug.broker import BrokerAddress
from sparkplug.host import EventKind, HostApplication, HostEvent
from sparkplug.metric import NodeId, Reading
from sparkplug.quality import Quality
from tests.cnctwin.program import Program, children, is_alive, until
from tests.wire.mosquitto import free_port

pytestmark = [pytest.mark.broker, pytest.mark.usefixtures("mosquitto_program")]
OWN = ["--recording", str(SPARE_PART), "--devices", str(DEVICES)]
LINES_OF_OUR_RECORDING = len(SPARE_PART.read_text(encoding="utf-8").splitlines())
SECONDS = 25.0  # enough for it at fifteen times its pace, with time to start; the other tests go on meanwhile
STAGES = ["edge-vmc", *sorted(f"twin-{name}" for name in PROCESSORS)]
START_S_MAX = 150.0  # with the kernels of the scores to compile, on a computer that has other things to do
WITH_A_GIVEN_PORT = {"agent", "page"}
"""Their ports are the system's choice, which gives one to somebody else too while they are dead; then they are started again."""
PARTS = ["edge", "historian", "jobs", "mosquitto", "process", "serve", "simulate-control", "twin"]


@pytest.fixture(scope="module", autouse=True)
def playing(tmp_path_factory: pytest.TempPathFactory, mosquitto_program: str) -> Iterator[tuple[Program, int]]:
    """Our own recording, played to its end while the other tests go on."""
    port = free_port()
    arguments = ["demo", *OWN, "--speed", "15", "--seconds", f"{SECONDS}", "--port", str(port), "--json", "--no-open"]
    with Program(tmp_path_factory.mktemp("whole"), *arguments) as program:
        yield program, port


@pytest.fixture(scope="module")
def whole(playing: tuple[Program, int]) -> dict[str, Any]:
    """Its summary; the exit code is that of a ledger that balances."""
    program, _ = playing
    assert program.wait() == 0, program.err
    assert len(program.out.splitlines()) == 1, "stdout holds the summary and nothing else"
    summary: dict[str, Any] = json.loads(program.out)
    return summary


def ledgers_of(port: int, enough: Callable[[list[StageLedger]], bool], what: str) -> list[StageLedger]:
    """Look at the plant from outside until it is so."""
    host = HostApplication(BrokerAddress(port=port), f"look-{port}", publish_state=False, rebirth_interval_ms_min=500)
    host.start()

    def look() -> bool:
        host.poll(0.1)
        return enough(ledgers(host))

    try:
        until(look, what, START_S_MAX)
        return ledgers(host)
    finally:
        host.stop()


def everything_flows(seen: list[StageLedger]) -> bool:
    return [ledger.node for ledger in seen] == STAGES and all(ledger.online and ledger.received > 20 for ledger in seen)


def test_whatever_is_killed_comes_back_and_ctrl_c_ends_it_with_a_ledger_that_balances(tmp_path: Path) -> None:
    port = free_port()
    with Program(tmp_path, "demo", "--speed", "15", "--port", str(port), "--json") as program:
        ledgers_of(port, everything_flows, "all stages to publish a ledger")
        before = children(program.process.pid)
        assert sorted(before) == PARTS
        for part in PARTS:
            os.kill(before[part], signal.SIGKILL)

        def all_back() -> bool:
            now = children(program.process.pid)
            return sorted(now) == PARTS and all(now[part] != before[part] for part in PARTS)

        until(all_back, "every part to be started again")
        ledgers_of(port, everything_flows, "data to flow through every stage again")
        last = children(program.process.pid)
        assert program.ask_to_end(signal.SIGINT) == 0, program.err
        summary = json.loads(program.out)
    assert summary["balances"] is True
    assert summary["loop"]["effect"] in {hidden.effect for hidden in hidden_effects()}
    assert summary["restarts"].keys() == {"mosquitto", *WITH_A_GIVEN_PORT, "historian", "processors", "edge", "jobs", "loop"}
    assert {part for part, count in summary["restarts"].items() if count > 1} <= WITH_A_GIVEN_PORT
    assert [pid for pid in last.values() if is_alive(pid)] == []
    assert not answers("127.0.0.1", port)
    assert sorted(path.name for path in tmp_path.iterdir()) == ["err", "out"], "the temporary folder is removed"


def test_a_demo_that_is_killed_leaves_nothing_running(tmp_path: Path) -> None:
    port = free_port()
    with Program(tmp_path, "demo", "--port", str(port)) as program:
        until(lambda: sorted(children(program.process.pid)) == PARTS, "every part to be started", START_S_MAX)
        parts = children(program.process.pid)
        program.process.kill()
        program.wait()
        until(lambda: not any(is_alive(pid) for pid in parts.values()), "every part to end")
    assert not answers("127.0.0.1", port)


def test_a_port_that_is_taken_is_one_line_and_exit_code_2(tmp_path: Path) -> None:
    with socket.create_server(("127.0.0.1", 0)) as taken:
        port = taken.getsockname()[1]
        with Program(tmp_path, "demo", "--port", str(port)) as program:
            assert program.wait() == 2
    assert program.err == f"cnctwin: port {port} of 127.0.0.1 is in use; name another one with --port\n"
    assert program.out == ""


def stage(node: str, received: int = 10, emitted: int = 10) -> StageLedger:
    return StageLedger(node, True, received, emitted, 0, 0, {})


SUMMARY = Summary("vmc", 5, "5", 8.0, True, None, {}, tuple(stage(node) for node in STAGES))
NO_GOOD = {
    "a ledger that does not balance": (stage(STAGES[0], emitted=9), *SUMMARY.ledgers[1:]),
    "a stage without a ledger": SUMMARY.ledgers[1:],
    "a stage that saw nothing": (stage(STAGES[0], 0, 0), *SUMMARY.ledgers[1:]),
    "no stage at all": (),
}


@pytest.mark.parametrize("case", NO_GOOD)
def test_a_summary_balances_only_when_every_stage_is_there_and_accounts_for_all(case: str) -> None:
    assert SUMMARY.balances
    assert not replace(SUMMARY, ledgers=NO_GOOD[case]).balances


def test_the_exit_code_is_1_when_a_stage_is_missing(monkeypatch: pytest.MonkeyPatch, capfd: pytest.CaptureFixture[str]) -> None:
    monkeypatch.setattr(demo_module, "PROCESSORS", ("mirror",))
    monkeypatch.setattr(demo_module, "SETTLE_S_MAX", 0.0)
    stop = Event()
    stop.set()
    assert run(DemoOptions(port=free_port()), stop) == 1
    assert "does not balance, or a stage published none" in capfd.readouterr().out


@pytest.mark.parametrize(("port", "option"), [(1883, ""), (18830, " -p 18830")])
def test_the_usual_port_need_not_be_named(tmp_path: Path, port: int, option: str, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("cnctwin.processes.private_broker.is_free", lambda _port: True)
    said = greeting(Demo(DemoOptions(port=port), tmp_path))
    assert f"mosquitto_sub{option} -t 'cnc/#' -v" in said
    assert f"mqtt://127.0.0.1:{port}" in said


def test_a_tool_change_is_counted_when_it_begins() -> None:
    def event(device: str, value: object, kind: EventKind = EventKind.DATA) -> HostEvent:
        reading = Reading("tool_change_active", value, 0, Quality.GOOD, None, None, False)  # type: ignore[arg-type]
        return HostEvent(kind, NodeId("cnc", "edge"), device, 0, (reading,))

    changes = ToolChanges("vmc")
    changes.see([event("vmc", False, EventKind.BIRTH), event("vmc", True), event("vmc", True)])
    changes.see([event("vmc", None), event("vmc", True, EventKind.BIRTH), event("lathe", False), event("vmc", False)])
    assert changes.count == 1
    changes.see([event("lathe", True), event("vmc", True, EventKind.DEATH), event("vmc", True)])
    assert changes.count == 2


MODELS = {
    '<MTConnectDevices xmlns="urn:mtconnect.org:MTConnectDevices:1.7"><Device name="VMC-3" id="d"/></MTConnectDevices>': "vmc-3",
    '<Device uuid="000.ABC" id="d"/>': "000.abc",
    '<Device id="d"/>': "machine",
}


@pytest.mark.parametrize("model", MODELS)
def test_the_machine_is_named_after_its_device(tmp_path: Path, model: str) -> None:
    file = tmp_path / "devices.xml"
    file.write_text(model)
    assert machine_name(file) == MODELS[model]


def test_without_a_device_there_is_no_name_to_take(tmp_path: Path) -> None:
    assert machine_name(None) == "machine"
    (tmp_path / "devices.xml").write_text("<Devices/>")
    with pytest.raises(UsageError, match="holds no Device"):
        machine_name(tmp_path / "devices.xml")


def test_the_summary_accounts_for_everything(whole: dict[str, Any]) -> None:
    assert whole["balances"] is True
    assert [stage["node"] for stage in whole["ledgers"]] == STAGES
    for stage in whole["ledgers"]:
        assert stage["received"] == stage["emitted"] + stage["dropped"] + stage["buffered"] > 0
        assert stage["dropped"] == sum(stage["reasons"].values())
        assert stage["balances"] is True
        assert stage["buffered"] == 0
    assert whole["ledgers"][0]["received"] == whole["agent"]["observations"], "the edge took each observation once"


def test_a_recording_hides_nothing(whole: dict[str, Any]) -> None:
    assert whole["loop"] is None


def test_the_summary_tells_what_the_machine_did(whole: dict[str, Any]) -> None:
    assert whole["machine"] == "vmc"
    assert whole["recording_ended"] is True
    assert whole["agent"]["lines"] == LINES_OF_OUR_RECORDING
    assert (whole["tool_changes"], whole["last_tool"]) == (5, "5")
    assert whole["restarts"] == {}
    assert SECONDS <= whole["seconds"] < SECONDS + demo_module.SETTLE_S_MAX + 60.0  # and it takes time to end


@pytest.mark.usefixtures("whole")
def test_the_greeting_names_the_port_and_how_to_read(playing: tuple[Program, int]) -> None:
    program, port = playing
    assert f"mqtt://127.0.0.1:{port}" in program.err
    assert f"mosquitto_sub -p {port} -t 'cnc/#' -v" in program.err
