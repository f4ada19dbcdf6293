"""A second process with the same names ends with one line that says who is there; the first one goes on and is not thrown out."""

import subprocess
import sys
import time
from pathlib import Path

import pytest

from cnctwin.processes.look_around import refuse_second
from sparkplug.broker import BrokerAddress
from sparkplug.datatype import DataType
from sparkplug.edge_node import EdgeNode
from sparkplug.errors import AnotherRunsError
from sparkplug.metric import MetricSpec, NodeId
from tests.cnctwin.program import Program, until
from tests.wire.mosquitto import Mosquitto

NODE = NodeId("cnc", "twin-mirror")
WAY_OUT = "end that one first"


@pytest.mark.parametrize("process", ["gateway-7:1234", None])
def test_who_answers_for_a_node_has_it(process: str | None, mosquitto: Mosquitto) -> None:
    broker = BrokerAddress(*mosquitto.address)
    metrics = [MetricSpec("health/process", DataType.STRING, value=process)] if process else []
    first = EdgeNode(broker, NODE, metrics)
    first.start()
    try:
        until(lambda: first.online, "the first to be born")
        time.sleep(1.1)  # a node answers requests at most once a second
        connects = first.reconnects
        with pytest.raises(AnotherRunsError) as refused:
            refuse_second(broker, [NodeId("cnc", "twin-thermal"), NODE], WAY_OUT)
        assert first.online
        assert first.reconnects == connects
    finally:
        first.stop()
    who = process or "a process elsewhere"
    assert str(refused.value) == f"another one runs: {who} is the node cnc/twin-mirror on {broker.url} already; {WAY_OUT}"


def test_nobody_waits_for_one_that_is_dead_or_for_a_broker_that_is_away(mosquitto: Mosquitto) -> None:
    begun_s = time.monotonic()
    refuse_second(BrokerAddress(*mosquitto.address), [NODE], WAY_OUT)
    refuse_second(BrokerAddress("127.0.0.1", 1), [NODE], WAY_OUT)
    assert time.monotonic() - begun_s < 20.0


@pytest.mark.parametrize("same_folder", [True, False], ids=["on one machine", "from another machine"])
def test_a_second_process_ends_and_the_first_goes_on(same_folder: bool, mosquitto: Mosquitto, tmp_path: Path) -> None:
    broker = BrokerAddress(*mosquitto.address)
    folders = [tmp_path / "a", tmp_path / ("a" if same_folder else "b")]
    command = ["process", "mirror", "--broker", broker.url, "--state-dir"]
    with Program(tmp_path, *command, str(folders[0])) as first:
        until(lambda: "twin-mirror" in mosquitto.log and (folders[0] / "twin-mirror.json").exists(), "the first to connect")
        time.sleep(1.1)
        done = subprocess.run(
            [sys.executable, "-m", "cnctwin", *command, str(folders[1])], capture_output=True, text=True, timeout=120, check=False
        )
        assert first.process.poll() is None
        assert done.returncode == 2, done.stderr
        (line,) = done.stderr.splitlines()
        assert line.startswith("cnctwin: another one runs: ")
        assert f":{first.process.pid} " in line
        assert "is the node cnc/twin-mirror" in line
        assert "Unspecified" not in (tmp_path / "err").read_text()
        first.process.kill()
        first.process.wait()
    begun_s = time.monotonic()
    with Program(tmp_path, *command, str(folders[0])) as again:  # a supervisor starts it again, at once
        until(lambda: again.process.poll() is not None or _births(mosquitto) >= 2, "the first to be born again")
        assert again.process.poll() is None
    assert time.monotonic() - begun_s < 60.0


def _births(mosquitto: Mosquitto) -> int:
    return mosquitto.log.count(" as cnc/twin-mirror ")
