"""An hour of simulated production through a real connection, and what must be true of it afterwards."""

import random
from bisect import bisect_right
from dataclasses import dataclass, field
from functools import partial
from operator import attrgetter
from typing import Any, NamedTuple

from cnctwin.standins.lsv2_server.answers import Model
from cnctwin.standins.lsv2_server.server import Fault, Lsv2Server
from cnctwin.standins.simulated_control.control import SimulatedControl
from cnctwin.standins.simulated_control.state import ControlState, ToolChange, production, tool_changes
from edge.config import EdgeConfig
from edge.controls.heidenhain.config import HeidenhainConfig
from edge.controls.heidenhain.connection import HeidenhainConnection
from edge.controls.heidenhain.cursor import parse, start
from edge.controls.heidenhain.klartext import read_program
from edge.running.ledger import Ledger
from edge.running.pipeline import Pipeline
from edge.sample import EdgeSample, SampleSet
from tests.edge.controls.heidenhain.machine_time import SWITCHED_ON_S, MachineTime
from tests.wire.mosquitto import free_port

FAULTS = tuple(fault for fault in Fault if fault is not Fault.NONE)
PATIENCE_S = 0.15


class Look(NamedTuple):
    """One frame and the machine's seconds in which its look was made."""

    frame: SampleSet
    from_s: float
    to_s: float
    rows: tuple[tuple[EdgeSample, ...], ...]


_at_s = attrgetter("at_s")


@dataclass
class Run:
    """What went in and what came out."""

    states: list[ControlState]
    looks: list[Look] = field(default_factory=list)
    ledger: Ledger = field(default_factory=Ledger)
    faults: list[tuple[float, float, str]] = field(default_factory=list)
    telegrams: int = 0
    writes_refused: int = 0
    reconnects: int = 0
    interval_s: float = 0.25
    blocks: tuple[str, ...] = ()

    def shown(self, from_s: float, to_s: float) -> list[ControlState]:
        """The states that the control showed between these seconds."""
        first = max(0, bisect_right(self.states, from_s, key=_at_s) - 1)
        return self.states[first : bisect_right(self.states, to_s, key=_at_s)]

    @property
    def holes(self) -> list[tuple[float, float, int]]:
        """From, to, and the most that was lost."""
        return [
            (gap.first_sequence / 1000 - SWITCHED_ON_S, gap.last_sequence / 1000 - SWITCHED_ON_S, gap.lost)
            for look in self.looks
            for gap in look.frame.gaps
        ]

    @property
    def published(self) -> list[EdgeSample]:
        return [sample for look in self.looks for row in look.rows for sample in row]

    def changes(self) -> list[tuple[float, float]]:
        """The published changes, from the onset to the end, in the machine's seconds."""
        found: list[tuple[float, float]] = []
        since_s: float | None = None
        for sample in self.published:
            if sample.signal != "tool_change_active":
                continue
            at_s = sample.timestamp_ms / 1000 - SWITCHED_ON_S
            if sample.value is True and since_s is None:
                since_s = at_s
            elif sample.value is not True and since_s is not None:
                found.append((since_s, at_s))
                since_s = None
        return found

    def true_changes(self) -> list[ToolChange]:
        last_s = self.looks[-1].from_s - 5.0
        return [change for change in tool_changes(self.states) if change.to_s < last_s]

    def unknown(self) -> list[tuple[float, float]]:
        """When `tool_change_active` was published as null: the control did not tell."""
        found: list[tuple[float, float]] = []
        since_s: float | None = None
        for sample in self.published:
            if sample.signal == "tool_change_active":
                at_s = sample.timestamp_ms / 1000 - SWITCHED_ON_S
                if sample.value is None and since_s is None:
                    since_s = at_s
                elif sample.value is not None and since_s is not None:
                    found.append((since_s, at_s))
                    since_s = None
        return found

    def unseen(self, change: ToolChange) -> bool:
        """Return whether the edge had a hole around that change, or said that it does not know."""
        blind = [(from_s, to_s) for from_s, to_s, _ in self.holes] + self.unknown()
        return any(a < change.to_s + 1.0 and change.from_s - 1.0 < b for a, b in blind)


def _set(server: Lsv2Server, fault: Fault) -> None:
    server.fault, server.fault_s = fault, 3.0 if fault is Fault.HANG else 0.2


def _planned(server: Lsv2Server, time: MachineTime, run: Run, seconds: float, seed: int) -> None:
    """A fault about once in 45 s, each for some seconds; the kinds in turn, so that each comes."""
    chance = random.Random(seed)
    kinds = [*FAULTS, "kill"]
    chance.shuffle(kinds)
    at_s, number = 20.0, 0
    while (at_s := at_s + chance.uniform(25.0, 65.0)) < seconds - 40.0:
        kind, lasts_s = str(kinds[number % len(kinds)]), chance.uniform(2.0, 8.0)
        number += 1
        run.faults.append((at_s, at_s + lasts_s, kind))
        if kind == "kill":
            time.plan += [(at_s, server.stop), (at_s + lasts_s, server.start)]
            continue
        time.plan += [(at_s, partial(_set, server, Fault(kind))), (at_s + lasts_s, partial(_set, server, Fault.NONE))]
    time.plan.sort(key=lambda planned: planned[0])


def produce(seconds: float, model: Model, *, seed: int = 6, interval_ms: int = 250, **source: Any) -> Run:
    """So many seconds of production on this control, with faults, read by the edge as this source says."""
    time, states = MachineTime(), list(production(seconds))
    run = Run(states, interval_s=interval_ms / 1000)
    control = SimulatedControl(states, machine_s=time.now_s, switched_on_s=SWITCHED_ON_S)
    with Lsv2Server(control, model=model, port=free_port(), pause=time.pass_by) as server:
        run.blocks = read_program(server.answers.program_text).blocks
        _planned(server, time, run, seconds, seed)
        config = EdgeConfig(source=HeidenhainConfig(url=server.url, interval_ms=interval_ms, **source))
        connection = HeidenhainConnection(
            config,
            clock=time.now_s,
            wall_s=time.wall_s,
            wait=time.wait,
            patience_s=PATIENCE_S,
            chance=random.Random(seed),
        )
        _read(run, config, connection, time, seconds)
        run.telegrams, run.writes_refused = server.answers.counters.telegrams, server.answers.counters.writes_refused
        run.reconnects = connection.reconnects
    return run


def _read(run: Run, config: Any, connection: HeidenhainConnection, time: MachineTime, seconds: float) -> None:
    cursor, pipeline = start(config), Pipeline(config)
    frames = connection.frames()
    before_s = 0.0
    for raw in frames:
        cursor, frame = parse(config, cursor, raw)
        assert frame.accounted()
        run.ledger.queue(frame.received)
        outcome = pipeline.take(frame, time.now_s())
        emitted = sum(sample.observations for row in outcome.rows for sample in row)
        run.ledger.settle(taken=frame.received, emitted=emitted, dropped=outcome.dropped, held=pipeline.held)
        assert Ledger.difference(run.ledger.snapshot()) == 0
        middle_s = (frame.newest_ms or 0) / 1000 - SWITCHED_ON_S
        run.looks.append(Look(frame, before_s, time.now_s(), outcome.rows))
        assert before_s - 0.002 <= middle_s <= time.now_s() + 0.002
        before_s = time.now_s()
        if before_s > seconds - 1.0:
            connection.close()
    frames.close()
