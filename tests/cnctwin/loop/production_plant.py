"""A plant on accelerated production days: real edge node, processors, historian, loop and job runner, each to be killed.

The machine is the simulated one as it is built, a few per cent off the data sheet that its twin is told. Its days lie in the
past; time is that of its control. It works as fast as the processors follow, and rests while the loop composes and diagnoses:
that takes seconds, which would be days of production here.
"""

import json
import os
import signal
import subprocess
import sys
import time
from collections.abc import Callable, Iterator, Mapping
from contextlib import suppress
from dataclasses import dataclass, field
from datetime import UTC, datetime
from functools import partial
from pathlib import Path
from types import TracebackType
from typing import Any

from cnctwin.machines.folder import MachineFolder
from cnctwin.machines.step_log import Step
from cnctwin.standins.production.day import Production
from cnctwin.standins.simulated_machine.as_built import machine_as_built
from cnctwin.standins.simulated_machine.description import TOLD
from sparkplug.broker import BrokerAddress
from sparkplug.datatype import DataType
from sparkplug.edge_node import EdgeNode
from sparkplug.host import EventKind, HostApplication
from sparkplug.metric import Change, MetricSpec, NodeId
from twin.effects.catalogue import effect_named
from twin.machine import AddedEffect, MachineFile
from twin.vocabulary.nodes import twin_node

ROOT = Path(__file__).parents[4]
MONDAY_S = 1_717_372_800.0
"""2024-06-03T00:00:00Z."""
BEGINS_S = MONDAY_S + 6 * 3600.0
"""The first shift begins."""
DAY_S, HOUR_S, TICK_S = 86_400.0, 3600.0, 5.0
AHEAD_S = 300.0
"""The time by which the machine may be ahead of what the processors have said."""
HEALTHY_HOURS = 5.0
PATIENCE_S = 120.0
GROUP, NAME = "cnc", "vmc"
FLAGS, WHOLE = ("tool_change_active", "coolant_on"), ("tool_number", "nc_line")
TEXTS = ("program", "exec_state")
NUMBERS = ("spindle_rpm", "spindle_rpm_cmd", "spindle_load_pct", "feed_mm_min", "spindle_temp_c", "ambient_temp_c")
SETTINGS = """
[thermal]
tick_s = {tick_s}
late_s_max = 900.0

[gap]
tick_s = {tick_s}
late_s_max = 900.0
healthy_from = {healthy_from}
healthy_hours = {healthy_hours}
publish_s = 60.0
standing_hours = 1.0

[gap.floors]
spindle_temp_c = 0.3
spindle_load_pct = 0.5
tool_change_s = 0.15

[historian]
store = {store}
raw_days = 36500.0

[loop]
promote = "by_rule"
open_hours = 5.0
shadow_hours = 1.5
back_hours = 4.0
again_hours = 4.0
"""
PARTS = ("historian", "processors", "jobs", "loop")


