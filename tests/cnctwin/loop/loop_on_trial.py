"""A plant for the loop: a real broker and job consumer, a gap as the folder has it, and the service as a process to be killed."""

import json
import os
import signal
import subprocess
import sys
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass, field
from pathlib import Path
from types import TracebackType
from typing import Any

from cnctwin.jobs.consumer import CHILD, Consumer, Setting
from cnctwin.jobs.job_queue import Limits
from cnctwin.machines.folder import MachineFolder
from processors.description import version_of
from sparkplug.broker import BrokerAddress
from sparkplug.clock import now_ms
from sparkplug.datatype import DataType
from sparkplug.edge_node import EdgeNode
from sparkplug.host import EventKind, HostApplication
from sparkplug.metric import Change, MetricSpec, NodeId
from sparkplug.quality import Quality

ROOT = Path(__file__).parents[3]
PATIENCE_S = 240.0
QUICK = (sys.executable, "-m", "tests.cnctwin.loop.quick_diagnosis")
LIVE = '[machine]\nname = "vmc"\n[spindle]\nrated_power_kw = 11.0\nefficiency = 0.85\n'
BETTER = LIVE.replace("11.0", "12.0")
VA, VB = version_of(LIVE), version_of(BETTER)
_GAP, _OPEN, _WINDOW = "twin/gap_spindle_temp_c", "twin/gap_open", "twin/gap_window"
_OTHER = "twin/challenger/gap_spindle_temp_c"
_FIGURES, _TEXTS = (DataType.DOUBLE, (_GAP, _OTHER)), (DataType.STRING, (_OPEN, _WINDOW))
_SPECS = [MetricSpec(name, kind) for kind, names in (_FIGURES, _TEXTS) for name in names]


@dataclass
class LoopPlant:
    """Use it as a context.

    gaps: standing gap by version, as the processor would tell it; of every other one it is 1
    live: the text of the description; window: which stretch it tells to diagnose, at the machine's time `at_ms`
    store: with one all is done as it really is; else jobs and children take no time
    """

    folder: Path
    port: int
    live: str = LIVE
    window: str = "none"
    at_ms: Callable[[], int] = now_ms
    store: Path | None = None
    gaps: dict[str, float] = field(default_factory=lambda: {VA: 3.1, VB: 1.0})
    document: dict[str, Any] = field(default_factory=dict)
    service: subprocess.Popen[bytes] | None = None

    def __enter__(self) -> "LoopPlant":
        self.machines, self.files, self.jobs = (self.folder / name for name in ("machines", "files", "jobs"))
        for made in (self.machines, self.files / "loop" / "vmc", self.jobs):
            made.mkdir(parents=True)
        (self.machines / "vmc.toml").write_text(self.live)
        self.own = MachineFolder(self.machines, "vmc")
        self.broker = BrokerAddress(port=self.port)
        self._stack = ExitStack()
        self._stack.enter_context(self._consumer())
        self._edge = EdgeNode(self.broker, NodeId("cnc", "twin-gap"))
        self._edge.declare_device("vmc", _SPECS)
        self._edge.start()
        self._stack.callback(self._edge.stop)
        self._host = HostApplication(self.broker, "trial", (), publish_state=False)
        self._host.subscribe_plain("cnctwin/loop/vmc")
        self._host.start()
        self._stack.callback(self._host.stop)
        self.start()
        return self

    def __exit__(self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None) -> None:
        self.kill()
        self._stack.close()

    def start(self) -> None:
        """Start the service."""
        command = [sys.executable, "-m", "tests.cnctwin.loop.service_on_trial", str(self.port)]
        command += [str(self.machines), str(self.files), str(self.jobs), *([] if self.store is None else [str(self.store)])]
        with (self.folder / "service.log").open("ab") as log:
            self.service = subprocess.Popen(
                command, cwd=ROOT, stdout=log, stderr=log, env={**os.environ, "PYTHONPATH": str(ROOT)}
            )

    def kill(self) -> None:
        """kill -9 the service."""
        if self.service is not None:
            self.service.send_signal(signal.SIGKILL)
            self.service.wait()
            self.service = None

    def ask(self, word: str, **fields: str) -> None:
        """Ask for something as a person does."""
        payload = json.dumps({"machine": "vmc", "by": "anna", **fields}).encode()
        self.until(lambda: self._host.publish_plain(f"cnctwin/loop/request/{word}", payload, qos=1), "a connection")

    def until(self, condition: Callable[[], Any], what: str) -> Any:
        """Tell the gap and look at the document until something is so."""
        deadline_s = time.monotonic() + PATIENCE_S
        while not (found := condition()):
            told = json.dumps({key: self.document.get(key) for key in ("step", "text", "why_not", "standing")})
            assert time.monotonic() < deadline_s, f"waited for {what}: {told} {(self.folder / 'service.log').read_text()[-2000:]}"
            self._tell_the_gap()
            for event in self._host.poll(0.1):
                if event.kind is EventKind.PLAIN and event.payload:
                    self.document = json.loads(event.payload)
        return found

    def until_step(self, step: str) -> None:
        """Wait until the loop says that it is in a step."""
        self.until(lambda: self.document.get("step") == step, step)

    def _tell_the_gap(self) -> None:
        at_ms, live, waits = self.at_ms(), self.own.live_version(), self.own.challenger_version()
        gap = self.gaps.get(live, 1.0)
        changes = [Change(_GAP, gap, at_ms), Change(_OPEN, "spindle_temp_c" if gap > 2.0 else "none", at_ms)]
        changes.append(Change(_WINDOW, self.window, at_ms))
        if waits:
            changes.append(Change(_OTHER, self.gaps.get(waits, 1.0), at_ms))
        else:  # the runtime declares a challenger's metrics only while there is one
            changes.append(Change(_OTHER, None, at_ms, Quality.BAD, "no challenger"))
        self._edge.publish("vmc", changes)

    @contextmanager
    def _consumer(self) -> Iterator[None]:
        setting = Setting(files=self.files, limits=Limits(pause_s=0.01), child=CHILD if self.store else QUICK)
        consumer, stop = Consumer(self.jobs, self.broker, setting), threading.Event()
        thread = threading.Thread(target=consumer.run, args=(stop,))
        thread.start()
        try:
            yield
        finally:
            stop.set()
            thread.join(20.0)
