"""Production watched by a real edge over a real connection, while its server is killed, hung, slow, wrong and partial.

The machine's time is driven in steps; after each step everything that was shown has arrived, or never will. What came out is kept
with what the machine really did, so that tests can compare them.
"""

import random
import threading
import time
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from pathlib import Path

from cnctwin.standins.simulated_control.state import ControlState, ToolChange, production, tool_changes
from edge.config import EdgeConfig
from edge.controls.opcua.config import Config, OpcUaConfig
from edge.controls.opcua.connection import OpcUaConnection
from edge.controls.opcua.cursor import parse, start
from edge.running.pipeline import Pipeline
from edge.sample import EdgeSample, Gap
from tests.edge.controls.opcua.control_process import SWITCHED_ON_S, ControlProcess

STEP_S = 4.0
WATCH_S = 0.06
ARRIVAL_S_MAX = 40.0


@dataclass
class Watched:
    """What the edge made of it; times in ms since 1970 of the control, which is the edge's clock here."""

    published: list[EdgeSample] = field(default_factory=list)
    taken: list[EdgeSample] = field(default_factory=list)
    gaps: list[Gap] = field(default_factory=list)
    received: int = 0
    emitted: int = 0
    dropped: int = 0
    held: int = 0
    unaccounted: int = 0
    clock_ms: int = 0


class Hour:
    """One run. Use as a context manager, then `drive`."""

    def __init__(self, folder: Path, *, seconds: float, seed: int) -> None:
        self.seconds, self._chance = seconds, random.Random(seed)
        self.control = ControlProcess(folder / "control", seconds=seconds)
        self.seen = Watched()
        self.faults: list[str] = []
        self._folder = folder
        self._settled_s = SWITCHED_ON_S
        self._lock = threading.Lock()

    def __enter__(self) -> "Hour":
        self.control.start()
        source = OpcUaConfig(
            url=self.control.url,
            server_fingerprint=self.control.fingerprint,
            certificate_folder=str(self._folder / "edge"),
            publishing_ms=20,
            timeout_s=1.5,
        )
        self.config: Config = EdgeConfig(source=source)
        self.connection = OpcUaConnection(self.config, wall_s=self._wall_s, watch_s=WATCH_S, keep_alive_s=0.2, backoff_s_max=0.3)
        self._reader = threading.Thread(target=self._read, name="hour-reader")
        self._reader.start()
        return self

    def __exit__(self, *_: object) -> None:
        self.connection.close()
        self._reader.join(timeout=10.0)
        self.control.kill()

    def _wall_s(self) -> float:
        return SWITCHED_ON_S + self.control.machine_s

    def _read(self) -> None:
        pipeline, cursor, seen = Pipeline(self.config), start(self.config), self.seen
        for raw in self.connection.frames():
            cursor, given = parse(self.config, cursor, raw)
            outcome = pipeline.take(given, self._settled_s)
            with self._lock:
                rows = [sample for row in outcome.rows for sample in row]
                seen.published += rows
                seen.taken += given.samples
                seen.gaps += given.gaps
                seen.received += given.received
                seen.unaccounted += 0 if given.accounted() else 1
                seen.emitted += sum(sample.observations for sample in rows)
                seen.dropped += sum(outcome.dropped.values())
                seen.held = pipeline.held
                if given.clock is not None:
                    seen.clock_ms = given.clock.control_ms

    def drive(self) -> None:
        """Let the machine work through its time, with one fault after the other at moments that the seed decides."""
        self._arrived()
        kinds: Iterator[Callable[[], None]] = iter(())
        due_s = self._chance.uniform(10.0, 45.0)
        while self.control.machine_s < self.seconds - STEP_S:
            if self.control.machine_s >= due_s:
                kind = next(kinds, None)
                if kind is None:
                    kinds = iter(self._chance.sample(self._kinds(), len(self._kinds())))
                    kind = next(kinds)
                self.faults.append(f"{self.control.machine_s:.0f} s: {kind.__name__.strip('_')}")
                kind()
                due_s = self.control.machine_s + self._chance.uniform(10.0, 45.0)
            self.step(STEP_S)

    def step(self, seconds: float) -> None:
        """So much machine time, and everything of it here."""
        self.control.advance(seconds)
        self._arrived()

    def _kinds(self) -> list[Callable[[], None]]:
        return [self._killed, self._hung, self._slow, self._wrong, self._partial]

    def _killed(self) -> None:
        self.control.kill()
        self.control.advance(self._chance.uniform(4.0, 30.0))
        self.control.start(*self._chance.choice([(), ("speedOvr[u1,1]",)]))
        self._arrived()

    def _hung(self) -> None:
        self.control.hang()
        self.control.age(self._chance.uniform(4.0, 30.0))
        time.sleep(self._chance.choice([0.9, 2.6]))  # the shorter one is over before the edge gives the session up
        self.control.go_on()
        self.control.advance(0.0, seen=False)
        self._arrived()

    def _slow(self) -> None:
        self.control.ask("slow", slow_s=0.05)
        for _ in range(3):
            self.step(STEP_S)
        self.control.ask("slow", slow_s=0.0)

    def _wrong(self) -> None:
        self.control.ask("value", name="/Channel/Spindle/driveLoad[u1,1]", value="a lot")
        self.step(STEP_S)
        self.control.ask("clear")

    def _partial(self) -> None:
        self.control.ask("status", name="/Channel/Spindle/actSpeed[u1,1]", status="BadSensorFailure")
        self.step(STEP_S)
        self.control.ask("clear")

    def _arrived(self) -> None:
        """Wait until the edge has read the server's clock at its present time, and a publish has passed since."""
        goal_ms, deadline_s = round(self._wall_s() * 1000), time.monotonic() + ARRIVAL_S_MAX
        while True:
            with self._lock:
                if self.seen.clock_ms >= goal_ms - 1:
                    break
            assert time.monotonic() < deadline_s, f"nothing arrived: {self.connection.last_error}"
            time.sleep(0.01)
        time.sleep(0.05)
        self._settled_s = self._wall_s()

    def truth(self) -> tuple[list[ControlState], list[ToolChange]]:
        """Return what the machine really showed, and changed."""
        states = list(production(self.seconds))
        return states, [change for change in tool_changes(states) if change.to_s < self.control.machine_s - 10.0]

    def holes_s(self) -> list[tuple[float, float]]:
        """The stated holes in the machine's seconds."""
        return [(gap.first_sequence / 1000 - SWITCHED_ON_S, gap.last_sequence / 1000 - SWITCHED_ON_S) for gap in self.seen.gaps]
