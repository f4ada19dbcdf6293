"""A runner on a real Kafka: slow units, poison, an upgrade, and a topic of states that is compacted under it."""

import re
import time
from threading import Event
from typing import Any

import pytest

from tests.kafka.kafka_server import KafkaServer

pytest.importorskip("confluent_kafka", reason="no confluent-kafka in this Python; install the extra kafka")

from confluent_kafka import Producer
from confluent_kafka.admin import AlterConfigOpType, ConfigEntry, ConfigResource, ResourceType

from cnctwin.kafka.groups import refuse_overlap
from cnctwin.kafka.kept import read_kept
from processors.errors import ConfigurationError, SnapshotError
from tests.kafka.gated import UNBEARABLE_RPM, alone, delicate, gated, of_version
from tests.kafka.plant_on_kafka import WAIT_S_MAX, Plant, RunnerHere, processors, until
from tests.processors.streams import data


def test_a_slow_unit_holds_up_its_own_partition_only(kafka: KafkaServer) -> None:
    """Its step takes longer than the group waits for a sign of life; the member stays, and the others are folded meanwhile."""
    gate, slow = Event(), "m-0"
    with Plant(kafka, "slow", alone(gated(gate, slow, 1.5)), session_s=1.0) as plant:
        plant.play(4)
        home = next(number for number, of in plant.read(plant.topics.readings).items() if any(m.key() == b"m-0" for m in of))
        with RunnerHere(plant, "r0") as runner:
            try:
                until(lambda: set(plant.lags()) <= {home}, "the other partitions are folded")
                began_s = time.monotonic()
                until(lambda: time.monotonic() - began_s > 2 * plant.settings.session_s, "the group would have lost patience")
                plant.play(1, machines=[one for one in plant.machines if one != slow])
                until(lambda: set(plant.lags()) == {home}, "the other partitions go on")
                assert plant.lags()[home] > 0
            finally:
                gate.set()
            plant.folded()
            assert runner.runner._health.rebalances == 1, "it was given its partitions once, and nobody took them"
            runner.stop()
        plant.holds_as_replayed()


def headers(**told: bytes | None) -> list[tuple[str, Any]]:
    """The headers of a record of a machine, with some of them in place of the right ones."""
    right: dict[str, bytes | None] = {
        "version": b"1",
        "kind": b"data",
        "writer": b"w",
        "at": b"1 2 3 4",
        "node": b"cnc/edge",
        "device": b"m-0",
    }
    return list((right | told).items())


POISON: dict[str, tuple[list[tuple[str, Any]] | None, bytes | None, str]] = {
    "no record": (None, b"hello", "record of version"),
    "version 99": (headers(version=b"99"), b"", "record of version b'99'"),
    "garbage": (headers(), b"\xff\xfe garbage", "Error"),
    "no time": (headers(at=None), b"", "Error"),
    "no such time": (headers(at=b"9" * 400 + b" 0 0 0"), b"", "no such time"),
    "no value": (headers(node=None), None, "Error"),
    "another kind": (headers(kind=b"gossip"), b"", "KeyError"),
}


def test_poison_becomes_a_dead_letter_and_the_partition_goes_on(kafka: KafkaServer) -> None:
    with Plant(kafka, "poison", alone(delicate()), machines=2) as plant:
        plant.play(3)
        stranger = Producer(kafka.client())
        for of, value, _ in POISON.values():
            for number in range(plant.settings.partitions):
                stranger.produce(plant.topics.readings, value, b"\xff key", number, headers=of)
        assert stranger.flush(WAIT_S_MAX) == 0
        plant.say(data(3.0, device="m-0", spindle_rpm=UNBEARABLE_RPM), 3.0)
        plant.play(3)
        with RunnerHere(plant, "r0") as runner:
            plant.folded()
            runner.stop()
        plant.holds_as_replayed()
        letters = plant.read(plant.topics.deadletters)
        reasons = {number: [dict(letter.headers() or ()).get("error") for letter in of] for number, of in letters.items()}
        for number in range(plant.settings.partitions):
            told = [reason.decode() for reason in reasons[number] if isinstance(reason, bytes)]
            assert len(told) == len(POISON)
            for reason, (_, _, wanted) in zip(told, POISON.values(), strict=True):
                assert f"{plant.topics.readings}-{number}@" in reason and wanted in reason
        by_step = [letter for of in letters.values() for letter in of if letter.key() == b"m-0"]
        assert len(by_step) == 1 and b"thirteen is unbearable" in (by_step[0].value() or b"")


