"""The rights of deploy/kafka/acls on a real Kafka: what its authorizer makes of them, and the work done with no more."""

import pytest

from tests.deploy.kafka_names import BRIDGE, MAY_READ, MAY_WRITE, RUNNER, TOPICS
from tests.deploy.kafka_rights import rights
from tests.kafka.kafka_server import KafkaServer

pytest.importorskip("confluent_kafka", reason="no confluent-kafka in this Python; install the extra kafka")

from confluent_kafka import Consumer, KafkaException, Message, Producer, TopicCollection, TopicPartition
from confluent_kafka.admin import AclOperation, AdminClient

from cnctwin.kafka.kept import fence_open
from cnctwin.kafka.transaction import written_by
from processors.errors import SnapshotError

GROUP = "rights"  # a plant of its own on the Kafka of all tests
PREFIX = f"cnctwin.{GROUP}."
AS = {BRIDGE: "cnctwin", RUNNER: "other"}
WAIT_S_MAX = 30.0
BRIDGES, RUNNERS = f"{PREFIX}bridge.bridge-0", f"{PREFIX}mirror+rules"


@pytest.fixture(scope="module")
def kafka(secured_kafka: KafkaServer) -> KafkaServer:
    """A cluster with the topics of a plant, and the rights that the script asks for."""
    secured_kafka.create_topics(*(PREFIX + topic for topic in TOPICS), f"{PREFIX}other", "elsewhere")
    for right in rights(GROUP=GROUP):
        kind = right.kind.removeprefix("--").replace("-", "_")
        secured_kafka.allow(AS[right.user], kind, right.prefix, right.operation, prefixed=True)
    return secured_kafka


def operations(kafka: KafkaServer, user: str, topic: str) -> set[AclOperation]:
    """The operations that a user may do with a topic, as the broker says; none where it may not even know of it."""
    admin = AdminClient(kafka.client(AS[user]))
    (asked,) = admin.describe_topics(TopicCollection([topic]), include_authorized_operations=True).values()
    try:
        return set(asked.result(WAIT_S_MAX).authorized_operations)
    except KafkaException as refused:
        assert refused.args[0].name() == "TOPIC_AUTHORIZATION_FAILED"
        return set()


def next_of(consumer: Consumer) -> Message:
    message = consumer.poll(WAIT_S_MAX)
    assert message is not None and message.error() is None, message
    return message


@pytest.mark.parametrize("user", [BRIDGE, RUNNER])
def test_the_authorizer_gives_each_what_the_table_says(kafka: KafkaServer, user: str) -> None:
    for topic in TOPICS:
        wanted = {AclOperation.WRITE} if topic in MAY_WRITE[user] else set()
        wanted |= {AclOperation.READ} if topic in MAY_READ[user] else set()
        wanted |= {AclOperation.DESCRIBE} if wanted else set()
        assert operations(kafka, user, PREFIX + topic) == wanted, topic
    assert operations(kafka, user, f"{PREFIX}other") == operations(kafka, user, "elsewhere") == set()


def test_readings_go_in_and_results_come_out_with_these_rights(kafka: KafkaServer) -> None:
    """As bridge and runner do: an idempotent producer; outputs, snapshots and offsets in one transaction; a committed reader."""
    bridge = Producer(kafka.client(AS[BRIDGE]) | {"enable.idempotence": True, "acks": "all"})
    bridge.produce(f"{PREFIX}readings", b"12.5", b"okuma")
    assert bridge.flush(WAIT_S_MAX) == 0
    reader = {"auto.offset.reset": "earliest", "enable.auto.commit": False, "isolation.level": "read_committed"}
    member = {"group.id": RUNNERS, "group.instance.id": "runner-physics-0"}
    consumer = Consumer(kafka.client(AS[RUNNER]) | reader | member)
    results = Consumer(kafka.client(AS[BRIDGE]) | reader | {"group.id": BRIDGES})
    try:
        consumer.subscribe([f"{PREFIX}readings"])
        read = next_of(consumer)
        producer = Producer(kafka.client(AS[RUNNER]) | {"transactional.id": f"{RUNNERS}.runner-physics-0"})
        producer.init_transactions(WAIT_S_MAX)
        producer.begin_transaction()
        for topic in ("results", "snapshots", "deadletters", "health"):
            producer.produce(PREFIX + topic, read.value(), read.key())
        where = [TopicPartition(f"{PREFIX}readings", read.partition(), read.offset() + 1)]
        producer.send_offsets_to_transaction(where, consumer.consumer_group_metadata(), WAIT_S_MAX)
        producer.commit_transaction(WAIT_S_MAX)
        results.subscribe([f"{PREFIX}results"])
        result = next_of(results)
        assert (result.key(), result.value()) == (b"okuma", b"12.5")
        results.commit(asynchronous=False)
    finally:
        consumer.close()
        results.close()


