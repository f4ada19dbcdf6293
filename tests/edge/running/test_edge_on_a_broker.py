"""The whole edge: a recorded Okuma behind a real HTTP agent, a real Mosquitto, and a host that reads what comes out."""

import subprocess
import sys
import threading
import time
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path

import pytest

from cnctwin.standins.mtconnect_agent.replay_agent import ReplayAgent
from edge.config import BrokerSection, EdgeConfig, MachineSection
from edge.controls.mtconnect.check import describe
from edge.controls.mtconnect.config import MtconnectConfig
from edge.running.ledger import Ledger
from edge.running.run import edge_runtime
from edge.running.runtime import EdgeRuntime
from sparkplug.broker import BrokerAddress
from sparkplug.host import EventKind
from sparkplug.host_session import HostEvent
from sparkplug.metric import Reading
from tests.edge.host_watch import HostWatch, wait
from tests.recordings import PROJECT, recording
from tests.wire.mosquitto import Mosquitto, free_port

pytestmark = pytest.mark.broker


class Onlooker(HostWatch):
    """What a host application has seen of one machine and its edge."""

    def __init__(self, address: BrokerAddress) -> None:
        super().__init__(address, "onlooker", rebirth_interval_ms_min=200)
        self.machine: dict[str, Reading] = {}
        self.node: dict[str, Reading] = {}
        self.changes: list[object] = []
        self.tools: list[object] = []
        self.births = 0
        self.holes = 0
        self.history = 0

    def take(self, event: HostEvent) -> None:
        self.births += event.kind is EventKind.BIRTH and event.device is not None
        self.holes += event.kind is EventKind.HOLE
        picture = self.node if event.device is None else self.machine
        for reading in event.readings:
            if reading.is_historical:
                self.history += 1
                continue
            picture[reading.name] = reading
            if event.kind is EventKind.DATA and event.device is not None:
                self._note(reading)

    def _note(self, reading: Reading) -> None:
        if reading.name == "tool_change_active" and (not self.changes or self.changes[-1] != reading.value):
            self.changes.append(reading.value)
        if reading.name == "tool_number" and (not self.tools or self.tools[-1] != reading.value):
            self.tools.append(reading.value)

    def count(self, name: str) -> int:
        return int(str(self.node[name].value)) if name in self.node else -1


def config_for(agent: ReplayAgent, mosquitto: Mosquitto, session: Path) -> EdgeConfig[MtconnectConfig]:
    host, port = mosquitto.address
    return EdgeConfig(
        source=MtconnectConfig(url=agent.url, device="OKUMA", interval_ms=20, heartbeat_ms=300),
        machine=MachineSection(name="okuma"),
        broker=BrokerSection(url=f"mqtt://{host}:{port}", session_file=str(session)),
    )


@contextmanager
def running(config: EdgeConfig[MtconnectConfig]) -> Iterator[EdgeRuntime]:
    runtime = edge_runtime(config)
    thread = threading.Thread(target=runtime.run)
    thread.start()
    try:
        yield runtime
    finally:
        runtime.stop.set()
        thread.join(60)
        assert not thread.is_alive()


def okuma() -> ReplayAgent:
    files = recording("mtconnect/okuma.txt"), recording("mtconnect/okuma_devices.xml")
    return ReplayAgent(*files, device="OKUMA", speed=0)


