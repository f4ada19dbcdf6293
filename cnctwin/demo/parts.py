"""The processes of the demo, each of them a part that a plant has too, started in order and again when they die."""

import json
import shutil
import sys
import time
from dataclasses import dataclass
from pathlib import Path
from typing import Any
from urllib.parse import urlsplit
from xml.etree import ElementTree

from cnctwin.demo.by_itself import ByItself
from cnctwin.errors import ApplicationError, UsageError
from cnctwin.processes import state_file
from cnctwin.processes.child import Child
from cnctwin.processes.port import is_free
from cnctwin.processes.private_broker import PrivateBroker
from cnctwin.standins.simulated_machine import description
from cnctwin.standins.simulated_machine.anomaly_model import place_model
from cnctwin.standins.simulated_machine.expectation import place_expectation
from cnctwin.standins.simulated_machine.hidden_effect import RANDOM, choice_of
from sparkplug.errors import TopicError
from sparkplug.topics import check_id
from twin.vocabulary.nodes import HISTORIAN_NODE

PROCESSORS = (
    *("thermal", "cutting_force", "expected", "gap", "rules", "joint_anomaly", "alerts", "events", "production", "mirror"),
    "historian",
)
START_S_MAX = 15.0
PAGE_PORT = 8080
NONE = "none"

ASSUMED = Path(__file__).with_name("assumed.toml")
CALENDAR = Path(__file__).with_name("calendar.toml")
_RECORDED_TOML = """\
# A recording may have no sensor of the air, and its machine can no longer be corrected.
[thermal]
ambient_temp_c = 22.0

[gap]
shown_s_min = 5.0

[gap.floors]
spindle_temp_c = 0.3
spindle_load_pct = 0.5

[loop]
diagnose = "by_hand"
"""
# At twenty times real time, a second on the way between two processors is twenty of the machine's.
_LATE_TOML = "\n[rules]\nlate_s_max = 60.0\n\n[alerts]\nlate_s_max = 60.0\n"
_LOOP_TOML = 'diagnose = "{diagnose}"\npromote = "{promote}"\n'  # [loop] is the last table of the simulated machine's
_PRODUCTION_TOML = "\n[production]\ncalendar = {calendar}\nexpectations = {expectations}\n"
_NO_MODEL_TOML = "\n[joint_anomaly]\n"
_HISTORIAN_TOML = "\n[historian]\nstore = {store}\nraw_days = 36500.0\n"  # a recording may be years old


