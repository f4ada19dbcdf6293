"""Two runners with alerts: the courier is where the alerts are, alone, and goes on elsewhere when its runner dies or leaves."""

import json
import random
import re
import signal
import time
from collections import Counter
from collections.abc import Iterator
from pathlib import Path

import pytest

from tests.kafka.kafka_server import KafkaServer

pytest.importorskip("confluent_kafka", reason="no confluent-kafka in this Python; install the extra kafka")

from confluent_kafka import ConsumerGroupState, KafkaException

from cnctwin.kafka.homes import home_of
from processors.config import ALL
from sparkplug.datatype import DataType
from sparkplug.metric import MetricSpec
from tests.kafka.hall_on_mqtt import Hall, bridge_program
from tests.kafka.plant_on_kafka import PASSING, WAIT_S_MAX, Plant, Program, environment_of, processors, until
from tests.processors.alerts.courier.alert_shop import VIBRATION
from tests.processors.alerts.courier.office import OUTBOX, STATE, Office
from tests.processors.alerts.courier.receiving_server import Answer, ReceivingServer
from tests.wire.mosquitto import Mosquitto

pytestmark = pytest.mark.broker
GROUP = "told"
SIGNALS = (MetricSpec(VIBRATION, DataType.BOOLEAN, value=False),)
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
CAME = re.compile(r"New client connected from \S+ as host-courier-told-(\w+) ")
WENT = re.compile(r"Client host-courier-told-(\w+) (?:\[\S+ )?(?:disconnected|closed its connection|already connected)")


class Courier:
    """The runners with alerts, and which of them has the courier, by what the MQTT broker says of its connections."""

    def __init__(self, folder: Path, plant: Plant, hall: Hall, config: Path, mosquitto: Mosquitto) -> None:
        self._folder, self._plant, self._hall, self._config, self._mosquitto = folder, plant, hall, config, mosquitto
        self.runners: dict[str, Program] = {}

    def start(self, member: str) -> None:
        own = ["--group", GROUP, "--kafka", self._plant.kafka.bootstrap, "--member", member]
        command = ["process", "alerts", *own, "--broker", self._hall.address.url, "--config", str(self._config)]
        self.runners[member] = Program(
            self._folder, member, "cnctwin", *command, environment=environment_of(self._plant.settings)
        )

    def share(self) -> None:
        """Wait until all runners that live have partitions of the alerts, and one of them the courier."""
        admin, group = self._plant.kafka.admin(), self._plant.topics.runners(["alerts"])
        living = {member for member, runner in self.runners.items() if runner.running}

        def shared() -> bool:
            try:
                described = admin.describe_consumer_groups([group])[group].result(WAIT_S_MAX)
            except KafkaException as error:  # of a cluster that has just begun
                assert error.args[0].retriable() or error.args[0].code() in PASSING, error
                return False
            having = [one.group_instance_id for one in described.members if one.assignment.topic_partitions]
            return set(having) == living and described.state is ConsumerGroupState.STABLE

        until(shared, f"{living} share the alerts")
        until(lambda: self.holder in living, "one of them has the courier")

    def connected(self) -> Iterator[frozenset[str]]:
        """Yield the members whose couriers are connected, after each change."""
        members: frozenset[str] = frozenset()
        for line in self._mosquitto.log.splitlines():
            if found := CAME.search(line):
                members |= {found[1]}
                yield members
            elif found := WENT.search(line):
                members -= {found[1]}
                yield members

    @property
    def holders(self) -> frozenset[str]:
        """The members that have a courier."""
        *_, last = [frozenset[str](), *self.connected()]
        return last

    @property
    def holder(self) -> str:
        """The member that has the courier; empty where nobody has."""
        return next(iter(self.holders), "")

    def awaited(self, *, not_at: str = "") -> str:
        """Return who has the courier, once somebody else than this one has it."""
        until(lambda: self.holder not in ("", not_at), f"a courier elsewhere than at {not_at or 'nobody'}")
        return self.holder


