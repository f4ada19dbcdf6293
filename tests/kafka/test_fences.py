"""A transaction that is open at the end of a log: that of a writer that is gone is ended, that of a member that lives is not."""

import pytest

from tests.kafka.kafka_server import KafkaServer

pytest.importorskip("confluent_kafka", reason="no confluent-kafka in this Python; install the extra kafka")

from confluent_kafka import Consumer, KafkaException, Producer

from cnctwin.kafka.assigned import Assigned
from cnctwin.kafka.kept import fence_open
from cnctwin.kafka.transaction import producer_of, written_by
from tests.kafka.gated import alone
from tests.kafka.plant_on_kafka import WAIT_S_MAX, Plant, until
from tests.processors.describing import DESCRIBING

PLACES = [0, 1, 2, 3]


def opened(plant: Plant, name: str, number: int, *, committed: bool = False) -> Producer:
    """A writer of results with a transaction that is open, or was ended in order."""
    producer = producer_of(plant.settings, name)
    producer.init_transactions(WAIT_S_MAX)
    producer.begin_transaction()
    producer.produce(plant.topics.results, b"value", name.encode(), number, headers=written_by(name))
    assert producer.flush(WAIT_S_MAX) == 0
    if committed:
        producer.commit_transaction(WAIT_S_MAX)
    return producer


def fenced(plant: Plant) -> set[str]:
    """The writers that are fenced, where nothing comes of it."""
    found: list[str] = []
    fence_open(plant.settings.client(), plant.topics.results, PLACES, timeout_s=WAIT_S_MAX, fence=found.append)
    assert len(found) == len(set(found)), "each once"
    return set(found)


def keys(plant: Plant) -> list[bytes | str | None]:
    """The keys of the results that are committed and can be seen."""
    return sorted(message.key() or b"" for of in plant.read(plant.topics.results).values() for message in of)  # type: ignore[type-var]


def test_who_has_a_transaction_open_is_found(kafka: KafkaServer) -> None:
    with Plant(kafka, "open", alone(DESCRIBING), transaction_s=300.0) as plant:
        assert fenced(plant) == set(), "the topic is empty"
        before = opened(plant, "cnctwin.open.describing.before", 0, committed=True)
        assert fenced(plant) == set(), "what is there is committed"
        first, second = (opened(plant, f"cnctwin.open.describing.{name}", at) for name, at in (("first", 0), ("second", 2)))
        behind = opened(plant, "cnctwin.open.describing.behind", 2, committed=True)
        found = fenced(plant)
        assert {"cnctwin.open.describing.first", "cnctwin.open.describing.second"} <= found
        assert "cnctwin.open.describing.before" not in found
        for producer in (first, second):
            producer.abort_transaction(WAIT_S_MAX)
        assert fenced(plant) == set()
        del before, behind


def test_the_transaction_of_a_runner_that_is_gone_ends_and_that_of_one_that_lives_does_not(kafka: KafkaServer) -> None:
    with Plant(kafka, "fences", alone(DESCRIBING), transaction_s=300.0) as plant:
        gone, alive = f"{plant.reader}.gone", f"{plant.reader}.alive"
        member = {"group.id": plant.reader, "group.instance.id": "alive", "session.timeout.ms": 6000}
        consumer = Consumer(kafka.client() | member)
        try:
            consumer.subscribe([plant.topics.readings])
            until(lambda: (consumer.consume(1, 0.1), bool(consumer.assignment()))[1], "the member is in")
            writers = {gone: opened(plant, gone, 0), alive: opened(plant, alive, 1)}
            Assigned(plant.settings, plant.topics, plant.pairs).restore([(plant.topics.readings, number) for number in PLACES])
            assert keys(plant) == []
            with pytest.raises(KafkaException, match=r"(?i)fenced|epoch"):
                writers[gone].commit_transaction(WAIT_S_MAX)
            writers[alive].commit_transaction(WAIT_S_MAX)
            assert keys(plant) == [alive.encode()]
        finally:
            consumer.close()
