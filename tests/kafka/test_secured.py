"""Bridge and runner on a Kafka with TLS, users and the rights of deploy/kafka/acls, and without the right password."""

import os
import time
from collections.abc import Iterator
from pathlib import Path
from typing import NamedTuple

import pytest

from tests.deploy.kafka_names import BRIDGE, RUNNER, TOPICS
from tests.deploy.kafka_rights import rights
from tests.deploy.plant import password_of
from tests.kafka.kafka_server import KafkaServer

pytest.importorskip("confluent_kafka", reason="no confluent-kafka in this Python; install the extra kafka")

from cnctwin.kafka.kept import read_kept
from sparkplug.broker import BrokerAddress
from sparkplug.edge_node import EdgeNode
from sparkplug.host import HostApplication
from sparkplug.metric import Change, NodeId
from tests.kafka.hall_on_mqtt import SIGNALS
from tests.kafka.plant_on_kafka import Program, until
from tests.wire.mosquitto import Mosquitto

pytestmark = pytest.mark.broker
GROUP = "closed"
PARTITIONS = 2
AS = {BRIDGE: "cnctwin", RUNNER: "other"}


class Closed(NamedTuple):
    """A Kafka with the topics and rights of a plant, and how to come in."""

    server: KafkaServer
    folder: Path

    def program(self, user: str, name: str, *command: str, password: str | None = None) -> Program:
        """One of our commands, as a user of Kafka."""
        own = {
            "BOOTSTRAP": self.server.bootstrap,
            "SECURITY_PROTOCOL": "sasl_ssl",
            "USERNAME": AS[user],
            "PASSWORD": password_of(AS[user]) if password is None else password,
            "CA_FILE": str(self.server.ca_file),
            "PARTITIONS": str(PARTITIONS),
            "CREATE_TOPICS": "false",
            "SNAPSHOT_S": "0.5",
        }
        environment = {f"CNCTWIN_KAFKA_{key}": value for key, value in own.items()}
        given = ("--kafka", self.server.bootstrap, "--group", GROUP)
        return Program(
            self.folder, name, "cnctwin", *command, *given, environment=environment | {"CNCTWIN_STATE_DIR": os.devnull}
        )

    def has_states(self) -> bool:
        """Return True once a runner has saved states."""
        topic = f"cnctwin.{GROUP}.snapshots"
        return any(read_kept(self.server.client(), topic, range(PARTITIONS), timeout_s=30.0).values())


@pytest.fixture
def closed(secured_kafka: KafkaServer, tmp_path: Path) -> Iterator[Closed]:
    """Topics are made by the administrator, and once only."""
    topics = [f"cnctwin.{GROUP}.{topic}" for topic in TOPICS]
    if topics[0] not in secured_kafka.admin().list_topics(timeout=30.0).topics:
        secured_kafka.create_topics(*topics, partitions=PARTITIONS)
        for right in rights(GROUP=GROUP):
            kind = right.kind.removeprefix("--").replace("-", "_")
            secured_kafka.allow(AS[right.user], kind, right.prefix, right.operation, prefixed=True)
    yield Closed(secured_kafka, tmp_path)


def test_the_rights_of_the_script_are_enough(closed: Closed, mosquitto: Mosquitto, tmp_path: Path) -> None:
    """The rights also suffice for a bridge and a runner that start on a log with results and states in it."""
    address, shown = BrokerAddress(*mosquitto.address), dict[str, bytes]()
    edge, look = EdgeNode(address, NodeId(GROUP, "edge-mill")), HostApplication(address, "look", [], publish_state=False)
    options = ("--broker", address.url, "--processors", "mirror", "--name", "bridge-0", "--state-dir", str(tmp_path / "state"))
    look.subscribe_plain("cnc/#")
    look.start()
    edge.declare_device("mill", SIGNALS)
    edge.start()
    said = ""
    try:
        for value, is_killed in ((1.0, True), (2.0, False)):
            with (
                closed.program(BRIDGE, f"bridge-{value}", "bridge", *options) as bridge,
                closed.program(RUNNER, f"runner-{value}", "process", "mirror", "--member", "r0") as runner,
            ):

                def heard(value: float = value, bridge: Program = bridge, runner: Program = runner) -> bool:
                    assert bridge.running and runner.running, bridge.said + runner.said
                    edge.publish("mill", [Change("spindle_rpm", value, time.time_ns() // 1_000_000)])
                    shown.update((event.topic, event.payload) for event in look.poll(0.05) if event.topic)
                    return f'"value":{value}'.encode() in shown.get("cnc/mill/spindle_rpm", b"")

                until(heard, "the mirror shows the machine")
                if is_killed:
                    until(closed.has_states, "states are saved")
                    bridge.kill()
                    runner.kill()
                else:
                    assert (bridge.stop(), runner.stop()) == (0, 0), bridge.said + runner.said
                said += bridge.said + runner.said
    finally:
        edge.stop()
        look.stop()
    assert "AUTHORIZATION" not in said.upper()


@pytest.mark.parametrize("user", [BRIDGE, RUNNER])
def test_a_wrong_password_is_one_line(closed: Closed, mosquitto: Mosquitto, tmp_path: Path, user: str) -> None:
    broker = ("--broker", BrokerAddress(*mosquitto.address).url, "--processors", "mirror", "--state-dir", str(tmp_path / "state"))
    command = ("bridge", *broker) if user == BRIDGE else ("process", "mirror", "--member", "r0")
    with closed.program(user, "refused", *command, password="wrong") as program:
        assert program.wait() == 2
        lines = program.said.splitlines()
    assert len(lines) == 1 and lines[0].startswith("cnctwin: kafka: "), lines
    assert "authentication" in lines[0].lower() and "wrong" not in lines[0]
