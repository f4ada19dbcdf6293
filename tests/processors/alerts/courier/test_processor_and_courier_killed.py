"""The processor and its courier in one process, killed with -9 while a machine's alarm comes and goes."""

import json
import random
import subprocess
import sys
import time
from collections import Counter
from pathlib import Path

import pytest

from sparkplug.broker import BrokerAddress
from sparkplug.datatype import DataType
from sparkplug.edge_node import EdgeNode
from sparkplug.metric import Change, MetricSpec, NodeId
from tests.processors.alerts.courier.alert_shop import VIBRATION
from tests.processors.alerts.courier.office import DELIVERY, OUTBOX, PATIENCE_S, ROOT, Office, until
from tests.processors.alerts.courier.receiving_server import Answer, ReceivingServer

pytestmark = pytest.mark.broker
KILLS = 4
MARKER = "cnctwin/marker/alerts"
CODE = """
import sys
from pathlib import Path
from cnctwin.processes.stopping import stopped_by_signals
from processors.alerts.config import AlertsConfig
from processors.config import read_tables
from processors.alerts.courier.thread import Courier
from processors.running.runtime import configured, run
from sparkplug.broker import BrokerAddress
broker, file = BrokerAddress(port=int(sys.argv[1])), Path(sys.argv[2])
Courier(broker, AlertsConfig.model_validate(read_tables(file)["alerts"])).start()
with stopped_by_signals() as stop:
    run(configured(["alerts"], file), broker, stop)
"""
TABLE = """
[alerts]
group_wait_s = 0.5
group_interval_s = 1.0
flap_episodes = 50
machine_offline = {{ severity = "low", for_s = 3600.0 }}
[alerts.signals]
"twin/rule_vibration" = {{ severity = "high", keep_firing_for_s = 0.0 }}
[alerts.receivers.desk]
type = "webhook"
url = "{url}/desk"
rate_high_per_hour = 1000
"""


@pytest.mark.parametrize("seed", [1])
def test_nothing_comes_twice_and_what_is_missing_is_said_to_have_failed(
    seed: int, broker: BrokerAddress, office: Office, tmp_path: Path
) -> None:
    chance = random.Random(seed)
    file = tmp_path / "alerts.toml"
    edge = EdgeNode(broker, NodeId("cnc", "edge-okuma"), [MetricSpec("health/beat", DataType.INT64)])
    edge.declare_device("okuma", [MetricSpec(VIBRATION, DataType.BOOLEAN, value=False)])
    edge.start()
    command = [sys.executable, "-c", CODE, str(broker.port), str(file)]
    with ReceivingServer() as server:
        server.usual = Answer(wait_s=0.2)
        file.write_text(TABLE.format(url=server.url))
        outbox: dict[str, bytes] = {}

        def toggle(seconds: float, arrivals: int) -> None:
            """The alarm comes and goes for so long, and until so many notifications have arrived."""
            end_s = time.monotonic() + seconds
            value = False
            while (now_s := time.monotonic()) < end_s or (len(server.ids()) < arrivals and now_s < end_s + PATIENCE_S):
                value = not value
                edge.publish("okuma", [Change(VIBRATION, value, time.time_ns() // 1_000_000)])
                time.sleep(chance.uniform(0.4, 1.6))
                outbox.update(office.outbox())

        for kill in range(KILLS):
            life = subprocess.Popen(command, cwd=ROOT, stdin=subprocess.DEVNULL)
            try:
                until(lambda: office.topics.pop(MARKER, b""), "a sign of life")
                toggle(chance.uniform(2.5, 4.5), (kill + 1) // 2)
            finally:
                life.kill()
                life.wait()
        edge.publish("okuma", [Change(VIBRATION, False, time.time_ns() // 1_000_000)])
        life = subprocess.Popen(command, cwd=ROOT, stdin=subprocess.DEVNULL)
        try:
            until(lambda: {topic.removeprefix(OUTBOX) for topic in office.outbox()} <= set(office.deliveries), "fates")
            time.sleep(2.0)
            outbox.update(office.outbox())
            until(lambda: {topic.removeprefix(OUTBOX) for topic in outbox} <= set(office.deliveries), "the last fates")
        finally:
            life.terminate()
            life.wait(60)
            edge.stop()
        arrived = server.ids()
    assert [key for key, count in arrived.items() if count > 1] == []
    outcomes = {key: {one["outcome"] for one in said} for key, said in office.deliveries.copy().items()}
    assert [key for key, said in outcomes.items() if len(said) > 1] == []
    missing = [topic for topic in outbox if topic.removeprefix(OUTBOX) not in arrived]
    assert [topic for topic in missing if outcomes[topic.removeprefix(OUTBOX)] != {"failed"}] == []
    said = Counter(entry for payload in outbox.values() for entry in json.loads(payload)["says"])
    assert [entry for entry, count in said.items() if count > 1] == []
    assert len(arrived) >= KILLS // 2
    assert all(topic.startswith((OUTBOX, DELIVERY)) for topic in outbox)
    failed = sum(said == {"failed"} for said in outcomes.values())
    print(f"{KILLS} kills: {len(outbox)} notifications, {len(arrived)} arrived, {failed} said to have failed")
