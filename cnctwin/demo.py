"""`cnctwin demo`: a machine, its edge, a real broker and the twin, started together and accounted for at the end.

Each part is a process of its own, as in production, and is started again when it dies. What is shown and summed up at the end is
read from the broker, as anyone could.
"""

import json
import sys
import time
from collections.abc import Callable
from contextlib import ExitStack
from dataclasses import asdict, dataclass
from pathlib import Path
from tempfile import TemporaryDirectory
from threading import Event
from typing import Any
from urllib.parse import urlsplit
from xml.etree import ElementTree

from rich.console import Console

from cnctwin.child import Child
from cnctwin.errors import ProgramError, UsageError
from cnctwin.plant import StageLedger, ledgers, machines, text
from cnctwin.private_broker import PrivateBroker
from cnctwin.simulated_machine import description
from cnctwin.simulated_machine.anomaly_model import place_model
from cnctwin.terminal import ledger_table
from cnctwin.watch import show, viewer
from sparkplug.errors import TopicError
from sparkplug.host import EventKind, HostApplication, HostEvent
from sparkplug.topics import check_id

PROCESSORS = ("thermal", "cutting_force", "gap", "rules", "joint_anomaly", "alerts", "mirror")
GROUP = "cnc"
QUIET_S = 1.5
SETTLE_S_MAX = 12.0
AGENT_START_S_MAX = 15.0

_PROCESSORS_TOML = """\
# What the twin assumes of a recorded machine in the demo. None of it is fitted to the machine that is shown.
[thermal]
alpha_w_per_pct_rpm2 = 2.2e-8
beta_w_per_rpm = 1.6e-2
resistance_k_per_w = 0.12
capacity_j_per_k = 9000.0
ambient_temp_c = 22.0

[cutting_force]
rated_power_kw = 11.0
tool_diameter_mm = 12.0

[gap.floors]
spindle_temp_c = 0.3
spindle_load_pct = 0.5
"""
# At twenty times real time, a second on the way between two processors is twenty of the machine's.
_LATE_TOML = "\n[rules]\nlate_s_max = 60.0\n\n[alerts]\nlate_s_max = 60.0\n"
_NO_MODEL_TOML = "\n[joint_anomaly]\n"


@dataclass(frozen=True, slots=True)
class DemoOptions:
    """What a user may choose. `seconds` None runs until Ctrl-C; `port` is the private broker's; `recording` None simulates."""

    recording: Path | None = None
    devices: Path | None = None
    speed: float = 1.0
    seconds: float | None = None
    port: int | None = None
    machine: str | None = None
    json: bool = False


@dataclass(frozen=True, slots=True)
class Summary:
    """What went through. `recording_ended` is None for the simulated machine, `parts` for a recording."""

    machine: str
    tool_changes: int
    last_tool: str
    seconds: float
    recording_ended: bool | None
    parts: int | None
    restarts: dict[str, int]
    ledgers: tuple[StageLedger, ...]

    @property
    def balances(self) -> bool:
        """Whether every stage published a ledger, each saw something, and each balances."""
        whole = len(self.ledgers) == 1 + len(PROCESSORS) and all(ledger.received for ledger in self.ledgers)
        return whole and all(ledger.balances for ledger in self.ledgers)


class ToolChanges:
    """Counts how often the control's tool change begins, from the events of the broker."""

    def __init__(self, machine: str) -> None:
        self._machine = machine
        self._active = False
        self.count = 0

    def see(self, events: list[HostEvent]) -> None:
        """Take the next events."""
        for event in events:
            if event.device != self._machine or event.kind not in (EventKind.BIRTH, EventKind.DATA):
                continue
            for reading in event.readings:
                if reading.name == "tool_change_active" and isinstance(reading.value, bool):
                    self.count += reading.value and not self._active
                    self._active = reading.value