def test_notifications_go_on_when_the_runner_of_the_alerts_dies_or_leaves(
    kafka: KafkaServer, mosquitto: Mosquitto, tmp_path: Path
) -> None:
    chance, names, config = random.Random(1), ("mirror", "alerts"), tmp_path / "alerts.toml"
    with ReceivingServer() as server, Plant(kafka, GROUP, processors(*names)) as plant:
        server.usual = Answer(wait_s=0.2)
        config.write_text(TABLE.format(url=server.url))
        with Hall(mosquitto, GROUP, "mill", signals=SIGNALS) as hall:
            office = Office(hall.address)
            courier = Courier(tmp_path, plant, hall, config, mosquitto)
            outbox: dict[str, bytes] = {}

            def alarm_until(more: int) -> None:
                """The alarm comes and goes until so many more notifications have arrived."""
                wanted, value = len(server.ids()) + more, False

                def arrived() -> bool:
                    nonlocal value
                    value = not value
                    hall.say("mill", **{VIBRATION: value})
                    time.sleep(chance.uniform(0.3, 1.2))
                    outbox.update(office.outbox())
                    return len(server.ids()) >= wanted

                until(arrived, f"{more} more notifications")
                hall.say("mill", **{VIBRATION: False})

            try:
                with bridge_program(tmp_path, hall, plant.settings, names, "--config", str(config), name="b0") as bridge:
                    hall.begin(plant, "b0")
                    for member in ("r0", "r1"):
                        courier.start(member)
                    courier.share()
                    first = courier.holder
                    alarm_until(2)
                    assert courier.holder == first
                    courier.runners[first].kill()
                    second = courier.awaited(not_at=first)
                    alarm_until(2)
                    courier.start(first)
                    courier.share()
                    alarm_until(1)
                    courier.runners[holder := courier.holder].stop()
                    courier.awaited(not_at=holder)
                    alarm_until(2)
                    fates = lambda: {topic.removeprefix(OUTBOX) for topic in outbox} <= set(office.deliveries)  # noqa: E731
                    until(fates, "the fates of all notifications")
                    assert bridge.running, bridge.said
                shown = json.loads(office.topics[STATE])
                last = courier.holder
                assert courier.runners[last].stop() == 0, courier.runners[last].said
                until(lambda: courier.holder == "", "the courier is gone with its runner")
            finally:
                office.close()
                for runner in courier.runners.values():
                    if runner.running:
                        runner.kill()
    assert {first, second} == {"r0", "r1"}
    assert max(map(len, courier.connected())) == 1, "one courier at a time"
    assert "already connected" not in mosquitto.log
    arrived = server.ids()
    assert [key for key, count in arrived.items() if count > 1] == []
    outcomes = {key: {one["outcome"] for one in said} for key, said in office.deliveries.items()}
    missing = [key for topic in outbox if (key := topic.removeprefix(OUTBOX)) not in arrived]
    assert [key for key in missing if outcomes[key] != {"failed"}] == []
    said = Counter(entry for payload in outbox.values() for entry in json.loads(payload)["says"])
    assert [entry for entry, count in said.items() if count > 1] == []
    assert any(alert["labels"]["machine"] == "mill" for alert in shown["alerts"]), "no partition without machines tells of none"


def test_the_courier_outlasts_kafka_and_leaves_a_runner_that_hung(
    kafka: KafkaServer, mosquitto: Mosquitto, tmp_path: Path
) -> None:
    config, outage_s = tmp_path / "alerts.toml", 4.0
    with ReceivingServer() as server, Plant(kafka, GROUP, processors("mirror", "alerts")) as plant:
        config.write_text(TABLE.format(url=server.url))
        with Hall(mosquitto, GROUP) as hall:
            office = Office(hall.address)
            courier = Courier(tmp_path, plant, hall, config, mosquitto)
            try:
                courier.start("r0")
                assert courier.awaited() == "r0"
                kafka.kill()
                began_s = time.monotonic()
                until(lambda: time.monotonic() - began_s > outage_s, "the runner has lost its partitions")
                office.put("meanwhile")
                until(lambda: office.outcome("meanwhile") == "delivered", "a delivery without Kafka")
                kafka.start()
                courier.start("r1")
                courier.share()
                hung = courier.holder
                courier.runners[hung].send(signal.SIGSTOP)
                (other,) = {"r0", "r1"} - {hung}
                until(lambda: other in courier.holders, "the other has it as well")
                office.put("hung")
                until(lambda: office.outcome("hung") == "delivered", "a delivery by the other")
                courier.runners[hung].send(signal.SIGCONT)
                courier.share()
                until(lambda: len(courier.holders) == 1, "one of them lets go")
                office.put("after")
                until(lambda: office.outcome("after") == "delivered", "a delivery by the one that is left")
            finally:
                office.close()
                for runner in courier.runners.values():
                    if runner.running:
                        runner.kill()
    assert server.ids() == {"meanwhile": 1, "hung": 1, "after": 1}


def test_a_cell_is_at_home_where_its_records_go(kafka: KafkaServer) -> None:
    with Plant(kafka, "homes", processors("mirror")) as plant:
        plant.machines = [ALL, *(f"cell-{number}" for number in range(20)), "fräse", "x" * 300]
        plant.play(1)
        for number, messages in plant.read(plant.topics.readings).items():
            keys = {(message.key() or b"").decode() for message in messages} - {""}
            assert {home_of(key, plant.settings.partitions) for key in keys} <= {number}
        assert set(plant.lags()) == set(range(plant.settings.partitions))
