"""A whole plant for tests: a real Mosquitto behind the recording proxy, and processes of ours that can be killed."""

import json
import os
import signal
import subprocess
import sys
import time
from collections.abc import Callable
from contextlib import ExitStack
from pathlib import Path
from types import TracebackType
from typing import Any

from cnctwin.plant.view import StageLedger, ledgers
from cnctwin.standins.mtconnect_agent.replay_agent import ReplayAgent
from cnctwin.standins.simulated_machine.description import DEVICES, SPARE_PART
from edge.config_file import load
from edge.controls.mtconnect.check import describe
from sparkplug.broker import BrokerAddress
from sparkplug.host import EventKind, HostApplication
from tests.wire.mosquitto import Mosquitto
from tests.wire.proxy import Proxy

PROCESSORS = ("thermal", "cutting_force", "mirror")
SETTINGS = "[thermal]\nambient_temp_c = 22.0\n\n[cutting_force]\ntool_diameter_mm = 12.0\n"


class Plant:
    """Start it, play lines, kill parts, read the end state."""

    def __init__(self, folder: Path) -> None:
        self._folder = folder
        self._stack = ExitStack()
        self._processes: dict[str, subprocess.Popen[bytes]] = {}
        self.mirror: dict[str, dict[str, Any]] = {}
        self.health: dict[str, int] = {}

    def __enter__(self) -> "Plant":
        # Saving at each change would slow this broker to ten messages a second.
        self.mosquitto = self._stack.enter_context(Mosquitto(persistent=True, extra=("autosave_on_changes false",)))
        self.proxy = self._stack.enter_context(Proxy(upstream=self.mosquitto.address))
        self.agent = ReplayAgent(SPARE_PART, DEVICES, speed=0)
        self.agent.start()
        self._stack.callback(self.agent.stop)
        self.viewer = HostApplication(BrokerAddress(*self.mosquitto.address), "trial", ("spBv1.0/cnc/#",), publish_state=False)
        self.viewer.subscribe_plain("cnc/#")
        self.viewer.start()
        self._stack.callback(self.viewer.stop)
        self._write_settings()
        try:
            self.start("processors")
            self.start("edge")
            self.agent.step(3)
            self.wait(lambda: len(self.ledgers()) == 1 + len(PROCESSORS), "every stage to publish a ledger")
            self.wait(lambda: "cnc/vmc/exec_state" in self.mirror, "the mirror to show the machine")
        except BaseException:
            self.__exit__(None, None, None)
            raise
        return self

    def __exit__(self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None) -> None:
        for name in list(self._processes):
            self.stop(name)
        self._stack.close()

    def play(self, lines: int, *, at_a_time: int = 6, pause_s: float = 0.03) -> None:
        """Let the machine work."""
        while lines > 0:
            played = self.agent.step(min(at_a_time, lines))
            lines -= played
            self.look(pause_s)
            if not played:
                return

    def look(self, seconds: float) -> None:
        """Take what comes from the broker."""
        until_s = time.monotonic() + seconds
        while (left_s := until_s - time.monotonic()) > 0:
            for event in self.viewer.poll(min(left_s, 0.05)):
                if event.kind is EventKind.PLAIN and event.payload:
                    self.mirror[event.topic] = json.loads(event.payload)

    def _unlike(self, ends: dict[str, object]) -> dict[str, tuple[object, object]]:
        """Return what the mirror shows otherwise."""
        shown = {topic: self.mirror.get(topic, {}).get("value") for topic in ends}
        return {topic: (shown[topic], value) for topic, value in ends.items() if shown[topic] != value}

    def wait(self, condition: Callable[[], bool], what: str, seconds: float = 120.0) -> None:
        """Look until something is the case."""
        until_s = time.monotonic() + seconds
        while not condition():
            assert time.monotonic() < until_s, f"waited {seconds:g} s for {what}; {self._logs()}"
            self.look(0.05)

    def settle(self) -> None:
        """Look until the mirror shows what the control ends with, and nothing moves any more."""
        ends = {f"cnc/vmc/{row.signal}": row.value for row in describe(load(self._folder / "edge.toml"))}
        until_s = time.monotonic() + 120.0
        while unlike := self._unlike(ends):
            assert time.monotonic() < until_s, f"shown and right: {unlike}; {self._logs()}"
            self.look(0.05)
        quiet_s, before = time.monotonic(), ()
        while time.monotonic() - quiet_s < 2.5:
            self.look(0.1)
            now = tuple((ledger.node, ledger.received) for ledger in self.ledgers())
            if now != before:
                quiet_s, before = time.monotonic(), now

    def ledgers(self) -> list[StageLedger]:
        """The ledger of each stage."""
        return ledgers(self.viewer)

    def start(self, name: str) -> None:
        """Start the edge or the processors."""
        host, port = self.proxy.address
        arguments = {
            "edge": ["edge", "run", str(self._folder / "edge.toml")],
            "processors": ["process", *PROCESSORS, "--config", str(self._folder / "processors.toml")],
        }[name]
        if name == "processors":
            arguments += ["--broker", f"mqtt://{host}:{port}", "--state-dir", str(self._folder)]
        with (self._folder / f"{name}.log").open("ab") as log:
            command = [sys.executable, "-m", "cnctwin", *arguments]
            self._processes[name] = subprocess.Popen(command, stdout=log, stderr=log, stdin=subprocess.DEVNULL)

    def kill(self, name: str) -> None:
        """kill -9."""
        if name == "mosquitto":
            self.proxy.refuse()  # as where no broker is: who got as far as a CONNECT would rightly use up a bdSeq
            self.mosquitto.kill()
            self.wait(lambda: not self.viewer.online, "the viewer to notice")
            return
        process = self._processes.pop(name)
        os.kill(process.pid, signal.SIGKILL)
        process.wait()

    def restart(self, name: str) -> None:
        """Start what was killed."""
        if name == "mosquitto":
            self.mosquitto.start()
            self.proxy.accept()
        else:
            self.start(name)

    def stop(self, name: str) -> None:
        """End a process in the ordinary way."""
        process = self._processes.pop(name)
        if process.poll() is not None:
            return
        process.terminate()
        try:
            process.wait(60)
        except subprocess.TimeoutExpired:
            process.kill()
            process.wait()
            raise

    def values(self) -> dict[str, Any]:
        """The end state as any MQTT client reads it: topic → (value, quality)."""
        return {topic: (shown["value"], shown["quality"]) for topic, shown in sorted(self.mirror.items())}

    def _write_settings(self) -> None:
        host, port = self.proxy.address
        (self._folder / "processors.toml").write_text(SETTINGS)
        (self._folder / "edge.toml").write_text(
            f'[machine]\nname = "vmc"\n[broker]\nurl = "mqtt://{host}:{port}"\n'
            f'session_file = "{self._folder / "edge-session.json"}"\n[mtconnect]\nurl = "{self.agent.url}"\n'
        )

    def _logs(self) -> str:
        return " | ".join(path.name + ": " + path.read_text(errors="replace")[-600:] for path in self._folder.glob("*.log"))