class Demo:
    """The parts of the demo, in the order in which they are started."""

    def __init__(self, options: DemoOptions, folder: Path) -> None:
        self.options = options
        for path in (options.recording, options.devices):
            if path is not None and not path.is_file():
                raise UsageError(f"{path}: no such file; give a recording with --recording and its device model with --devices")
        if options.devices and not options.recording:
            raise UsageError(f"--devices {options.devices} describes no recording; name the one it belongs to with --recording")
        if options.seconds is not None and not options.seconds > 0:
            raise UsageError(f"--seconds {options.seconds:g} is not above 0; leave it out to run until Ctrl-C")
        if options.recording is None:
            description.check(options.speed)
        elif not options.speed > 0:
            raise UsageError(f"--speed {options.speed:g} is not above 0; 1 is the recorded pace, 20 twenty times as fast")
        self.machine = _checked(options.machine or machine_name(options.devices if options.recording else description.DEVICES))
        self.broker = PrivateBroker(folder / "broker", options.port)
        self._folder = folder
        self._agent_state = folder / "agent.json"
        self.children: list[Child] = []

    def start(self) -> None:
        """Start the broker and the agent, then what depends on them."""
        self._begin("agent", [*self._agent(), "--speed", f"{self.options.speed:g}", "--state-file", str(self._agent_state)])
        url = self._agent_url()
        if not self.options.machine:  # the model may hold a whole shop; the agent knows which machine the recording is of
            self.machine = _checked(str(self._state().get("device") or self.machine).lower())
        # Killed and started again, the agent has to be where the edge looks for it.
        self.children[0].command = [*self.children[0].command, "--port", str(urlsplit(url).port)]
        edge = self._folder / "edge.toml"
        edge.write_text(self._edge_toml(url))
        settings = self._folder / "processors.toml"
        told = _PROCESSORS_TOML + _NO_MODEL_TOML if self.options.recording else self._as_described()
        settings.write_text(f"{told}late_s_max = 60.0\n{_LATE_TOML}")  # joint_anomaly's table is the last one
        broker = ["--broker", self.broker.address.url]
        state = ["--state-dir", str(self._folder)]
        self._begin("processors", ["process", *PROCESSORS, "--config", str(settings), *broker, *state])
        self._begin("edge", ["edge", "run", str(edge)])

    def watch(self) -> None:
        """Start again what has died."""
        self.broker.watch()
        for child in self.children:
            child.watch()

    def stop_source(self) -> None:
        """Stop the machine, so that what is on its way can arrive."""
        self.children[0].stop()

    def stop(self) -> None:
        """Stop everything, the sources first."""
        for child in reversed(self.children):
            child.stop()
        self.broker.stop()

    @property
    def recording_ended(self) -> bool | None:
        """Whether the agent has played the whole recording; None where there is none."""
        return bool(self._state().get("finished")) if self.options.recording else None

    @property
    def parts(self) -> int | None:
        """How many parts the simulated machine has made since it was switched on."""
        return None if self.options.recording else int(self._state().get("parts", 0))

    @property
    def notice(self) -> str:
        """What the simulated machine has to say of itself, where it is not as it should be."""
        return str(self._state().get("notice", ""))

    @property
    def agent_ledger(self) -> dict[str, Any]:
        """What the agent says of its recording's lines."""
        return dict(self._state().get("ledger", {}))

    def restarts(self) -> dict[str, int]:
        """How often each part was started again."""
        parts = [self.broker.child, *self.children]
        return {child.name: child.restarts for child in parts if child.restarts}

    def _as_described(self) -> str:
        """What the processors are told of the simulated machine, and of the model of its scores."""
        return description.PROCESSORS.read_text() + place_model(self._folder / "models", self.machine)

    def _agent(self) -> list[str]:
        """The command that stands in for the control."""
        if self.options.recording is None:
            return ["simulate-control", "machine"]
        devices = ["--devices", str(self.options.devices)] if self.options.devices else []
        return ["simulate-control", "mtconnect", str(self.options.recording), *devices, "--wait"]

    def _begin(self, name: str, arguments: list[str]) -> None:
        child = Child(name, [sys.executable, "-m", "cnctwin", *arguments], self._folder / f"{name}.log")
        self.children.append(child)
        child.start()

    def _agent_url(self) -> str:
        deadline_s = time.monotonic() + AGENT_START_S_MAX
        while time.monotonic() < deadline_s and self.children[0].running:
            if url := self._state().get("url"):
                return str(url)
            time.sleep(0.05)
        what = f"replay of {self.options.recording}" if self.options.recording else "simulated machine"
        raise ProgramError(f"the {what} does not start: {self.children[0].last_words()}")

    def _state(self) -> dict[str, Any]:
        try:
            state: dict[str, Any] = json.loads(self._agent_state.read_text())
        except (OSError, ValueError):
            return {}
        return state

    def _edge_toml(self, agent_url: str) -> str:
        # JSON strings are TOML strings too.
        return (
            f"[machine]\nname = {json.dumps(self.machine)}\n\n"
            f"[broker]\nurl = {json.dumps(self.broker.address.url)}\n"
            f"session_file = {json.dumps(str(self._folder / 'edge-session.json'))}\n\n"
            f"[mtconnect]\nurl = {json.dumps(agent_url)}\ndevice = {json.dumps(str(self._state().get('device', '')))}\n"
        )


def run(options: DemoOptions, stop: Event) -> int:
    """Run the demo until its time is over or `stop` is set; the exit code is 1 where the ledger does not balance."""
    console = Console(stderr=options.json)
    if not console.is_terminal:
        console.width = 120
    with TemporaryDirectory(prefix="cnctwin-") as folder, ExitStack() as stack:
        demo = Demo(options, Path(folder))
        stack.callback(demo.stop)
        demo.broker.start()
        host = viewer(demo.broker.address, GROUP)
        host.start()
        stack.callback(host.stop)
        demo.start()
        changes = ToolChanges(demo.machine)
        console.print(greeting(demo), markup=False, highlight=False, soft_wrap=True)
        started_s = time.monotonic()
        ends_s = None if options.seconds is None else started_s + options.seconds

        told: set[str] = set()

        def over() -> bool:
            demo.watch()
            if not console.is_terminal and (notice := demo.notice) not in told | {""}:
                told.add(notice)
                console.print(f"{demo.machine}: {notice}", markup=False, highlight=False, soft_wrap=True)
            return stop.is_set() or (ends_s is not None and time.monotonic() >= ends_s)

        show(host, console, over, note=lambda: _note(demo, ends_s), on_events=changes.see)
        ended = demo.recording_ended
        demo.stop_source()
        _settle(host, changes.see)
        summary = Summary(
            machine=demo.machine,
            tool_changes=changes.count,
            last_tool=_last_tool(host, demo.machine),
            seconds=round(time.monotonic() - started_s, 1),
            recording_ended=ended,
            parts=demo.parts,
            restarts=demo.restarts(),
            ledgers=tuple(ledgers(host)),
        )
        _tell(summary, demo, console, as_json=options.json)
    return 0 if summary.balances else 1