@dataclass(frozen=True, slots=True)
class DemoOptions:
    """A user's choices. `seconds` None runs until Ctrl-C; `port` is the private broker's; `recording` None simulates.

    effect: that the simulated machine hides, as `hidden_effect.choice_of` reads it; `none` hides none; seed: of the draw
    diagnose, promote: who begins the diagnosis, and who makes its answer the live twin
    """

    recording: Path | None = None
    devices: Path | None = None
    speed: float = 1.0
    seconds: float | None = None
    port: int | None = None
    machine: str | None = None
    json: bool = False
    no_open: bool = False
    effect: str = RANDOM
    seed: int | None = None
    diagnose: ByItself = ByItself.BY_ITSELF
    promote: ByItself = ByItself.BY_ITSELF


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
        if options.recording is None and options.effect != NONE:
            choice_of(options.effect)
        self.machine = _checked(options.machine or machine_name(options.devices if options.recording else description.DEVICES))
        self.broker = PrivateBroker(folder / "broker", options.port)
        self._folder = folder
        self.sealed = folder / "sealed.json"
        self._agent_state, self._page_state = folder / "agent.json", folder / "page.json"
        self.page_url = self.page_trouble = ""
        self._page: Child | None = None
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
        settings.write_text(self.settings())
        self.describe()
        broker = ["--broker", self.broker.address.url]
        state = ["--state-dir", str(self._folder)]
        # The memory begins first, so that it hears what the others say from their first word on.
        self._begin("historian", ["process", "historian", "--config", str(settings), *broker, *state])
        self._await_historian()
        store, jobs = str(self._folder / "store"), str(self._folder / "jobs")
        shown = ["--diagnoses", str(self._folder / "diagnoses")]
        shown += ["--sealed", str(self.sealed)] if self.hides else []
        self._serve(["--config", str(settings), "--store", store, "--jobs", jobs, *shown, *broker])
        others = [name for name in PROCESSORS if name != "historian"]
        self._begin("processors", ["process", *others, "--config", str(settings), *broker, *state])
        files = str(self._files())
        self._begin("jobs", ["jobs", "run", "--dir", jobs, "--files", files, *broker])
        places = ["--store", store, "--jobs", jobs, "--jobs-files", files, "--diagnoses", str(self._folder / "diagnoses")]
        self._begin("loop", ["twin", "run", "--config", str(settings), *places, *broker])
        # The edge comes last: from its first word on somebody is there to listen.
        self._begin("edge", ["edge", "run", str(edge)])

    def watch(self) -> None:
        """Start again what has died, and take up the address of a page that comes late."""
        self.broker.watch()
        for child in self.children:
            child.watch()
        self._find_page()

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
        """True once the agent has played the whole recording; None where there is none."""
        return bool(self._state().get("finished")) if self.options.recording else None

    @property
    def parts(self) -> int | None:
        """The number of parts that the simulated machine has made since it was switched on."""
        return None if self.options.recording else int(self._state().get("parts", 0))

    @property
    def notice(self) -> str:
        """The simulated machine's own notice where it is not as it should be."""
        return str(self._state().get("notice", ""))

    @property
    def agent_ledger(self) -> dict[str, Any]:
        """The agent's account of its recording's lines."""
        return dict(self._state().get("ledger", {}))

    def restarts(self) -> dict[str, int]:
        """Return how often each part was started again."""
        parts = [self.broker.child, *self.children]
        return {child.name: child.restarts for child in parts if child.restarts}

    @property
    def hides(self) -> bool:
        """True where the machine has an effect that its twin was not told of."""
        return self.options.recording is None and self.options.effect != NONE

    def settings(self) -> str:
        """Return how processors and loop run."""
        told = _RECORDED_TOML + _NO_MODEL_TOML if self.options.recording else self._as_described()
        kept = _HISTORIAN_TOML.format(store=json.dumps(str(self._folder / "store")))
        return f"{told}late_s_max = 60.0\n{_LATE_TOML}{kept}"  # joint_anomaly's table is the last one

    def describe(self) -> None:
        """Write what the twin is told of the machine, where the processors and the loop look for it."""
        folder = self._folder / "machines"
        folder.mkdir()
        text = ASSUMED.read_text(encoding="utf-8") if self.options.recording else description.description_text()
        (folder / f"{self.machine}.toml").write_text(text, encoding="utf-8")

    def _files(self) -> Path:
        """The folder of what a job may read: the simulated machine and its program, to optimise on the page."""
        folder = self._folder / "files"
        folder.mkdir()
        if self.options.recording is None:
            for file in (description.PROGRAM, description.TOLD):
                shutil.copy(file, folder)
        return folder

    def _as_described(self) -> str:
        """Return the processors' settings for the simulated machine, for its program, and for the model of its scores."""
        settings = description.PROCESSORS.read_text() + _LOOP_TOML.format(
            diagnose="by_itself" if self.options.diagnose is ByItself.BY_ITSELF else "by_hand",
            promote="by_rule" if self.options.promote is ByItself.BY_ITSELF else "by_hand",
        )
        folder = self._folder / "expectations"
        expected = place_expectation(folder, self.machine)
        figures = _PRODUCTION_TOML.format(calendar=json.dumps(str(CALENDAR)), expectations=json.dumps(str(folder)))
        return settings + expected + figures + place_model(self._folder / "models", self.machine, folder)

    def _agent(self) -> list[str]:
        """The command that stands in for the control."""
        if self.options.recording is None:
            seed = [] if self.options.seed is None else ["--seed", str(self.options.seed)]
            hidden = ["--effect", self.options.effect, *seed, "--sealed", str(self.sealed)] if self.hides else []
            return ["simulate-control", "machine", *hidden]
        devices = ["--devices", str(self.options.devices)] if self.options.devices else []
        return ["simulate-control", "mtconnect", str(self.options.recording), *devices, "--wait"]

    def _begin(self, name: str, arguments: list[str]) -> None:
        child = Child(name, [sys.executable, "-m", "cnctwin", *arguments], self._folder / f"{name}.log")
        self.children.append(child)
        child.start()

    def _await_historian(self) -> None:
        """Until its store is there, but not for ever: it is started again if it dies."""
        deadline_s = time.monotonic() + START_S_MAX
        while time.monotonic() < deadline_s and not (self._folder / f"{HISTORIAN_NODE}.json").exists():
            time.sleep(0.05)

    def _serve(self, arguments: list[str]) -> None:
        """Start the page, on the usual port or a free one, and wait until it says where it is. Without it, the demo goes on."""
        given = ["serve", *arguments, "--state-file", str(self._page_state), "--no-open", "--port"]
        self._begin("page", [*given, str(PAGE_PORT if is_free(PAGE_PORT) else 0)])
        page = self._page = self.children[-1]
        deadline_s = time.monotonic() + START_S_MAX
        while time.monotonic() < deadline_s and not self.page_url:
            if not page.running and page.command[-1] != "0":  # somebody else has taken the port meanwhile
                page.command = [*page.command[:-1], "0"]
                page.start()
            self._find_page()
            time.sleep(0.05)
        if not self.page_url:
            self.page_trouble = page_trouble(page)

    def _find_page(self) -> None:
        """Take up where the page is, once it says so."""
        if self.page_url or self._page is None:
            return
        self.page_url = str(state_file.read(self._page_state).get("url", ""))
        if self.page_url:  # killed and started again, it has to be where the browser looks for it
            self._page.command = [*self._page.command[:-1], str(urlsplit(self.page_url).port)]

    def _agent_url(self) -> str:
        deadline_s = time.monotonic() + START_S_MAX
        while time.monotonic() < deadline_s and self.children[0].running:
            if url := self._state().get("url"):
                return str(url)
            time.sleep(0.05)
        what = f"replay of {self.options.recording}" if self.options.recording else "simulated machine"
        raise ApplicationError(f"the {what} does not start: {self.children[0].last_words()}")

    def _state(self) -> dict[str, Any]:
        return state_file.read(self._agent_state)

    def _edge_toml(self, agent_url: str) -> str:
        # JSON strings are TOML strings too.
        return (
            f"[machine]\nname = {json.dumps(self.machine)}\n\n"
            f"[broker]\nurl = {json.dumps(self.broker.address.url)}\n"
            f"session_file = {json.dumps(str(self._folder / 'edge-session.json'))}\n\n"
            f"[mtconnect]\nurl = {json.dumps(agent_url)}\ndevice = {json.dumps(str(self._state().get('device', '')))}\n"
        )


def page_trouble(page: Child) -> str:
    """Return why there is no page yet, and where it will be, as far as that is known."""
    if not page.running:
        return f"does not start: {page.last_words() or 'it ended without a word'}; it is started again"
    port = page.command[-1]
    where = "its address is printed here once it is up" if port == "0" else f"it will be at http://127.0.0.1:{port}"
    return f"not up after {START_S_MAX:g} s; {where}"


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
