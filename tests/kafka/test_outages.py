"""Kafka is away, or its disk is full: bridge and runner go on by themselves, and say what is lost."""

import signal
from pathlib import Path
from random import Random

import pytest

from tests.kafka.kafka_server import KafkaServer

pytest.importorskip("confluent_kafka", reason="no confluent-kafka in this Python; install the extra kafka")

from confluent_kafka import Producer

from sparkplug.host_event import EventKind
from tests.kafka.hall_on_mqtt import Hall, bridge_program, records_of, values_of
from tests.kafka.plant_on_kafka import WAIT_S_MAX, Plant, RunnerHere, processors, until
from tests.wire.mosquitto import Mosquitto

pytestmark = pytest.mark.broker
TEXT_SIZE, TEXTS = 20_000, 100
STOP_S_MAX = 30.0  # of which ten are for records that may still be acknowledged


def test_nothing_is_lost_while_the_disk_is_full(kafka: KafkaServer, mosquitto: Mosquitto, tmp_path: Path) -> None:
    kafka.create_topics("filler")
    with Plant(kafka, "full", processors("mirror")) as plant, Hall(mosquitto, "full", "mill") as hall:
        with (
            bridge_program(tmp_path, hall, plant.settings, ["mirror"], name="b0") as bridge,
            RunnerHere(plant, "r0", comes_again=True) as runner,
        ):
            hall.begin(plant, "b0")
            for number in range(50):
                hall.say("mill", spindle_rpm=float(number))
            plant.folded()
            fill(kafka)
            for number in range(50, 150):
                hall.say("mill", spindle_rpm=float(number))
            hall.until(lambda: (hall.health("mirror", "bridge_waiting") or 0) >= 100, "records wait in the bridge")
            kafka.limit_files(None)
            kafka.start()
            hall.until(lambda: len(values_of(records_of(plant, "mill"), "spindle_rpm")) >= 150, "all is in the log")
            hall.until(
                lambda: (runner.check(), b'"value":149.0' in hall.plain.get("cnc/mill/spindle_rpm", b""))[1], "and comes back"
            )
            assert hall.health("mirror", "bridge_dropped") == 0
            assert bridge.stop() == 0, bridge.said
            plant.folded()
            runner.stop()
        assert values_of(records_of(plant, "mill"), "spindle_rpm") == [float(number) for number in range(150)]
        plant.holds_as_replayed()


def test_a_bridge_ends_in_order_while_the_cluster_is_away(kafka: KafkaServer, mosquitto: Mosquitto, tmp_path: Path) -> None:
    with (
        Plant(kafka, "leaves", processors("mirror")) as plant,
        Hall(mosquitto, "leaves", "mill") as hall,
        bridge_program(tmp_path, hall, plant.settings, ["mirror"], name="b0") as bridge,
        RunnerHere(plant, "r0", comes_again=True) as runner,
    ):
        hall.begin(plant, "b0")
        hall.say("mill", spindle_rpm=1.0)
        hall.until(lambda: b'"value":1.0' in hall.plain.get("cnc/mill/spindle_rpm", b""), "results are published")
        kafka.kill()
        hall.say("mill", spindle_rpm=2.0)
        hall.until(lambda: (hall.health("mirror", "bridge_waiting") or 0) >= 1, "a record waits in the bridge")
        bridge.send(signal.SIGTERM)
        assert bridge.wait(STOP_S_MAX) == 0, bridge.said
        kafka.start()
        runner.stop()


def fill(kafka: KafkaServer) -> None:
    """Have Kafka end of a disk that is full."""
    kafka.limit_files(11_000_000)
    producer, noise = Producer(kafka.client() | {"linger.ms": 0}), Random(1)
    until(lambda: not kafka.running or _filled(producer, noise.randbytes(900_000)), "Kafka ends")
    assert kafka.wait(WAIT_S_MAX) != 0
    producer.purge()
    producer.flush(WAIT_S_MAX)


def _filled(producer: Producer, value: bytes) -> bool:
    if len(producer) < 3:
        producer.produce("filler", value)
    producer.poll(0.05)
    return False


def test_what_finds_no_room_is_counted_and_told_as_a_hole(kafka: KafkaServer, mosquitto: Mosquitto, tmp_path: Path) -> None:
    """Kafka is away for longer than the bridge has memory; then each machine's values are told again behind the hole."""
    with (
        Plant(kafka, "away", processors("mirror"), buffer_mb=1.0, transaction_s=5.0) as plant,
        Hall(mosquitto, "away", "mill", "lathe") as hall,
        bridge_program(tmp_path, hall, plant.settings, ["mirror"], name="b0") as bridge,
        RunnerHere(plant, "r0", comes_again=True) as runner,
    ):
        hall.begin(plant, "b0")
        plant.folded()
        kafka.kill()
        for number in range(TEXTS):
            hall.say("mill", program=f"{number:05}" * (TEXT_SIZE // 5), spindle_rpm=float(number))
        hall.until(lambda: (hall.health("mirror", "bridge_dropped") or 0) > 0, "the bridge's memory is full")
        dropped_before = hall.health("mirror", "bridge_dropped")
        hall.say("lathe", program="B" * TEXT_SIZE, spindle_load_pct=77.0)  # and nothing of it changes for long
        hall.until(lambda: hall.health("mirror", "bridge_dropped") > dropped_before, "that finds no room either")
        assert TEXT_SIZE * (TEXTS - hall.health("mirror", "bridge_dropped")) <= 1_048_576, "a MiB is full"
        kafka.start()
        hall.until(lambda: b'"value":77.0' in hall.plain.get("cnc/lathe/spindle_load_pct", b""), "what holds is told again")
        newest = f'"value":{TEXTS - 1}.0'.encode()
        hall.until(lambda: newest in hall.plain.get("cnc/mill/spindle_rpm", b""), "of the other machine too")
        hall.say("mill", spindle_rpm=500.0)
        hall.until(lambda: b'"value":500.0' in hall.plain["cnc/mill/spindle_rpm"], "and all goes on")
        assert bridge.stop() == 0, bridge.said
        plant.folded()
        runner.stop()
        for machine in hall.machines:
            kinds = [record.event.kind for record in records_of(plant, machine) if record.event is not None]
            hole = kinds.index(EventKind.HOLE)
            assert kinds[hole + 1] is EventKind.BIRTH and kinds.count(EventKind.HOLE) == 1, kinds
        said = values_of(records_of(plant, "mill"), "spindle_rpm")
        assert said[-1] == 500.0 and said[:-1] == [float(number) for number in range(len(said) - 1)]
        assert 5 < len(said) - 1 <= 1_048_576 // TEXT_SIZE
        plant.holds_as_replayed()
