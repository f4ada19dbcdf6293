"""The replay agent: a recording of a machine, served as a real MTConnect agent serves the machine."""

import threading
import time
from collections.abc import Callable
from pathlib import Path

from cnctwin.standins.mtconnect_agent.agent import Agent
from cnctwin.standins.mtconnect_agent.dialect import dialect
from cnctwin.standins.mtconnect_agent.ledger import ReplayLedger
from cnctwin.standins.mtconnect_agent.recording import Recording
from cnctwin.standins.mtconnect_agent.replay import PAUSE_S_MAX, Replay
from cnctwin.standins.mtconnect_agent.server import AgentServer

BUFFER_SIZE = 131_072
ASSETS_MAX = 1024
CLIENTS_MAX = 16


class ReplayAgent:
    """Serves a recorded SHDR or `time|key|value` file on loopback.

    recording: the file, played in file order with the recorded stamps.
    devices: its Devices.xml; without one, a simple device model is drafted from the keys in the file.
    speed: 1 = the recorded pace, inf = no pauses, 0 = only by `step()`.
    device: name, uuid or id of the device in `devices` that the keys belong to; by default the only one, or the one
        that the file name names (`Plate-Hurco04-01of20.txt`).
    style: "2.3" or "1.4", the generation of the agent; schema_version: another namespace version than the style's own.
    wait_for_client: begin when the first client asks for samples, so that it misses nothing.
    pause_s_max: longer pauses of the recording are cut to this.
    """

    def __init__(
        self,
        recording: Path,
        devices: Path | None = None,
        *,
        speed: float = 1.0,
        device: str | None = None,
        port: int = 0,
        buffer_size: int = BUFFER_SIZE,
        style: str = "2.3",
        schema_version: str | None = None,
        pause_s_max: float = PAUSE_S_MAX,
        loop: bool = False,
        wait_for_client: bool = False,
        assets_max: int = ASSETS_MAX,
        clients_max: int = CLIENTS_MAX,
        now: Callable[[], float] = time.time,
    ) -> None:
        source = Recording(recording)
        spoken = dialect(style, schema_version)
        model, chosen = source.device_model(devices, device, spoken.schema)
        self.agent = Agent(model, chosen, spoken, buffer_size=buffer_size, assets_max=assets_max, now=now)
        sampled = threading.Event()
        self._replay = Replay(
            source,
            self.agent.receive,
            speed=speed,
            pause_s_max=pause_s_max,
            loop=loop,
            on_loop=self._count_loop,
            begin=sampled if wait_for_client else None,
        )
        self._server = AgentServer(self.agent, port=port, clients_max=clients_max, sampled=sampled)

    def __enter__(self) -> "ReplayAgent":
        self.start()
        return self

    def __exit__(self, *exception: object) -> None:
        self.stop()

    def start(self) -> None:
        """Serve, and begin to play."""
        self._server.start()
        self._replay.start()

    def stop(self, timeout_s: float = 5.0) -> None:
        """Stop playing and close every connection."""
        self._replay.stop(timeout_s)
        self.agent.close()
        self._server.stop(timeout_s)

    @property
    def url(self) -> str:
        """`http://127.0.0.1:<port>`."""
        return self._server.url

    @property
    def device_name(self) -> str:
        """The device whose data is played."""
        return self.agent.device.name

    @property
    def finished(self) -> bool:
        """The recording is at its end; the agent goes on serving what it holds."""
        return self._replay.finished

    def wait_finished(self, timeout_s: float | None = None) -> bool:
        return self._replay.wait_finished(timeout_s)

    def step(self, lines: int = 1) -> int:
        """At speed 0: play the next lines now, return how many there were."""
        return self._replay.step(lines)

    @property
    def ledger(self) -> ReplayLedger:
        """A snapshot of what became of each entry of the recording."""
        with self.agent.changed:
            return self.agent.ledger.copy()

    @property
    def clients_turned_away(self) -> int:
        """Connections refused because `clients_max` were open."""
        return self._server.turned_away

    def adapter_lost(self) -> None:
        """Break the connection to the adapter: every item becomes UNAVAILABLE, lines are counted as adapter_lost."""
        self.agent.adapter_lost()

    def adapter_back(self) -> None:
        """Restore it: the adapter sends its present values again."""
        self.agent.adapter_back()

    def restart(self) -> None:
        """Restart the agent in place: a new instance id, sequence numbers from 1, streams disconnected."""
        self.agent.restart()

    def _count_loop(self) -> None:
        with self.agent.changed:
            self.agent.ledger.loops += 1