def greeting(demo: Demo) -> str:
    """What a user needs to know at the start."""
    port = demo.broker.port
    at = "" if port == 1883 else f" -p {port}"
    speed = demo.options.speed
    if demo.options.recording:
        what = f"{demo.options.recording.name} at {speed:g} times its pace"
    else:
        pace = "in real time" if speed == 1 else f"at {speed:g} times real time"
        what = f"simulated {pace}; it runs {description.PROGRAM.name}, one part after the other"
    return (
        f"{demo.machine}: {what}\n"
        f"broker:    {demo.broker.address.url} (private, loopback only)\n"
        f"read it:   mosquitto_sub{at} -t 'cnc/#' -v          plain JSON, any MQTT client\n"
        f"           mosquitto_sub{at} -t 'spBv1.0/#' -F '%t'  the Sparkplug B messages behind it\n"
        f"elsewhere: cnctwin watch --broker {demo.broker.address.url}   cnctwin doctor --broker {demo.broker.address.url}"
    )


def machine_name(devices: Path | None) -> str:
    """The name of the first device of a device model, in small letters; `machine` without one."""
    if devices is None:
        return "machine"
    try:
        root = ElementTree.parse(devices).getroot()  # noqa: S314 — a local file that the user names; the agent checks it again
    except (ElementTree.ParseError, OSError) as error:
        raise UsageError(f"{devices}: cannot be read as a device model: {error}") from error
    for element in root.iter():
        if element.tag.rpartition("}")[2] == "Device":
            return (element.get("name") or element.get("uuid") or "machine").lower()
    raise UsageError(f"{devices}: holds no Device; give the answer of an agent to /probe")


def _checked(machine: str) -> str:
    """The name, where it can be a Sparkplug device."""
    try:
        return check_id(machine, "machine name")
    except TopicError as error:
        raise UsageError(f"{error}; name the machine with --machine") from error


def _settle(host: HostApplication, on_events: Callable[[list[HostEvent]], None]) -> None:
    """Wait until nothing moves any more: the ledgers stay as they are and no stage holds anything back."""
    deadline_s = time.monotonic() + SETTLE_S_MAX
    before: tuple[StageLedger, ...] = ()
    since_s = time.monotonic()
    while time.monotonic() < deadline_s:
        on_events(host.poll(0.1))
        now = tuple(ledgers(host))
        begun = len(now) == 1 + len(PROCESSORS) and all(ledger.received for ledger in now)
        if not begun or now != before or any(ledger.buffered for ledger in now):
            before, since_s = now, time.monotonic()
        elif time.monotonic() - since_s >= QUIET_S:
            return


def _last_tool(host: HostApplication, machine: str) -> str:
    reading = next((m.measured.get("tool_number") for m in machines(host) if m.name == machine), None)
    return "none" if reading is None or reading.value is None else text(reading)


def _note(demo: Demo, ends_s: float | None) -> str:
    left = "Ctrl-C ends the demo" if ends_s is None else f"{max(ends_s - time.monotonic(), 0):.0f} s left, Ctrl-C ends it earlier"
    ended = " · the recording has ended" if demo.recording_ended else ""
    notice = f" · {demo.notice}" if demo.notice else ""
    return f"{left}{ended}{notice} · mosquitto_sub -p {demo.broker.port} -t 'cnc/#' -v"


def _tell(summary: Summary, demo: Demo, console: Console, *, as_json: bool) -> None:
    if as_json:
        ledger = [{**asdict(stage), "balances": stage.balances} for stage in summary.ledgers]
        whole = {**asdict(summary), "ledgers": ledger, "balances": summary.balances, "agent": demo.agent_ledger}
        sys.stdout.write(json.dumps(whole) + "\n")
        return
    if summary.parts is not None:
        state = f"{summary.parts} part{'' if summary.parts == 1 else 's'} made"
    else:
        state = f"the recording was {'' if summary.recording_ended else 'not '}played to its end"
    console.print(
        f"{summary.machine}: {summary.seconds:g} s, {state}; {summary.tool_changes} tool changes, tool {summary.last_tool} last",
        markup=False,
        highlight=False,
    )
    console.print(ledger_table(summary.ledgers))
    if summary.restarts:
        console.print(f"started again: {summary.restarts}", markup=False)
    if not summary.balances:
        console.print("the ledger does not balance, or a stage published none", style="bold red")
