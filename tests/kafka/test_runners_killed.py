"""Runners that stop, die and come: results and states are those of a pure replay of the log, bit for bit."""

from collections.abc import Callable
from contextlib import ExitStack
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


@pytest.mark.parametrize(("place", "heir"), [*((place, "r0") for place in PLACES), ("produced", "r1")])
def test_killed_anywhere_in_a_transaction(kafka: KafkaServer, tmp_path: Path, place: str, heir: str) -> None:
    """Its own successor ends what it left open; another member does so once the group has given it up."""
    with Plant(kafka, f"dead.{place.split(maxsplit=1)[0]}.{heir}", processors(*NAMES)) as plant:
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


def test_runners_come_and_go_under_load(kafka: KafkaServer) -> None:
    """One, two, four, and back to one: each machine's results are whole, in order and told once."""
    with Plant(kafka, "scaled", processors("mirror"), session_s=1.0) as plant, ExitStack() as stack:
        plant.play(5)
        runners = [stack.enter_context(RunnerHere(plant, "r0"))]
        for number in (2, 4):
            while len(runners) < number:
                runners.append(stack.enter_context(RunnerHere(plant, f"r{len(runners)}")))
            share = plant.settings.partitions // number
            _load_until(plant, lambda share=share: all(one.partitions == share for one in runners))  # type: ignore[misc]
        while len(runners) > 1:
            runners.pop().stop()
        _load_until(plant, lambda: runners[0].partitions == plant.settings.partitions)
        plant.folded()
        runners[0].stop()
        plant.holds_as_replayed()


def _load_until(plant: Plant, condition: Callable[[], bool]) -> None:
    def loaded() -> bool:
        plant.play(1)
        return condition()

    until(loaded, "the partitions are shared out")
    plant.play(3)