@dataclass
class ProductionPlant:
    """Use it as a context.

    port: of the broker; at_s: the machine's time; document: what the loop has said last; figures: and `gap`
    """

    folder: Path
    port: int
    seed: int = 7
    at_s: float = BEGINS_S
    document: dict[str, Any] = field(default_factory=dict)
    figures: dict[str, Any] = field(default_factory=dict)
    processes: dict[str, subprocess.Popen[bytes]] = field(default_factory=dict)
    in_step: Callable[[str], None] = lambda _: None
    _steps_seen: list[str] = field(default_factory=list)
    _temp_c: float | None = None
    _begun_s: float = BEGINS_S
    _said: dict[str, Any] = field(default_factory=dict)

    def __enter__(self) -> "ProductionPlant":
        machines, files = self.folder / "machines", self.folder / "files"
        for made in (machines, files):
            made.mkdir(parents=True)
        (machines / f"{NAME}.toml").write_text(TOLD.read_text(encoding="utf-8"))
        self.own = MachineFolder(machines, NAME)
        self.settings = self.folder / "processors.toml"
        healthy_from = datetime.fromtimestamp(BEGINS_S, UTC).isoformat().replace("+00:00", "Z")
        store = json.dumps(str(self.folder / "store"))
        values = {"tick_s": TICK_S, "healthy_from": healthy_from, "healthy_hours": HEALTHY_HOURS, "store": store}
        self.settings.write_text(SETTINGS.format(**values))
        broker = BrokerAddress(port=self.port)
        self._viewer = HostApplication(broker, "trial", (f"spBv1.0/{GROUP}/#",), publish_state=False)
        self._viewer.subscribe_plain(f"cnctwin/loop/{NAME}")
        self._viewer.start()
        for name in PARTS:
            self.start(name)
        self._wait(lambda: all(self._is_online(one) for one in ("historian", "thermal", "gap")), "the processors")
        self._edge = EdgeNode(broker, NodeId(GROUP, "edge-vmc"), session_file=self.folder / "edge.json")
        specs = [MetricSpec(one, DataType.DOUBLE) for one in NUMBERS] + [MetricSpec(one, DataType.STRING) for one in TEXTS]
        specs += [MetricSpec(one, DataType.BOOLEAN) for one in FLAGS] + [MetricSpec(one, DataType.INT64) for one in WHOLE]
        self._edge.declare_device(NAME, specs)
        self._edge.start()
        return self

    def __exit__(self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None) -> None:
        self._edge.stop()
        for name in list(self.processes):
            self.kill(name)
        self._viewer.stop()

    # Processes.

    def start(self, name: str) -> None:
        """Start a part as a plant does."""
        state, jobs, files = (str(self.folder / one) for one in ("state", "jobs", "files"))
        config = ["--config", str(self.settings)]
        arguments = {
            "historian": ["process", "historian", *config, "--state-dir", state],
            "processors": ["process", "thermal", "gap", *config, "--state-dir", state],
            "jobs": ["jobs", "run", "--dir", jobs, "--files", files],
            "loop": ["twin", "run", *config, "--store", str(self.folder / "store"), "--jobs", jobs, "--jobs-files", files],
        }[name]
        command = [sys.executable, "-m", "cnctwin", *arguments, "--broker", f"mqtt://127.0.0.1:{self.port}"]
        with (self.folder / f"{name}.log").open("ab") as log:
            self.processes[name] = subprocess.Popen(
                command, cwd=ROOT, stdout=log, stderr=log, stdin=subprocess.DEVNULL, start_new_session=True
            )

    def kill(self, name: str) -> None:
        """kill -9 a part."""
        process = self.processes.pop(name)
        with suppress(ProcessLookupError):
            process.send_signal(signal.SIGKILL)
        process.wait()

    def kill_child(self, name: str) -> None:
        """kill -9 the child of a part, once there is one."""
        pid = self.processes[name].pid
        until_s = time.monotonic() + PATIENCE_S
        while not (found := _children(pid)):
            assert time.monotonic() < until_s, f"waited for a child of {name}"
            time.sleep(0.02)
        for child in found:
            with suppress(ProcessLookupError):
                os.kill(child, signal.SIGKILL)

    # The machine.

    def work(self, machine: MachineFile, hours: float) -> None:
        """Have the machine work for so long, nights left out."""
        worked_s = 0.0
        while worked_s < hours * HOUR_S:
            span_s = min(self._shift_end_s() - self.at_s, hours * HOUR_S - worked_s)
            if span_s <= 0.0:
                self.at_s, self._temp_c = (self.at_s // DAY_S + 1.0) * DAY_S + 6.0 * HOUR_S, None
                self._begun_s = self.at_s
                continue
            day = Production(machine, self.seed).day(self.at_s, span_s / HOUR_S, self._temp_c)
            self._tell(day.thinned(TICK_S).rows())
            self._temp_c, self.at_s, worked_s = day.end_temp_c, self.at_s + span_s, worked_s + span_s

    def work_until(
        self, machine: MachineFile, condition: Callable[[], Any], hours_max: float, step_h: float = 0.25
    ) -> float | None:
        """Have it work until something is so; return the hours that it took, None where it did not come to that.

        It rests while the loop composes and diagnoses.
        """
        for n in range(round(hours_max / step_h) + 1):
            self.look(0.3)
            self._wait(lambda: self.document.get("step") not in ("composing", "diagnosing"), "the diagnosis")
            if condition():
                return n * step_h
            self.work(machine, step_h)
        return None

    def _shift_end_s(self) -> float:
        return self.at_s // DAY_S * DAY_S + 22.0 * HOUR_S

    def _tell(self, rows: Iterator[tuple[float, Mapping[str, Any]]]) -> None:
        """Publish what changes, as fast as the processors follow."""
        for at_s, row in rows:
            at_ms = round(at_s * 1000)
            news = {name: value for name, value in row.items() if name not in self._said or self._said[name] != value}
            self._wait(partial(self._follows, at_s), "the processors to follow")
            if news:
                self._said |= news
                self._edge.publish(NAME, [Change(name, value, at_ms) for name, value in news.items()])

    def _follows(self, at_s: float) -> bool:
        return at_s <= self._followed_s() + AHEAD_S

    def _followed_s(self) -> float:
        return max(float(self.figures.get("thermal", 0.0)), self._begun_s)

    # What is said.

    def look(self, seconds: float) -> None:
        """Listen for so long."""
        until_s = time.monotonic() + seconds
        while True:
            for event in self._viewer.poll(0.05):
                if event.kind is EventKind.PLAIN and event.payload:
                    self._hear_loop(json.loads(event.payload))
                elif event.kind in (EventKind.DATA, EventKind.BIRTH) and event.device == NAME:
                    self._hear(event.node, event.readings)
            if time.monotonic() >= until_s:
                return

    def _hear_loop(self, document: dict[str, Any]) -> None:
        self.document, step = document, str(document.get("step"))
        if step not in self._steps_seen:
            self._steps_seen.append(step)
            self.in_step(step)

    def _hear(self, node: NodeId, readings: Any) -> None:
        told = {one.name: one for one in readings if not one.is_historical}
        if node.node == twin_node("thermal"):
            newest = max((one.timestamp_ms for one in told.values() if one.value is not None), default=0) / 1000.0
            self.figures["thermal"] = newest or self._followed_s()
        elif node.node == twin_node("gap"):
            self.figures |= {name: one.value for name, one in told.items()}

    def _is_online(self, processor: str) -> bool:
        seen = self._viewer.picture(NodeId(GROUP, twin_node(processor)))
        return seen is not None and seen.online

    def _wait(self, condition: Callable[[], Any], what: str) -> None:
        until_s = time.monotonic() + PATIENCE_S
        while not condition():
            assert time.monotonic() < until_s, f"waited for {what}: {self.account()}"
            self.look(0.02)

    def gap(self, signal: str) -> float:
        """Return the standing gap of a signal, in floors."""
        return float(self.figures.get(f"twin/gap_{signal}") or 0.0)

    def steps(self, kind: str) -> list[Step]:
        """Return the steps of a kind in the machine's log."""
        return [step for step in self.own.steps() if str(step.step) == kind]

    def causes(self, version: str) -> list[dict[str, Any]]:
        """Return the causes that a version was filed with."""
        card = self.own.card(version)
        return [] if card is None else [dict(one) for one in card.causes]

    def account(self) -> str:
        """Return how everything stands, for whoever reads that it failed."""
        told = {key: self.document.get(key) for key in ("step", "text", "why_not", "standing", "open")}
        logs = {name: (self.folder / f"{name}.log").read_text(errors="replace")[-600:] for name in PARTS}
        return json.dumps({"at": str(datetime.fromtimestamp(self.at_s, UTC)), **told, **logs}, indent=1)


def _children(pid: int) -> list[int]:
    tasks = Path(f"/proc/{pid}/task").glob("*/children")
    return [int(child) for task in tasks for child in task.read_text().split()]


def with_effect(name: str, on: str, **parameters: float) -> MachineFile:
    """Return the machine as it is built, with one effect more; what is not given is typical."""
    machine = machine_as_built()
    known = effect_named(name).typical_values() | parameters
    return machine.model_copy(update={"effects": (*machine.effects, AddedEffect(effect=name, on=on, parameters=known))})
