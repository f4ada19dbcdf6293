"""One control behind one server for all tests of this folder: to make the standard's address space costs seconds."""

from collections.abc import Iterator
from dataclasses import dataclass, field
from pathlib import Path

import pytest

from cnctwin.standins.simulated_control.control import SimulatedControl
from cnctwin.standins.simulated_control.state import ControlState
from edge.config import EdgeConfig
from edge.controls.opcua.config import Config, OpcUaConfig

NOW_S = 1_790_000_000.0


@dataclass
class Bench:
    """A server, the control behind it as tests set it, and configurations that reach it."""

    folder: Path
    state: list[ControlState] = field(
        default_factory=lambda: [ControlState(tool_number=3, exec_state="ACTIVE", program="O1", line=5)]
    )
    machine_s: float = 0.0

    def __post_init__(self) -> None:
        from cnctwin.standins.opcua_server.server import OpcUaServer
        from edge.controls.opcua.certificates import own_identity

        self.user = own_identity(self.folder / "user", name="user")
        self.server = OpcUaServer(
            _Set(self),
            self.folder / "server",
            open_too=True,
            users={"edge": "open sesame"},
            user_certificates=[self.user.certificate.read_bytes()],
            stepped=True,
        )
        self.server.start()

    def show(self, state: ControlState, after_s: float = 1.0) -> None:
        """The control shows this, so much later."""
        self.machine_s += after_s
        self.state[0] = state
        self.server.look()

    def config(self, **source: object) -> Config:
        """A configuration that trusts the server."""
        given = {
            "url": self.server.url,
            "server_fingerprint": self.server.fingerprint,
            "certificate_folder": str(self.folder / "edge"),
        }
        more = {"publishing_ms": 20, "sampling_ms": 20, "timeout_s": 20.0}
        return EdgeConfig(source=OpcUaConfig.model_validate(given | more | source))


class _Set(SimulatedControl):
    """A control that shows what it is told to."""

    def __init__(self, bench: Bench) -> None:
        super().__init__([], machine_s=lambda: bench.machine_s, switched_on_s=NOW_S)
        self._bench = bench

    def now(self) -> ControlState:
        return self._bench.state[0]


@pytest.fixture(scope="session")
def running_bench(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Bench]:
    """The server."""
    pytest.importorskip("asyncua")
    bench = Bench(tmp_path_factory.mktemp("opcua"))
    yield bench
    bench.server.stop()


@pytest.fixture
def bench(running_bench: Bench) -> Iterator[Bench]:
    """The server as new; nobody may have written to it, or called a method."""
    running_bench.show(ControlState(tool_number=3, exec_state="ACTIVE", program="O1", line=5))
    yield running_bench
    running_bench.server.clear()
    running_bench.server.set_state("Running")
    assert (running_bench.server.writes, running_bench.server.calls) == (0, 0)
