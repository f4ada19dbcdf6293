"""`cnctwin process` killed with -9 beside a machine that stands still: in `shadow`, and at the moment of a promotion."""

import json
import os
import signal
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path

import pytest

from cnctwin.machines.change import changing
from cnctwin.machines.evidence import Card
from cnctwin.machines.folder import MachineFolder
from processors.description import version_of
from processors.thermal import RISE
from sparkplug.broker import BrokerAddress
from sparkplug.datatype import DataType
from sparkplug.edge_node import EdgeNode
from sparkplug.host import EventKind
from sparkplug.metric import MetricSpec, NodeId
from sparkplug.quality import Quality
from tests.processors.alerts.courier.office import until
from tests.processors.machines import THERMAL, described_as
from tests.processors.running.test_runtime import Reader, broker, reader, say
from tests.processors.streams import T0_MS
from twin.machine_toml import machine_to_toml
from twin.vocabulary.twin_signals import challenger_name

__all__ = ["broker", "reader"]
pytestmark = pytest.mark.broker
ROOT = Path(__file__).parents[3]
LIVE = machine_to_toml(described_as(thermal=THERMAL).machine)
COOLER = machine_to_toml(described_as(thermal={**THERMAL, "resistance_k_per_w": 0.06}).machine)
CHALLENGERS = challenger_name(RISE)
NEAR_K = 1.0
"""The heat moves by less in the time of a test; the two descriptions are 7 K apart."""
VALUES = {"spindle_rpm": 6000.0, "spindle_load_pct": 50.0, "ambient_temp_c": 20.0}


class Plant:
    """A machine that was warmed up beside the live description and its challenger, and has nothing more to say."""

    def __init__(self, broker: BrokerAddress, reader: Reader, folder: Path) -> None:
        self.broker, self.reader, self.folder = broker, reader, folder
        (folder / "machines").mkdir()
        (folder / "machines" / "okuma.toml").write_text(LIVE)
        self.own = MachineFolder(folder / "machines", "okuma")
        with changing(self.own, T0_MS) as change:
            change.file(COOLER, Card(), "loop", "it cools better")
        self.edge = EdgeNode(broker, NodeId("cnc", "edge-okuma"))  # it does not beat
        self.edge.declare_device("okuma", [MetricSpec(name, DataType.DOUBLE) for name in VALUES])
        self.edge.start()
        until(lambda: self.edge.online, "the edge")
        self.start()

    def warm_up(self) -> None:
        """Have the machine run for an hour beside both."""
        until(lambda: self._retained("challenger") == version_of(COOLER), "the challenger on the broker")
        say(self.edge, 0.0, **VALUES)
        until(lambda: self.rise(CHALLENGERS) is not None, "both to be told")
        for at_s in range(300, 3601, 300):
            say(self.edge, at_s, spindle_rpm=6000.0)
        self.last_ms = T0_MS + 3_600_000
        until(self._is_saved, "a snapshot with both")
        self.before = (until(lambda: self.rise(RISE), "the rise"), until(lambda: self.rise(CHALLENGERS), "the challenger's"))
        assert self.before[0] - self.before[1] > 5.0 * NEAR_K

    def start(self) -> None:
        """Start the processors."""
        command = [sys.executable, "-m", "cnctwin", "process", "thermal", "--machines", str(self.folder / "machines")]
        command += ["--state-dir", str(self.folder / "state"), "--broker", f"mqtt://127.0.0.1:{self.broker.port}"]
        with (self.folder / "log").open("ab") as log:
            self.process = subprocess.Popen(command, cwd=ROOT, stdout=log, stderr=log, stdin=subprocess.DEVNULL)

    def kill(self) -> None:
        """kill -9 the processors, and wait until the broker has said so."""
        deaths = self._deaths()
        self.process.kill()
        self.process.wait()
        until(lambda: self._deaths() > deaths, "the will")

    def promote(self) -> None:
        """Make the challenger live, as a person does."""
        with changing(self.own, T0_MS) as change:
            change.promote("anna", "", is_forced=True)

    def rise(self, name: str) -> float | None:
        """The rise as it is told now; None while it is not."""
        told = self.reader.twin(name)
        return float(told.value) if told is not None and told.quality is Quality.GOOD and told.value is not None else None  # type: ignore[arg-type]

    def is_live(self, toml: str) -> bool:
        """Return True where the broker retains a description as the live one."""
        return self._retained("live") == version_of(toml)

    def closes(self) -> bool:
        """Return True where the live rise is what the challenger's was, and no challenger is told of any more."""
        of_twin = [one for one in list(self.reader.events) if (one.node.node, one.device) == ("twin-thermal", "okuma")]
        births = [one for one in of_twin if one.kind is EventKind.BIRTH]
        declared = {one.name for birth in births[-1:] for one in birth.readings}
        rise = self.rise(RISE)
        return rise is not None and CHALLENGERS not in declared and abs(rise - self.before[1]) < NEAR_K

    def promotions(self) -> int:
        """Return how often something was made live."""
        return sum(str(step.step) == "promoted" for step in self.own.steps())

    def _retained(self, role: str) -> str:
        return str(json.loads(self.reader.plain.get(f"cnctwin/description/okuma/{role}") or b"{}").get("version", ""))

    def _is_saved(self) -> bool:
        kept = json.loads(self.reader.plain.get("cnctwin/snapshot/thermal/okuma") or b"{}").get("live", {})
        return bool(kept.get("challenger")) and kept["machines"]["okuma"]["last_ms"] == self.last_ms

    def _deaths(self) -> int:
        return sum(one.kind is EventKind.DEATH and one.node.node == "twin-thermal" for one in list(self.reader.events))


@pytest.fixture
def plant(broker: BrokerAddress, reader: Reader, tmp_path: Path) -> Iterator[Plant]:
    """A plant whose challenger runs as a shadow."""
    found = Plant(broker, reader, tmp_path)
    try:
        found.warm_up()
        yield found
    finally:
        found.process.kill()
        found.process.wait()
        found.edge.stop()


def test_killed_in_shadow_both_go_on_where_they_were_and_the_promotion_closes_the_gap(plant: Plant) -> None:
    plant.kill()
    plant.start()
    both = until(lambda: (one := plant.rise(RISE)) and (other := plant.rise(CHALLENGERS)) and (one, other), "both")
    assert both == pytest.approx(plant.before, abs=NEAR_K)
    plant.promote()
    until(lambda: plant.is_live(COOLER), "the promotion on the broker")
    say(plant.edge, 3601.0, **VALUES)  # a description is taken up behind the next message
    until(plant.closes, "the gap to close")
    assert plant.promotions() == 1


def test_killed_when_the_file_is_written_and_the_broker_not_told_the_promotion_comes_once_with_the_heat(plant: Plant) -> None:
    os.kill(plant.process.pid, signal.SIGSTOP)  # it cannot tell the broker
    plant.promote()
    assert plant.is_live(LIVE), "the broker was told"
    plant.kill()
    assert plant.is_live(LIVE), "the broker was told"
    plant.start()
    until(lambda: plant.is_live(COOLER), "the promotion on the broker")
    until(lambda: plant.rise(RISE), "the machine, which stands still")
    say(plant.edge, 3601.0, **VALUES)
    until(plant.closes, "the gap to close")
    assert plant.promotions() == 1
    assert (plant.own.live_version(), plant.own.challenger_version()) == (version_of(COOLER), "")
