"""The plant of a kill run: Kafka, Mosquitto, the load, a bridge and runners, each a process that can be killed."""

import os
import subprocess
import sys
import time
from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass
from multiprocessing import Pipe, Process
from multiprocessing.connection import Connection
from pathlib import Path

from benchmarks.hall.load import Order, serve
from benchmarks.hall.usage import busy_s, usage_of
from cnctwin.processes.private_broker import PrivateBroker
from tests.kafka.kafka_server import KafkaServer
from tests.wire.mosquitto import free_port

STOP_S_MAX = 60.0
BUFFER_MB, BUFFER_MB_AWAY = 256, 2048  # what a Kafka that stays away for long needs: the run is to lose nothing
BORN_S_MAX = 60.0
PROCESSORS = ("thermal", "cutting_force", "gap", "rules", "events", "tool_change_detector", "alerts")
"""Without `mirror`, which publishes each value once more: with it 100 machines at 10 Hz are more than two cores can do that Kafka
and both brokers, the load and those who watch share."""
KEEPING = ("upgrade_outgoing_qos true",)
KEPT_HOURS = "1"
# A machine of the load changes its tool every two minutes: the load of its spindle falls to 0, and the alarm ends.
CONFIGURATION = """\
[rules]
load_limit_pct = 30.0
load_clear_pct = 25.0
load_dwell_s = 1.0
load_clear_s = 1.0

[alerts]
group_wait_s = 1.0
group_interval_s = 1.0
flap_episodes = 50
flap_window_s = 60.0

[alerts.signals]
"twin/rule_load_over_limit" = {{ severity = "high", for_s = 0.0, keep_firing_for_s = 1.0 }}

[alerts.receivers.run]
type = "webhook"
url = "{url}"
rate_per_hour = 10000
rate_high_per_hour = 10000
"""


@dataclass(frozen=True, slots=True)
class Setup:
    """The options of a run.

    members: the static names of the runners; session_s: after which one that is gone is given up; away_s: for which a killed
    Kafka stays away; keeps_session: the MQTT broker keeps for the bridge what it cannot deliver, and nothing may be missing
    """

    machines: int = 100
    hz: float = 10.0
    minutes: float = 15.0
    every_s: float = 30.0
    partitions: int = 4
    processors: tuple[str, ...] = PROCESSORS
    members: tuple[str, ...] = ("r0",)
    session_s: float = 30.0
    kills: tuple[str, ...] = ("bridge", "runner", "kafka")
    away_s: float = 0.0
    keeps_session: bool = False


def _environment() -> dict[str, str]:
    """Return the environment of a command: compiled modules are kept, as in an installation, whatever ours says."""
    return {name: value for name, value in os.environ.items() if name != "PYTHONDONTWRITEBYTECODE"} | {"PYTHONFAULTHANDLER": "1"}


class Command:
    """A command that a supervisor would keep running. `cpu_s` sums over all its lives."""

    def __init__(self, name: str, arguments: Sequence[str], log: Path) -> None:
        self.name, self._arguments, self._log = name, list(arguments), log
        self.cpu_s = 0.0
        self._process: subprocess.Popen[bytes] | None = None

    @property
    def running(self) -> bool:
        """True while the process lives."""
        return self._process is not None and self._process.poll() is None

    def start(self) -> float:
        """Begin it; return the moment, by the wall clock."""
        began_s = time.time()
        with self._log.open("ab") as log:
            self._process = subprocess.Popen(
                [sys.executable, "-m", "cnctwin", *self._arguments],
                stdin=subprocess.DEVNULL,
                stdout=log,
                stderr=log,
                env=_environment(),
            )
        return began_s

    def kill(self) -> None:
        """End it by -9."""
        assert self._process is not None
        self.cpu_s += usage_of(self._process.pid).cpu_s
        self._process.kill()
        self._process.wait()

    def stop(self) -> int:
        """Ask it to end (SIGTERM); return its exit status, -9 where it had to be killed."""
        assert self._process is not None
        self.cpu_s += usage_of(self._process.pid).cpu_s
        self._process.terminate()
        try:
            return self._process.wait(STOP_S_MAX)
        except subprocess.TimeoutExpired:
            self._process.kill()
            return self._process.wait()

    def last_words(self) -> str:
        """Return the end of what it has said."""
        return self._log.read_text(errors="replace")[-2000:] if self._log.exists() else ""


