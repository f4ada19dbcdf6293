"""One gateway with real machines behind real agents: one hangs, one floods, one sends nonsense, and the others go on."""

import socket
import subprocess
import sys
import threading
import time
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager
from pathlib import Path

import pytest

from cnctwin.standins.mtconnect_agent.replay_agent import ReplayAgent
from cnctwin.standins.simulated_control.state import production_moments
from cnctwin.standins.simulated_machine.description import DEVICES
from cnctwin.standins.simulated_machine.moment import Adapter
from edge.controls.mtconnect.config import MtconnectConfig
from sparkplug.broker import BrokerAddress
from sparkplug.host import EventKind
from sparkplug.host_session import HostEvent
from tests.edge.host_watch import HostWatch, wait
from tests.wire.mosquitto import Mosquitto

pytestmark = pytest.mark.broker
PROJECT = Path(__file__).parents[3]


class Seen(HostWatch):
    """How many data messages came of each machine, and how old the newest is."""

    def __init__(self, address: BrokerAddress) -> None:
        super().__init__(address, "onlooker", rebirth_interval_ms_min=200)
        self.messages: dict[str, int] = {}
        self.deaths: list[str] = []
        self.heard_s: dict[str, float] = {}

    def take(self, event: HostEvent) -> None:
        if event.device is None:
            return
        if event.kind is EventKind.DATA:
            self.messages[event.device] = self.messages.get(event.device, 0) + 1
            self.heard_s[event.device] = time.monotonic()
        elif event.kind is EventKind.DEATH:
            self.deaths.append(event.device)


class Silence:
    """A control that accepts and never answers, or that answers with nonsense without end."""

    def __init__(self, nonsense: bytes = b"") -> None:
        self._server = socket.create_server(("127.0.0.1", 0))
        self.url = f"http://127.0.0.1:{self._server.getsockname()[1]}"
        self._nonsense, self._open = nonsense, True
        self._clients: list[socket.socket] = []
        self._thread = threading.Thread(target=self._serve, daemon=True)

    def __enter__(self) -> "Silence":
        self._thread.start()
        return self

    def __exit__(self, *_: object) -> None:
        self._open = False
        self._server.shutdown(socket.SHUT_RDWR)
        self._server.close()
        self._thread.join(5)
        for client in self._clients:
            client.close()

    def _serve(self) -> None:
        while self._open:
            try:
                client, _ = self._server.accept()
                client.settimeout(0.5)
                self._clients.append(client)
                for _ in range(2_000 if self._nonsense else 0):
                    client.sendall(self._nonsense)
            except OSError:
                continue


@pytest.fixture(scope="module")
def recorded(tmp_path_factory: pytest.TempPathFactory) -> Path:
    file = tmp_path_factory.mktemp("recorded") / "vmc.txt"
    adapter = Adapter(1_772_438_400.0)
    lines = (adapter.line(moment) for moment in production_moments(200.0))
    file.write_text("\n".join(line for line in lines if line is not None) + "\n", encoding="utf-8")
    return file


def write(folder: Path, name: str, url: str, broker: str, more: str = "") -> Path:
    file = folder / f"{name}.toml"
    file.write_text(
        f'[machine]\nname = "{name}"\n{more}[broker]\nurl = "{broker}"\nsession_file = "{folder}/state/{name}"\n'
        f'[store]\nfree_bytes_min = 0\n[mtconnect]\nurl = "{url}"\ninterval_ms = 20\ntimeout_s = 1\nheartbeat_ms = 300\n'
    )
    return file


@contextmanager
def gateway(folder: Path) -> Iterator[subprocess.Popen[str]]:
    command = [sys.executable, "-m", "cnctwin", "edge", "run", str(folder)]
    process = subprocess.Popen(command, cwd=PROJECT, stderr=subprocess.PIPE, text=True)
    assert process.stderr is not None
    try:
        yield process
    finally:
        process.terminate()
        process.communicate(timeout=60)


def test_one_machine_that_hangs_floods_or_talks_nonsense_does_not_touch_the_others(
    recorded: Path, mosquitto: Mosquitto, tmp_path: Path
) -> None:
    broker = f"mqtt://127.0.0.1:{mosquitto.port}"
    with ExitStack() as stack:
        agents = {
            name: stack.enter_context(ReplayAgent(recorded, DEVICES, speed=speed, loop=True))
            for name, speed in (("good1", 10.0), ("good2", 10.0), ("flood", 3_000.0))
        }
        hangs, talks = stack.enter_context(Silence()), stack.enter_context(Silence(b"HTTP/1.1 200 OK\r\n\r\n" + b"<" * 4_000))
        for name, url in [*((name, agent.url) for name, agent in agents.items()), ("hangs", hangs.url), ("talks", talks.url)]:
            write(tmp_path, name, url, broker)
        seen = stack.enter_context(Seen(BrokerAddress(*mosquitto.address)))
        process = stack.enter_context(gateway(tmp_path))
        wait(lambda: {"good1", "good2", "flood"} <= seen.messages.keys(), "the births of the machines that are well")
        before = dict(seen.messages)
        slowest_s = 0.0

        def have_told() -> bool:
            nonlocal slowest_s
            slowest_s = max(slowest_s, *(time.monotonic() - seen.heard_s[name] for name in ("good1", "good2")))
            return all(seen.messages[name] - before[name] > 40 for name in ("good1", "good2"))

        wait(have_told, "forty messages of each")
        assert slowest_s < MtconnectConfig(url="http://x").timeout_s, (
            "a machine that is well is never silent for as long as one that hangs is waited for"
        )
        assert {"hangs", "talks"}.isdisjoint(seen.messages)

        write(tmp_path, "good2", agents["good2"].url, broker, more="lost_after_s = 20\n")
        wait(lambda: "good2" in seen.deaths, "the end of the edge whose file has changed")
        changed = seen.messages["good2"]
        wait(lambda: seen.messages["good2"] > changed + 5, "its beginning again")
        (tmp_path / "flood.toml").unlink()
        wait(lambda: "flood" in seen.deaths, "the end of the edge whose file is gone")
        (tmp_path / "good1.toml").write_text("[machine\n")
        told = seen.messages["good1"]
        wait(lambda: seen.messages["good1"] > told + 20, "the edge whose file was broken to go on as it was")
        assert "good1" not in seen.deaths
        process.terminate()
        assert process.wait(60) == 0