@pytest.mark.parametrize(("user", "name"), [(BRIDGE, f"{RUNNERS}.runner-physics-0"), (RUNNER, "elsewhere.runner-physics-0")])
def test_nobody_else_takes_part_in_the_transactions_of_a_runner(kafka: KafkaServer, user: str, name: str) -> None:
    """A user who could begin one under its name would throw the runner out."""
    producer = Producer(kafka.client(AS[user]) | {"transactional.id": name})
    with pytest.raises(KafkaException) as refused:
        producer.init_transactions(WAIT_S_MAX)
    assert refused.value.args[0].name() == "TRANSACTIONAL_ID_AUTHORIZATION_FAILED"


@pytest.mark.parametrize(("user", "group"), [(BRIDGE, RUNNERS), (RUNNER, "elsewhere")])
def test_nobody_reads_in_the_group_of_others(kafka: KafkaServer, user: str, group: str) -> None:
    admin = AdminClient(kafka.client(AS[user]))
    (asked,) = admin.describe_consumer_groups([group]).values()
    with pytest.raises(KafkaException) as refused:
        asked.result(WAIT_S_MAX)
    assert refused.value.args[0].name() == "GROUP_AUTHORIZATION_FAILED"


@pytest.mark.parametrize(("user", "topic"), [(RUNNER, "results"), (RUNNER, "snapshots"), (BRIDGE, "snapshots")])
def test_who_restores_may_see_who_has_left_a_transaction_open(kafka: KafkaServer, user: str, topic: str) -> None:
    name = f"{RUNNERS}.gone"
    producer = Producer(kafka.client(AS[RUNNER]) | {"transactional.id": name})
    producer.init_transactions(WAIT_S_MAX)
    producer.begin_transaction()
    producer.produce(PREFIX + topic, b"value", b"key", 0, headers=written_by(name))
    assert producer.flush(WAIT_S_MAX) == 0
    found: list[str] = []
    fence_open(kafka.client(AS[user]), PREFIX + topic, [0], timeout_s=WAIT_S_MAX, fence=found.append)
    producer.abort_transaction(WAIT_S_MAX)
    assert found == [name]


def test_who_may_not_read_a_topic_is_told_so_at_once(kafka: KafkaServer) -> None:
    """A runner writes dead letters, so it may ask for the end of their topic, but it may not read them."""
    name = f"{RUNNERS}.gone"
    producer = Producer(kafka.client(AS[RUNNER]) | {"transactional.id": name})
    producer.init_transactions(WAIT_S_MAX)
    producer.begin_transaction()
    producer.produce(f"{PREFIX}deadletters", b"value", b"key", 0, headers=written_by(name))
    assert producer.flush(WAIT_S_MAX) == 0
    with pytest.raises(SnapshotError, match=r"deadletters: .*(?i:authoriz)"):
        fence_open(kafka.client(AS[RUNNER]), f"{PREFIX}deadletters", [0], timeout_s=WAIT_S_MAX, fence=lambda _: None)
    producer.abort_transaction(WAIT_S_MAX)