def play(agent: ReplayAgent, lines: int) -> None:
    """Play lines at about a thousand times the recorded pace."""
    for _ in range(lines // 50):
        agent.step(50)
        time.sleep(0.01)


def end_state_is_told(agent: ReplayAgent, config: EdgeConfig[MtconnectConfig], onlooker: Onlooker) -> bool:
    """Return whether the onlooker knows of every signal what the agent knows."""
    known = {row.signal: row.value for row in describe(config)}
    return all(name in onlooker.machine and onlooker.machine[name].value == value for name, value in known.items())


def test_a_whole_recording_comes_out_with_eleven_tool_changes_and_a_ledger_that_balances(
    mosquitto: Mosquitto, tmp_path: Path
) -> None:
    address = BrokerAddress(*mosquitto.address)
    with okuma() as agent, Onlooker(address) as onlooker:
        config = config_for(agent, mosquitto, tmp_path / "session")
        with running(config) as runtime:
            # What comes before the edge is born is in the births, not in the changes that are counted here.
            wait(lambda: onlooker.count("ledger/received") >= 0, "the birth of the edge")
            agent.step(2)
            wait(lambda: "tool_number" in onlooker.machine, "the birth of the machine")
            while not agent.finished:
                play(agent, 100)
            wait(lambda: end_state_is_told(agent, config, onlooker), "the end state")
            wait(lambda: onlooker.machine["tool_change_active"].value is False, "the last change to end")
            assert onlooker.machine["spindle_load_pct"].unit == "%"
        last = runtime.ledger.snapshot()
        wait(lambda: onlooker.count("ledger/received") == last["ledger/received"], "the last ledger")
        assert [change for change in onlooker.changes if change is not None][-23:] == [False, *[True, False] * 11]
        tools = [2206, 8003, 2207, 2201, 2202, 2208, 2205, 2204, 2206, 2208, 2201, 2202, 2208, 8003]
        assert [tool for tool in onlooker.tools if tool] == tools
        assert (Ledger.difference(last), last["ledger/buffered"], last["ledger/dropped/broker_offline"]) == (0, 0, 0)
        assert (onlooker.holes, onlooker.host.dropped, onlooker.births) == (0, 0, 1)
        assert onlooker.count("health/holes") == 0


def test_a_killed_broker_changes_nothing_in_the_end_state(mosquitto: Mosquitto, tmp_path: Path) -> None:
    address = BrokerAddress(*mosquitto.address)
    with okuma() as agent, Onlooker(address) as onlooker:
        config = config_for(agent, mosquitto, tmp_path / "session")
        with running(config) as runtime:
            agent.step(2)
            wait(lambda: "tool_number" in onlooker.machine, "the birth of the machine")
            play(agent, 1000)
            mosquitto.kill()
            play(agent, 2000)
            mosquitto.restart()
            wait(lambda: onlooker.births >= 2, "the birth after the restart")
            play(agent, 1000)
            wait(lambda: end_state_is_told(agent, config, onlooker), "the end state")
            wait(lambda: onlooker.count("health/store_rows") == 0, "the end of the history")
        last = runtime.ledger.snapshot()
        assert onlooker.history > 0, "what came while the broker was away follows"
        assert (last["ledger/dropped/broker_offline"], last["ledger/buffered"], Ledger.difference(last)) == (0, 0, 0)


def test_a_killed_edge_that_is_started_again_changes_nothing_in_the_end_state(mosquitto: Mosquitto, tmp_path: Path) -> None:
    address = BrokerAddress(*mosquitto.address)
    with okuma() as agent, Onlooker(address) as onlooker:
        config = config_for(agent, mosquitto, tmp_path / "session")
        file = tmp_path / "okuma.toml"
        file.write_text(
            f'[machine]\nname = "okuma"\n[broker]\nurl = "{config.broker.url}"\nsession_file = "{config.broker.session_file}"\n'
            f'[mtconnect]\nurl = "{agent.url}"\ndevice = "OKUMA"\ninterval_ms = 20\n',
            encoding="utf-8",
        )
        command = [sys.executable, "-m", "cnctwin", "edge", "run", str(file)]
        agent.step(2)
        first = subprocess.Popen(command, cwd=PROJECT)
        wait(lambda: "tool_number" in onlooker.machine, "the birth of the machine")
        play(agent, 1000)
        first.kill()
        first.wait(10)
        play(agent, 1000)
        second = subprocess.Popen(command, cwd=PROJECT)
        wait(lambda: onlooker.births >= 2, "the second birth")
        play(agent, 1000)
        wait(lambda: end_state_is_told(agent, config, onlooker), "the end state")
        second.terminate()
        assert second.wait(60) == 0, "SIGTERM is a clean end"
        wait(lambda: onlooker.count("health/ledger_difference") == 0, "a ledger that balances")
        assert replace(config).node == "edge-okuma"


def test_of_several_brokers_the_one_that_answers_is_taken(mosquitto: Mosquitto, tmp_path: Path) -> None:
    host, port = mosquitto.address
    with okuma() as agent, Onlooker(BrokerAddress(host, port)) as onlooker:
        section = BrokerSection(
            urls=(f"mqtt://{host}:{free_port()}", f"mqtt://{host}:{port}"), session_file=str(tmp_path / "session")
        )
        agent.step(2)
        with running(replace(config_for(agent, mosquitto, tmp_path / "unused"), broker=section)):
            wait(lambda: onlooker.births > 0, "the birth of the machine")
