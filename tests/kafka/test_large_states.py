"""A state that is larger than the cluster takes: the runner says so, seldom, and goes on once there is room."""

from random import Random

import pytest

from tests.kafka.kafka_server import KafkaServer

pytest.importorskip("confluent_kafka", reason="no confluent-kafka in this Python; install the extra kafka")

from confluent_kafka.admin import AlterConfigOpType, ConfigEntry, ConfigResource, ResourceType

from cnctwin.kafka import runner as runner_module
from cnctwin.kafka.client_log import LOG, Seldom
from cnctwin.kafka.kept import read_kept
from processors.partition.seat import Seat
from tests.kafka.gated import alone
from tests.kafka.plant_on_kafka import WAIT_S_MAX, Plant, RunnerHere, until
from tests.processors.describing import DESCRIBING

LARGE, LARGE_BYTES = "m-0", 3_000_000
FILLING = bytes(Random(1).choices(b" \t\r\n", k=LARGE_BYTES))
"""Space behind the JSON of a state, which means nothing and does not grow small when it is compressed."""
ATTEMPTS = 3


def grown(monkeypatch: pytest.MonkeyPatch) -> None:
    """Have the states of one machine be large."""
    state_of = Seat.state_of
    monkeypatch.setattr(Seat, "state_of", lambda seat, unit: state_of(seat, unit) + (FILLING if unit == LARGE else b""))


def take_up_to(kafka: KafkaServer, topic: str, size: int) -> None:
    """Have a topic take messages of this size."""
    entry = ConfigEntry("max.message.bytes", str(size), incremental_operation=AlterConfigOpType.SET)
    admin = kafka.admin()
    for future in admin.incremental_alter_configs(
        [ConfigResource(ResourceType.TOPIC, topic, incremental_configs=[entry])]
    ).values():
        future.result(WAIT_S_MAX)


def test_a_state_that_is_too_large_is_named_once_and_saved_when_there_is_room(
    kafka: KafkaServer, monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture
) -> None:
    grown(monkeypatch)
    monkeypatch.setattr(LOG, "filters", [Seldom()])
    monkeypatch.setattr(runner_module, "REFUSED_S", 0.2)
    with Plant(kafka, "large", alone(DESCRIBING), machines=4) as plant:
        plant.play(3)
        with RunnerHere(plant, "r0") as running:

            def refused() -> bool:
                running.check()
                return running.runner._health.faults >= ATTEMPTS

            until(refused, "the state is refused again and again")
            told = [line for line in caplog.messages if f"{LARGE} has " in line]
            assert len(told) == 1, "once a minute"
            key = f"{DESCRIBING.name}/{LARGE}"
            assert f"{key} has 3,000," in told[0] and f"raise max.message.bytes of {plant.topics.snapshots}" in told[0]
            assert f"{key} has " in running.runner._health.fault
            take_up_to(kafka, plant.topics.snapshots, 2 * LARGE_BYTES)
            plant.folded()
            running.stop()
        plant.holds_as_replayed()
        kept = read_kept(kafka.client(), plant.topics.snapshots, range(plant.settings.partitions), timeout_s=WAIT_S_MAX)
        assert sum(len(value) > LARGE_BYTES for of in kept.values() for value in of.values()) == 1


def test_a_state_for_which_the_runner_has_no_room_is_named(
    kafka: KafkaServer, monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture
) -> None:
    grown(monkeypatch)
    monkeypatch.setattr(LOG, "filters", [Seldom()])
    with Plant(kafka, "roomless", alone(DESCRIBING), machines=4, buffer_mb=4.0) as plant:
        plant.play(1)
        with RunnerHere(plant, "r0") as running:
            until(lambda: (running.check(), f"{LARGE} has 3,000," in running.runner._health.fault)[1], "it is named")
            running.stop()
        assert any(f"{LARGE} has 3,000," in line and "raise buffer_mb" in line for line in caplog.messages)
