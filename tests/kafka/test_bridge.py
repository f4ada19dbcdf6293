"""From an edge on MQTT through Kafka and back: what a host sees is what the log holds, whoever is killed."""

from pathlib import Path

import pytest

from tests.kafka.kafka_server import KafkaServer

pytest.importorskip("confluent_kafka", reason="no confluent-kafka in this Python; install the extra kafka")

from sparkplug.host_event import EventKind
from tests.kafka.hall_on_mqtt import Hall, bridge_program, newest_results, records_of, values_of
from tests.kafka.plant_on_kafka import Plant, RunnerHere, processors, runner_program
from tests.wire.mosquitto import Mosquitto

pytestmark = pytest.mark.broker
NAMES = ("mirror", "thermal")


def cut(hall: Hall, machine: str, begin: int, end: int) -> None:
    """Have a machine say its numbers."""
    for number in range(begin, end):
        hall.say(machine, spindle_rpm=float(number), spindle_load_pct=20.0 + number)


def is_told(hall: Hall, plant: Plant, machine: str) -> bool:
    """Return True once the host sees the newest results of a machine, and nothing else."""
    newest, twin = newest_results(plant, "thermal", machine), hall.twin("thermal", machine)
    return bool(newest) and twin is not None and {name: reading.value for name, reading in twin.items()} == newest


def test_results_come_back_and_a_killed_bridge_is_born_again_with_the_newest(
    kafka: KafkaServer, mosquitto: Mosquitto, tmp_path: Path
) -> None:
    plant = Plant(kafka, "hall", processors(*NAMES))
    bridge = lambda: bridge_program(tmp_path, hall, plant.settings, NAMES, name="b0")  # noqa: E731
    with plant, Hall(mosquitto, "hall", "mill") as hall:
        with bridge() as first:
            hall.until(lambda: hall.life("thermal") is not None, "the bridge has given birth to the processors")
            hall.begin(plant, "b0")
            with runner_program(tmp_path, plant, "r0") as runner:
                cut(hall, "mill", 0, 100)
                hall.until(lambda: values_of(records_of(plant, "mill"), "spindle_rpm")[-1:] == [99.0], "all is in the log")
                hall.until(lambda: b'"value":99.0' in hall.plain.get("cnc/mill/spindle_rpm", b""), "the mirror shows it")
                hall.until(lambda: is_told(hall, plant, "mill"), "the twin's figures are those of the log")
                assert runner.stop() == 0, runner.said
            life = hall.life("thermal")
            cut(hall, "mill", 100, 200)
            hall.until(lambda: values_of(records_of(plant, "mill"), "spindle_rpm")[-1:] == [199.0], "the rest is in the log")
            first.kill()
        hall.until(lambda: hall.life("thermal") is None, "its will is told")
        before = plant.committed()
        with RunnerHere(plant, "r0") as again:  # results that nobody publishes
            plant.folded()
            again.stop()
        assert plant.committed() > before
        hall.events.clear()
        with bridge() as second:
            hall.until(lambda: hall.life("thermal") not in {None, life}, "the bridge is there again")
            hall.until(lambda: is_told(hall, plant, "mill"), "the twin's figures are those of the log")
            hall.until(lambda: b'"value":199.0' in hall.plain["cnc/mill/spindle_rpm"], "the mirror shows it")
            assert second.running, second.said
            assert second.stop() == 0, second.said
        hall.plain.clear()
        with bridge_program(tmp_path, hall, plant.settings, NAMES, name="b1") as renamed:
            hall.until(lambda: is_told(hall, plant, "mill"), "one of another name goes on")
            assert renamed.stop() == 0, renamed.said
        assert "this bridge is new" in renamed.said and "cnc/mill/spindle_rpm" not in hall.plain, "nothing is said once more"
        numbers = values_of(records_of(plant, "mill"), "spindle_rpm")
        assert numbers == [float(number) for number in range(200)], "each once, in order"
        births = [event for event in hall.events if event.kind is EventKind.BIRTH and event.node.node == "twin-thermal"]
        assert births


def test_two_bridges_share_a_group_by_their_nodes(kafka: KafkaServer, mosquitto: Mosquitto, tmp_path: Path) -> None:
    machines = ("mill", "lathe")
    with Plant(kafka, "shared", processors("mirror")) as plant, Hall(mosquitto, "shared", *machines) as hall:
        mills = bridge_program(tmp_path, hall, plant.settings, ["mirror"], "--nodes", "edge-mill*", name="mills")
        others = ("--nodes", "edge-lathe,edge-saw", "--results", "none")
        with mills, bridge_program(tmp_path, hall, plant.settings, ["mirror"], *others, name="lathes") as lathes:
            hall.begin(plant, "mills", "lathes")
            for machine in machines:
                cut(hall, machine, 0, 50)
            with RunnerHere(plant, "r0") as runner:
                shown = lambda machine: b'"value":49.0' in hall.plain.get(f"cnc/{machine}/spindle_rpm", b"")  # noqa: E731
                hall.until(lambda: all(map(shown, machines)), "the mirror shows both")
                runner.stop()
            assert mills.running and lathes.running
            for machine, writer in zip(machines, ("mills", "lathes"), strict=True):
                records = records_of(plant, machine)
                assert {record.writer for record in records} == {writer}
                assert values_of(records, "spindle_rpm") == [float(number) for number in range(50)]
