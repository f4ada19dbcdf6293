"""`cnctwin up`: all processes of a plant's folder, each started in order, and again when it dies."""

import logging
import os
import shlex
import sys
import time
from collections.abc import Callable
from dataclasses import dataclass, field
from threading import Event
from urllib.parse import urlsplit

from cnctwin.errors import UsageError
from cnctwin.processes import child as child_module
from cnctwin.processes import state_file
from cnctwin.processes.child import Child
from cnctwin.processes.given_broker import BROKER_VARIABLE, address
from cnctwin.processes.port import is_free
from cnctwin.processes.private_broker import PrivateBroker
from cnctwin.running.plant_folder import PlantFolder
from edge.state_dir import VARIABLE as STATE_VARIABLE
from twin.vocabulary.nodes import HISTORIAN_NODE

PROCESSORS = (
    *("mirror", "rules", "thermal", "vibration", "cutting_force", "expected", "gap", "joint_anomaly", "tool_wear", "residual"),
    *("events", "control_alarms", "production", "alerts"),
)
STORE_VARIABLE = "CNCTWIN_STORE"
START_S_MAX = 60.0
WATCH_S = 0.5
PAUSE_S_MAX = 60.0


@dataclass(slots=True)
class Plant:
    """The processes of a plant. Raises UsageError where the folder is none."""

    folder: PlantFolder
    port: int
    children: list[Child] = field(default_factory=list)
    broker: PrivateBroker | None = None
    _edge_command: list[str] = field(default_factory=list)
    _not_before_s: dict[str, float] = field(default_factory=dict)

    def start(self) -> str:
        """Start everything, the broker first; return the address of the page."""
        folder = self.folder
        if not folder.processors.is_file():
            root = shlex.quote(str(folder.root))
            raise UsageError(f"{folder.root}: has no processors.toml; `cnctwin init {root}` sets a plant up")
        folder.state.mkdir(parents=True, exist_ok=True)
        os.environ.update({STATE_VARIABLE: str(folder.state), STORE_VARIABLE: str(folder.root / "store")} | folder.environment())
        broker = ["--broker", self._broker()]
        config = ["--config", str(folder.processors)]
        machines = ["--machines", str(folder.machines)]
        # The memory begins first, so that it hears what the others say from their first word on.
        self._begin("historian", ["process", "historian", *config, *machines, *broker])
        self._await((folder.state / f"{HISTORIAN_NODE}.json").exists)
        page = self._page([*config, *broker])
        self._begin("processors", ["process", *PROCESSORS, *config, *machines, *broker])
        files, jobs = folder.root / "cases", folder.state / "jobs"
        files.mkdir(exist_ok=True)
        self._begin("jobs", ["jobs", "run", "--dir", str(jobs), "--files", str(files), *broker])
        self._begin("loop", ["twin", "run", *config, *machines, "--jobs", str(jobs), "--jobs-files", str(files), *broker])
        self._edge_command = ["edge", "run", str(folder.edges), *broker]
        self._begin_edges()  # last: from their first word on somebody is there to listen
        return page

    def watch(self) -> list[str]:
        """Start again what has died, after a pause that grows; return what is to be said of it."""
        said = ["the private broker ended and was started again"] if self.broker is not None and self.broker.watch() else []
        self._begin_edges()
        now_s = time.monotonic()
        for child in self.children:
            if now_s >= self._not_before_s.get(child.name, 0.0) and not child.running:
                words = child.last_words(1)
                if child.watch():
                    self._not_before_s[child.name] = now_s + min(2.0**child.restarts, PAUSE_S_MAX)
                    said.append(f"{child.name} ended and was started again ({child.log}): {words}")
        return said

    def stop(self) -> None:
        """Stop everything, the sources first."""
        for child in reversed(self.children):
            child.stop()
        if self.broker is not None:
            self.broker.stop()

    def _broker(self) -> str:
        """The address of the broker: the given one, else that of a private one, which is started."""
        given = os.environ.get(BROKER_VARIABLE, "")
        if given:
            address(given)  # what is wrong with it is said before anything begins
            return given
        self.broker = PrivateBroker(self.folder.state / "broker")
        self.broker.start()
        return self.broker.address.url

    def _page(self, arguments: list[str]) -> str:
        """Start the page, on its port or a free one; return its address, or what is wrong."""
        state = self.folder.state / "page.json"
        state.unlink(missing_ok=True)
        port = self.port if is_free(self.port) else 0
        models = self.folder.root / "models"
        arguments = [*arguments, *(["--models", str(models)] if models.is_dir() else [])]
        self._begin("page", ["serve", *arguments, "--no-open", "--state-file", str(state), "--port", str(port)])
        page = self.children[-1]
        self._await(lambda: bool(state_file.read(state).get("url")) or not page.running)
        if not page.running and port:  # somebody else has taken the port meanwhile
            page.command = [*page.command[:-1], "0"]
            page.start()
            self._await(lambda: bool(state_file.read(state).get("url")) or not page.running)
        url = str(state_file.read(state).get("url", ""))
        if url:  # started again, it has to be where the browser looks for it
            page.command = [*page.command[:-1], str(urlsplit(url).port)]
        return url or f"does not start: {page.last_words()}"

    def _begin_edges(self) -> None:
        """Start the edges as soon as there is a machine; one process takes up all that come later."""
        if self._edge_command and any(self.folder.edges.glob("*.toml")):
            self._begin("edge", self._edge_command)
            self._edge_command = []

    def _begin(self, name: str, arguments: list[str]) -> None:
        logs = self.folder.state / "logs"
        logs.mkdir(exist_ok=True)
        child = Child(name, [sys.executable, "-m", "cnctwin", *arguments], logs / f"{name}.log")
        self.children.append(child)
        child.start()

    def _await(self, condition: Callable[[], bool]) -> None:
        """Until it is so, but not for ever."""
        deadline_s = time.monotonic() + START_S_MAX
        while time.monotonic() < deadline_s and not condition():
            time.sleep(0.05)


def run(folder: PlantFolder, port: int, stop: Event, tell: Callable[[str], None]) -> None:
    """Run the plant until `stop` is set."""
    logging.getLogger(child_module.__name__).setLevel(logging.ERROR)  # what ends is told here
    plant = Plant(folder, port)
    try:
        page = plant.start()
        names = ", ".join(file.stem for file in sorted(folder.edges.glob("*.toml")))
        tell(f"machines:  {names or 'none yet; `cnctwin init` adds one'}")
        tell(f"page:      {page}")
        broker = os.environ.get(BROKER_VARIABLE) or f"{plant.broker.address.url if plant.broker else ''} (private, loopback only)"
        tell(f"broker:    {broker}")
        tell(f"logs:      {folder.state / 'logs'}")
        tell("Ctrl-C ends it")
        while not stop.wait(WATCH_S):
            for said in plant.watch():
                tell(said)
    finally:
        plant.stop()