class Plant:
    """See the module. `webhook`: the address that alerts are told at."""

    def __init__(self, setup: Setup, home: Path, webhook: str) -> None:
        self.setup, self.home = setup, home
        for name in ("kafka", "mqtt"):
            (home / name).mkdir()
        self.kafka = KafkaServer(home / "kafka")
        self.mqtt = PrivateBroker(home / "mqtt", free_port(), extra=KEEPING if setup.keeps_session else ())
        self.config = home / "processors.toml"
        self.config.write_text(CONFIGURATION.format(url=webhook))
        self._kafka_config = home / "kafka.toml"
        self._kafka_config.write_text(
            f"partitions = {setup.partitions}\nreplication_factor = 1\nsession_s = {setup.session_s}\n"
            f"buffer_mb = {BUFFER_MB_AWAY if setup.away_s else BUFFER_MB}\n"
        )
        self.ended: Counter[str] = Counter()
        self.kafka_cpu_s = 0.0
        self._kafka_is_up = False
        self._load: Process | None = None
        self._pipe: Connection | None = None
        self._began = (0.0, 0.0)
        self.bridge = Command("bridge", [], home / "bridge.log")
        self.runners: dict[str, Command] = {}

    def start(self) -> None:
        """Start the two brokers, then the bridge and the runners."""
        self.start_kafka()
        self.mqtt.start()
        common = ["--kafka", self.kafka.bootstrap, "--kafka-config", str(self._kafka_config), "--config", str(self.config)]
        common += ["--broker", self.mqtt.address.url]
        names = ",".join(self.setup.processors)
        state = str(self.home / "state")
        own = ["--name", "b0", "--processors", names, "--state-dir", state]
        own += ["--keep-session", KEPT_HOURS] if self.setup.keeps_session else []
        self.bridge = Command("bridge", ["bridge", *common, *own], self.home / "bridge.log")
        self.runners = {
            member: Command(member, ["process", *self.setup.processors, *common, "--member", member], self.home / f"{member}.log")
            for member in self.setup.members
        }
        self.bridge.start()
        for runner in self.runners.values():
            runner.start()
        self._began = time.monotonic(), busy_s()

    def bear(self) -> None:
        """Have the machines be born and begin to talk."""
        self._pipe, end = Pipe()
        order = Order(self.mqtt.address.port, list(range(self.setup.machines)), self.setup.hz)
        self._load = Process(target=serve, args=(order, end), daemon=True)
        self._load.start()
        if not self._pipe.poll(BORN_S_MAX):
            raise SystemExit(f"the load does not come up within {BORN_S_MAX:g} s")
        self._pipe.recv()
        self._pipe.send("born")

    def end_load(self) -> None:
        """Have the machines fall silent, and be offline."""
        if self._load is not None and self._pipe is not None:
            self._pipe.send(None)
            self._load.join(10.0)
            self._load.kill()
            self._load = None

    def kill_kafka(self) -> None:
        """End Kafka by -9."""
        self._kafka_is_up = False
        self.kafka_cpu_s += usage_of(self.kafka.pid).cpu_s
        self.kafka.kill()

    def start_kafka(self) -> None:
        """Start Kafka, and return once it answers."""
        self.kafka.start()
        self._kafka_is_up = True

    def busy(self) -> tuple[float, float]:
        """Return the seconds since the start, and the busy share of all processors of the computer, in per cent."""
        passed_s = time.monotonic() - self._began[0]
        return passed_s, 100.0 * (busy_s() - self._began[1]) / passed_s / (os.cpu_count() or 1)

    def watch(self) -> None:
        """Begin again what has ended by itself, as a supervisor would, and count it. Kafka is not ours: its end ends the run."""
        if self._kafka_is_up and not self.kafka.running:
            raise SystemExit(f"Kafka has ended by itself: {self.kafka.last_words()}")
        for one in (self.bridge, *self.runners.values()):
            if not one.running:
                self.ended[one.name] += 1
                print(f"{one.name} has ended by itself: {one.last_words()[-400:]}", flush=True)
                one.start()

    def stop(self) -> None:
        """End all that is left."""
        self.end_load()
        for one in (self.bridge, *self.runners.values()):
            if one.running:
                one.kill()
        self.mqtt.stop()
        if self.kafka.running:
            self.kafka.kill()
