"""The simulated machine behind an MTConnect agent: the working day, told at its pace, and the thread that computes ahead."""

import threading
import time
from collections.abc import Callable, Iterator

from cnctwin.standins.mtconnect_agent.agent import Agent
from cnctwin.standins.mtconnect_agent.device_model import read_device_model
from cnctwin.standins.mtconnect_agent.dialect import dialect
from cnctwin.standins.mtconnect_agent.ledger import ReplayLedger
from cnctwin.standins.mtconnect_agent.replay_agent import ASSETS_MAX, BUFFER_SIZE, CLIENTS_MAX
from cnctwin.standins.mtconnect_agent.server import AgentServer
from cnctwin.standins.mtconnect_agent.shdr import parse_line
from cnctwin.standins.simulated_machine.as_built import machine_as_built
from cnctwin.standins.simulated_machine.description import DEVICES, check
from cnctwin.standins.simulated_machine.moment import Adapter, Moment
from cnctwin.standins.simulated_machine.part import Part, spare_part
from cnctwin.standins.simulated_machine.working_day import Begin, Pending, working_day
from twin.machine import MachineFile

PATIENCE_S = 10.0
"""Seconds of our time for the first part; the imports and kernels that are compiled already take a few seconds."""
WAITING_SAID_S = 5.0
COMPUTING_S_MAX = 1.5
"""Seconds that a stop waits for a part that is being computed; one whose kernels are being compiled takes longer."""
COMPILING = "the simulation is being compiled, once on a computer, for about a minute; this part was computed before"
WAITING = "the machine waits for its next part, which is still being computed"


class Computation:
    """A part that a thread is computing. The simulation lets other threads go on, since its kernels release the interpreter."""

    def __init__(self, number: int, machine: MachineFile) -> None:
        self._told = number, machine
        self._part: Part | None = None
        self._error: BaseException | None = None
        self._thread = threading.Thread(target=self._run, name=f"part-{number}", daemon=True)
        self._thread.start()

    @property
    def ready(self) -> bool:
        """True if it is done, or has failed."""
        return not self._thread.is_alive()

    def result(self) -> Part:
        """The part; waits for it, and raises what it raised."""
        self._thread.join()
        if self._error is not None:
            raise self._error
        assert self._part is not None
        return self._part

    def _run(self) -> None:
        try:
            from cnctwin.standins.simulated_machine.machining import machined  # noqa: PLC0415 — seconds of imports, while the agent answers

            self._part = machined(*self._told)
        except BaseException as error:
            self._error = error


class SimulatedMachine:
    """Serves the simulated machine on loopback.

    speed: 1 = real time; at 20 the machine's clock, which stamps what it tells, goes twenty times as fast as ours
    machine: as it is; patience_s: after which a spare part is shown in place of the first one, seconds of our time
    begin: computes a part; now: seconds since 1970
    """

    def __init__(
        self,
        *,
        speed: float = 1.0,
        port: int = 0,
        machine: MachineFile | None = None,
        patience_s: float = PATIENCE_S,
        begin: Begin | None = None,
        now: Callable[[], float] = time.time,
    ) -> None:
        check(speed)
        spoken = dialect("2.3")
        model = read_device_model(DEVICES.read_text(encoding="utf-8"), spoken.schema)
        self.agent = Agent(model, model.devices[0], spoken, buffer_size=BUFFER_SIZE, assets_max=ASSETS_MAX, now=now)
        self.parts = 0
        self.error: BaseException | None = None
        built = machine or machine_as_built()
        self._speed, self._now, self._machine = speed, now, built
        self._patience_s = patience_s * speed
        self._begin: Begin = begin or (lambda number: Computation(number, built))
        self._waiting_since_s: float | None = None
        self._pending: Pending | None = None
        self._shows_spare = False
        self._stop = threading.Event()
        self._server = AgentServer(self.agent, port=port, clients_max=CLIENTS_MAX)
        self._thread = threading.Thread(target=self._run, name="simulated-machine", daemon=True)

    def __enter__(self) -> "SimulatedMachine":
        self.start()
        return self

    def __exit__(self, *exception: object) -> None:
        self.stop()

    def start(self) -> None:
        """Serve, and switch the machine on."""
        self._server.start()
        self._thread.start()

    def stop(self, timeout_s: float = 5.0) -> bool:
        """Stop the machine and close every connection; False where a part is still being computed, which nothing can end."""
        self._stop.set()
        if self._thread.is_alive():
            self._thread.join(timeout_s)
        self.agent.close()
        self._server.stop(timeout_s)
        until_s = time.monotonic() + COMPUTING_S_MAX
        while not self._is_idle and time.monotonic() < until_s:
            time.sleep(0.02)
        return self._is_idle

    @property
    def url(self) -> str:
        """`http://127.0.0.1:<port>`."""
        return self._server.url

    @property
    def device_name(self) -> str:
        """The device that it serves."""
        return self.agent.device.name

    @property
    def ledger(self) -> ReplayLedger:
        """A snapshot of what became of each entry that the machine told."""
        with self.agent.changed:
            return self.agent.ledger.copy()

    @property
    def notice(self) -> str:
        """The notice for somebody who looks: why the machine stands still, or shows a part that was computed before."""
        if self._shows_spare:
            return COMPILING
        since_s = self._waiting_since_s
        return "" if since_s is None or time.monotonic() - since_s < WAITING_SAID_S else WAITING

    def _run(self) -> None:
        try:
            self._tell(working_day(self._begin_next, self._spare, self._patience_s, self._machine))
        except BaseException as error:  # the thread that serves goes on; whoever runs us sees it here
            self.error = error

    def _spare(self) -> Part:
        self._shows_spare = True
        return spare_part()

    @property
    def _is_idle(self) -> bool:
        return self._pending is None or self._pending.ready

    def _begin_next(self, number: int) -> Pending:
        self._pending = self._begin(number)
        return self._pending

    def _tell(self, moments: Iterator[Moment]) -> None:
        """Keep to a schedule from the start on, so that waits that come out too long don't add up."""
        adapter = Adapter(self._now())
        switched_on_s = time.monotonic()
        for moment in moments:
            wait_s = switched_on_s + moment.at_s / self._speed - time.monotonic()
            if self._stop.wait(max(wait_s, 0.0)):
                return
            if not moment.waits:
                self._waiting_since_s = None
            elif self._waiting_since_s is None:
                self._waiting_since_s = time.monotonic()
            if (line := adapter.line(moment)) is not None:
                self.agent.receive(parse_line(line))
            if int(moment.values.get("part_count", 0)) > self.parts:
                self.parts, self._shows_spare = self.parts + 1, False
