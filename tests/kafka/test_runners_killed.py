"""Runners that stop, die and come: results and states are those of a pure replay of the log, bit for bit."""

from pathlib import Path

import pytest

from tests.kafka.kafka_server import KafkaServer

pytest.importorskip("confluent_kafka", reason="no confluent-kafka in this Python; install the extra kafka")

from tests.kafka.dying_runner import PLACES
from tests.kafka.plant_on_kafka import Plant, Program, RunnerHere, environment_of, processors, runner_program, until

NAMES = ("mirror", "thermal")


def test_one_runner_and_its_successor_tell_what_a_replay_tells(kafka: KafkaServer, tmp_path: Path) -> None:
    with Plant(kafka, "one", processors(*NAMES)) as plant:
        plant.play(20)
        with runner_program(tmp_path, plant, "r0") as first:
            plant.folded()
            plant.play(5)
            until(lambda: plant.committed() > 0, "results are committed")
            assert first.stop() == 0, first.said
        plant.play(10)
        with runner_program(tmp_path, plant, "r0") as second:
            plant.folded()
            assert second.stop() == 0, second.said
        plant.holds_as_replayed()


@pytest.mark.parametrize("place", PLACES)
@pytest.mark.parametrize("heir", ["r0", "r1"])
def test_killed_anywhere_in_a_transaction(kafka: KafkaServer, tmp_path: Path, place: str, heir: str) -> None:
    """Its own successor ends what it left open; another member does so once the group has given it up."""
    with Plant(kafka, f"dead.{place.split()[0]}.{heir}", processors(*NAMES)) as plant:
        plant.play(10)
        command = ("tests.kafka.dying_runner", plant.topics.group, "r0", kafka.bootstrap, place, "3", *NAMES)
        with Program(tmp_path, "dying", *command, environment=environment_of(plant.settings)) as dying:
            until(lambda: plant.committed() > 0, "the first transaction is committed")
            plant.play(5)
            while dying.running:  # each turn is a transaction
                plant.play(1)
            assert dying.wait() == -9, dying.said
        open_ = place != "committed"
        uncommitted = sum(map(len, plant.read(plant.topics.results, committed=False).values()))
        assert (uncommitted > plant.committed()) == open_
        with RunnerHere(plant, heir) as runner:
            plant.play(5)
            plant.folded()
            runner.check()
        plant.holds_as_replayed()
