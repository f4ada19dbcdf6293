"""The simulated control behind its OPC UA server in a process of its own, which tests drive, kill, stop and start again.

As a program it reads one command a line and answers each with one line, both JSON. The machine's time goes on only when it is
told to, so that an hour of it takes as long as its values need, and is the same each time.
"""

import json
import os
import signal
import subprocess
import sys
import time
from pathlib import Path
from types import TracebackType
from typing import Any

from tests.wire.mosquitto import free_port

ROOT = Path(__file__).parents[4]
LOOK_S = 0.05  # machine time from look to look
SWITCHED_ON_S = 1_790_000_000.0
IN_FLIGHT_S = 0.15


class ControlProcess:
    """One control: its time, and the process that shows it while there is one."""

    def __init__(self, folder: Path, *, seconds: float) -> None:
        self._folder, self._seconds = folder, seconds
        self.port = free_port()
        self.url = f"opc.tcp://127.0.0.1:{self.port}"
        self.machine_s = 0.0
        self.fingerprint = ""
        self._process: subprocess.Popen[str] | None = None

    def __enter__(self) -> "ControlProcess":
        self.start()
        return self

    def __exit__(self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None) -> None:
        self.kill()

    def start(self, *missing: str) -> None:
        """Begin to show the control as it is now; without the variables of these names."""
        command = [sys.executable, "-m", "tests.edge.controls.opcua.control_process"]
        given = [str(self._folder), str(self.port), str(self._seconds), str(self.machine_s), *missing]
        self._process = subprocess.Popen(
            [*command, *given], cwd=ROOT, text=True, stdin=subprocess.PIPE, stdout=subprocess.PIPE, stderr=subprocess.DEVNULL
        )
        self.fingerprint = self._answer()["fingerprint"]

    def kill(self) -> None:
        """End the process with no word of farewell; what it had sent has arrived when this returns."""
        if self._process is not None:
            self._process.kill()
            self._process.communicate()
            self._process = None
            time.sleep(IN_FLIGHT_S)

    def hang(self) -> None:
        """Stop the process where it stands: its socket stays open, and nobody answers."""
        assert self._process is not None
        os.kill(self._process.pid, signal.SIGSTOP)
        time.sleep(IN_FLIGHT_S)

    def go_on(self) -> None:
        """End a hang."""
        assert self._process is not None
        os.kill(self._process.pid, signal.SIGCONT)

    def advance(self, seconds: float, *, seen: bool = True) -> None:
        """Let the machine work; `seen`: the server looks all the while, else only at the end. Without a process nobody looks."""
        goal_s = self.machine_s + seconds
        if self._process is not None:
            self.ask("advance" if seen else "jump", to_s=goal_s)
        self.machine_s = goal_s  # not before: the edge's clock is this one, and must not be ahead of what was shown

    def age(self, seconds: float) -> None:
        """The machine works on while its server hangs."""
        self.machine_s += seconds

    def ask(self, what: str, **more: Any) -> Any:
        """One command; its answer when it is done."""
        assert self._process is not None
        assert self._process.stdin is not None
        self._process.stdin.write(json.dumps({"do": what, **more}) + "\n")
        self._process.stdin.flush()
        return self._answer()

    def _answer(self) -> Any:
        assert self._process is not None
        assert self._process.stdout is not None
        line = self._process.stdout.readline()
        assert line, "the control's process has ended"
        return json.loads(line)


def serve(folder: Path, port: int, seconds: float, machine_s: float, missing: list[str]) -> None:
    """The program."""
    from cnctwin.standins.opcua_server.server import OpcUaServer
    from cnctwin.standins.simulated_control.control import SimulatedControl
    from cnctwin.standins.simulated_control.state import production

    now_s = machine_s
    control = SimulatedControl(production(seconds), machine_s=lambda: now_s, switched_on_s=SWITCHED_ON_S)
    with OpcUaServer(control, folder, port=port, missing=missing, stepped=True) as server:
        print(json.dumps({"fingerprint": server.fingerprint}), flush=True)
        for line in sys.stdin:
            told = json.loads(line)
            match told.pop("do"):
                case "advance":
                    goal_s = told["to_s"]

                    def step(goal_s: float = goal_s) -> bool:
                        nonlocal now_s
                        if now_s >= goal_s:
                            return False
                        now_s = min(goal_s, now_s + LOOK_S)
                        return True

                    server.at_once(step)
                case "jump":
                    now_s = told["to_s"]
                    server.look()
                case "slow":
                    server.slow_s = told["slow_s"]
                case "status":
                    server.set_status(told["name"], told["status"])
                case "value":
                    server.set_value(told["name"], told["value"], overflow=told.get("overflow", False))
                case "state":
                    server.set_state(told["state"])
                case "clear":
                    server.clear()
            print(json.dumps({"writes": server.writes, "calls": server.calls}), flush=True)


if __name__ == "__main__":
    serve(Path(sys.argv[1]), int(sys.argv[2]), float(sys.argv[3]), float(sys.argv[4]), sys.argv[5:])