def test_garbage_among_the_states_is_left_alone_or_named(kafka: KafkaServer) -> None:
    with Plant(kafka, "garbage", alone(delicate()), machines=4) as plant:
        plant.play(2)
        with RunnerHere(plant, "r0") as runner:
            plant.folded()
            runner.stop()
        stranger = Producer(kafka.client())
        for key in (None, b"\xff\xfe", b"hello", b"another/m-0", b"~", b"~elsewhere/x"):
            for value in (b"", b"\xff garbage", None):
                stranger.produce(plant.topics.snapshots, value, key, 2)
        assert stranger.flush(WAIT_S_MAX) == 0
        with RunnerHere(plant, "r0") as runner:
            plant.play(2)
            plant.folded()
            assert runner.runner._health.fault == ""
            runner.stop()
        plant.holds_as_replayed(states=False)
        key = f"~marker/{plant.topics.readings}/stranger"
        stranger.produce(plant.topics.snapshots, b"\xff garbage", key.encode(), 2)
        assert stranger.flush(WAIT_S_MAX) == 0
        named = (
            rf"^{re.escape(plant.topics.snapshots)}, partition 2, key {re.escape(key)}: .*; write a null value in that partition"
        )
        with pytest.raises(SnapshotError, match=named), RunnerHere(plant, "r0") as runner:
            until(lambda: runner.check() is not None, "it ends")
        stranger.produce(plant.topics.snapshots, None, key.encode(), 2)
        assert stranger.flush(WAIT_S_MAX) == 0
        with RunnerHere(plant, "r0") as runner:
            plant.play(1)
            plant.folded()
            runner.stop()
        plant.holds_as_replayed(states=False)


def test_a_log_that_is_shorter_than_the_states_is_named(kafka: KafkaServer) -> None:
    """A topic that was created again, or lost its end, would have new records counted as folded already."""
    with Plant(kafka, "shorter", alone(delicate()), machines=4) as plant:
        plant.play(2)
        key = f"~marker/{plant.topics.readings}/{plant.reader}"
        name = plant.pairs[0][0].name
        stranger = Producer(kafka.client())
        stranger.produce(plant.topics.snapshots, f'{{"processors":{{"{name}":[900,900]}}}}'.encode(), key.encode(), 1)
        assert stranger.flush(WAIT_S_MAX) == 0
        named = rf"^{re.escape(plant.topics.readings)}, partition 1 ends at \d+, and the states are of 900: .*{re.escape(key)}"
        with pytest.raises(SnapshotError, match=named), RunnerHere(plant, "r0") as runner:
            until(lambda: runner.check() is not None, "it ends")
        stranger.produce(plant.topics.snapshots, None, key.encode(), 1)
        assert stranger.flush(WAIT_S_MAX) == 0
        with RunnerHere(plant, "r0") as runner:
            plant.folded()
            runner.stop()
        plant.holds_as_replayed(states=False)


def test_a_processor_that_runs_in_another_set_is_not_run_twice(kafka: KafkaServer) -> None:
    with Plant(kafka, "overlap", processors("mirror", "thermal"), session_s=1.0) as plant:
        ask = lambda *names: refuse_overlap(plant.settings, plant.topics, names, Event())  # noqa: E731
        with RunnerHere(plant, "r0") as runner:
            until(lambda: runner.partitions > 0, "it has its partitions")
            with pytest.raises(ConfigurationError, match=rf"thermal run in the consumer group {re.escape(plant.reader)} as well"):
                ask("gap", "thermal")
            ask("gap")
            ask("mirror", "thermal")
            runner.stop()
        ask("gap", "thermal")  # once its session has run out


def test_an_upgraded_processor_is_rebuilt_from_the_log_and_tells_nothing_twice(kafka: KafkaServer) -> None:
    with Plant(kafka, "upgrade", alone(of_version(1))) as plant:
        plant.play(5)
        with RunnerHere(plant, "r0") as runner:
            plant.folded()
            runner.stop()
        before = plant.committed()
        plant.pairs = alone(of_version(2))
        with RunnerHere(plant, "r0") as runner:
            until(lambda: runner.partitions == plant.settings.partitions, "the partitions are assigned")
            until(lambda: "rebuilt from what the log still holds" in runner.runner._health.fault, "the states are refused")
            plant.play(5)
            plant.folded()
            runner.stop()
        assert plant.committed() > before
        plant.holds_as_replayed()
        kept = read_kept(kafka.client(), plant.topics.snapshots, range(plant.settings.partitions), timeout_s=WAIT_S_MAX)
        states = [value for of in kept.values() for key, value in of.items() if key.startswith("upgraded/")]
        assert len(states) == len(plant.machines) and all(b'"version":2' in state for state in states)


def test_states_are_whole_after_their_topic_was_compacted(kafka: KafkaServer) -> None:
    with Plant(kafka, "compacted", processors("mirror"), snapshot_s=0.1) as plant:
        tiny = {
            "segment.ms": "100",
            "min.cleanable.dirty.ratio": "0.01",
            "max.compaction.lag.ms": "100",
            "delete.retention.ms": "0",
        }
        entries = [ConfigEntry(name, value, incremental_operation=AlterConfigOpType.SET) for name, value in tiny.items()]
        resource = ConfigResource(ResourceType.TOPIC, plant.topics.snapshots, incremental_configs=entries)
        admin = kafka.admin()
        for future in admin.incremental_alter_configs([resource]).values():
            future.result(WAIT_S_MAX)
        with RunnerHere(plant, "r0") as runner:

            def compacted() -> bool:
                """Return True if most of what was written to a partition is gone, in each of them."""
                plant.play(1)
                found = plant.read(plant.topics.snapshots)
                return all(of and len(of) < (of[-1].offset() or 0) // 2 for of in found.values())

            until(compacted, "the cleaner has been there")
            runner.stop()
        with RunnerHere(plant, "r1") as runner:
            plant.play(2)
            plant.folded()
            runner.stop()
        plant.holds_as_replayed()
