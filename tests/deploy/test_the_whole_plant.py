"""The real programs under the rules of deploy/: an edge, processors with the courier, a reader and an operator."""

import json
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import pytest

from cnctwin.commands.see.alerts import alerts_app
from cnctwin.running.processors import process
from processors.running.runtime import configured
from sparkplug.datatype import DataType
from sparkplug.edge_node import EdgeNode
from sparkplug.host import EventKind, HostApplication
from sparkplug.metric import Change, MetricSpec, NodeId
from tests.deploy.plant import Plant, need_programs
from tests.deploy.wire_client import WireClient
from tests.processors.alerts.courier.receiving_server import ReceivingServer
from tests.until_stopped import until_stopped

pytestmark = pytest.mark.broker
NODE = NodeId("cnc", "edge-okuma")
TABLES = '[alerts]\ngroup_wait_s = 0.0\n[alerts.receivers.desk]\ntype = "webhook"\nurl = "{url}/desk"\n'


@pytest.fixture(scope="module")
def plant(tmp_path_factory: pytest.TempPathFactory, mosquitto_program: str) -> Iterator[Plant]:
    """A plant of its own: what processors have the broker retain would be in the way of other tests."""
    assert mosquitto_program
    need_programs()
    plant = Plant(tmp_path_factory.mktemp("whole"))
    plant.build()
    plant.start()
    yield plant
    plant.stop()


def until(true: Callable[[], Any], what: str) -> None:
    deadline_s = time.monotonic() + 60.0
    while not true():
        assert time.monotonic() < deadline_s, f"{what} did not come"
        time.sleep(0.02)


@contextmanager
def at_work(plant: Plant, folder: Path, url: str) -> Iterator[None]:
    """The processors mirror, thermal and alerts, and the courier, as `cnctwin process` runs them."""
    config = folder / "processors.toml"
    config.write_text(TABLES.format(url=url))
    pairs = configured(["mirror", "thermal", "alerts"], config)
    with until_stopped(process, pairs, plant.of("processors"), group="cnc", state_dir=folder):
        yield


def says(edge: EdgeNode, spindle_rpm: float) -> bool:
    """Have the edge say it; a host that came later asks for the birth when it hears anything."""
    return edge.publish("okuma", [Change("spindle_rpm", spindle_rpm, time.time_ns() // 1_000_000)])


def mirrored(viewer: WireClient) -> list[float]:
    """Return what the viewer has seen of the spindle."""
    return [json.loads(said)["value"] for topic, said in viewer.received if topic == "cnc/okuma/spindle_rpm"]


def test_an_edge_its_mirror_and_its_alerts_work_under_the_rules(
    plant: Plant, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    edge = EdgeNode(plant.of("edge-okuma"), NODE)
    edge.declare_device("okuma", [MetricSpec("spindle_rpm", DataType.DOUBLE, "rev/min", value=0.0)])
    edge.start()
    with ReceivingServer() as desk, WireClient(plant.of("viewer")) as viewer:
        viewer.subscribe("cnc/#", "cnctwin/alerts/state")
        until(lambda: edge.online, "the birth")  # the processors come later, and have to ask for it
        with at_work(plant, tmp_path, desk.url):
            until(lambda: says(edge, 2400.0) and mirrored(viewer)[-1:] == [2400.0], "the mirror")
            until(lambda: any(topic == "cnctwin/alerts/state" for topic, _ in viewer.received), "the state of alerts")
            monkeypatch.setenv("CNCTWIN_PASSWORD", str(plant.of("operator").password))
            code = alerts_app(["test", "desk", "--broker", plant.of("operator").url, "--wait", "10"], standalone_mode=False)
            assert not code, capsys.readouterr()
            assert "desk: delivered" in capsys.readouterr().out
            assert len(desk.received) == 1
            until(lambda: any(topic.startswith("cnc/okuma/twin/") for topic, _ in viewer.received), "what a processor found out")
    edge.stop()


def test_a_command_of_a_processor_reaches_the_edge_and_that_of_another_edge_does_not(plant: Plant) -> None:
    written: list[object] = []
    edge = EdgeNode(plant.of("edge-okuma"), NODE, [MetricSpec("level", DataType.INT64, value=1)], on_command=written.append)
    host = HostApplication(plant.of("processors"), "twin-mirror")
    host.start()
    until(lambda: host.poll(0.01) or host.online, "the host")
    edge.start()
    births = 0
    deadline_s = time.monotonic() + 60.0
    while not births:
        assert time.monotonic() < deadline_s
        births += sum(event.kind is EventKind.BIRTH for event in host.poll(0.05))
    with WireClient(plant.ear) as ear, WireClient(plant.of("edge-other")) as other:
        ear.subscribe("spBv1.0/cnc/NCMD/#")
        assert host.send_command(NODE, None, [Change("level", 7, 1)])
        until(lambda: ear.received, "the command")
        genuine = ear.received[0][1]
        until(lambda: written, "the command at the edge")
        other.settle(other.publish("spBv1.0/cnc/NCMD/edge-okuma", genuine))
        other.settle(other.publish("spBv1.0/cnc/DCMD/edge-okuma/okuma", genuine))
        ear.publish("spBv1.0/cnc/NCMD/over", b"")
        ear.hear("spBv1.0/cnc/NCMD/over", b"")
        assert len(ear.received) == 2
    edge.stop()
    host.stop()
    assert len(written) == 1
