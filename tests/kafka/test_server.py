"""Kafka as the tests rely on it: it keeps what was committed, refuses strangers, survives a full disk, and ends with them."""

import os
import random
import signal
import subprocess
import sys
import time
from collections.abc import Callable
from pathlib import Path

import pytest

from tests.kafka.kafka_server import KafkaServer, built

pytest.importorskip("confluent_kafka", reason="no confluent-kafka in this Python; install the extra kafka")

from confluent_kafka import Consumer, KafkaError, KafkaException, Message, Producer, TopicPartition

WAIT_S_MAX = 60.0


def until(condition: Callable[[], bool], what: str) -> None:
    """Wait for it."""
    end = time.monotonic() + WAIT_S_MAX
    while not condition():
        assert time.monotonic() < end, f"not in {WAIT_S_MAX:g} s: {what}"
        time.sleep(0.02)


def transactional(kafka: KafkaServer, name: str) -> Producer:
    """A producer that has begun its first transaction."""
    producer = Producer(kafka.client() | {"transactional.id": name})
    producer.init_transactions(WAIT_S_MAX)
    producer.begin_transaction()
    return producer


def read(kafka: KafkaServer, topic: str, *, committed: bool = True) -> list[bytes]:
    """All values of partition 0 up to where a reader of this kind gets."""
    isolation = "read_committed" if committed else "read_uncommitted"
    options = {"group.id": "reader", "enable.auto.commit": False, "enable.partition.eof": True, "isolation.level": isolation}
    consumer = Consumer(kafka.client() | options)
    values: list[bytes] = []
    try:
        consumer.assign([TopicPartition(topic, 0, 0)])
        end = time.monotonic() + WAIT_S_MAX
        while time.monotonic() < end:
            message = consumer.poll(1.0)
            error = None if message is None else message.error()
            if error is not None and error.code() == KafkaError._PARTITION_EOF:
                return values
            if message is not None and error is None:
                values.append(message.value() or b"")
    finally:
        consumer.close()
    raise AssertionError(f"no end of {topic} in {WAIT_S_MAX:g} s")


def test_only_what_was_committed_is_read(kafka: KafkaServer) -> None:
    kafka.create_topics("transactions")
    producer = transactional(kafka, "transactions")
    producer.produce("transactions", b"kept")
    producer.commit_transaction(WAIT_S_MAX)
    producer.begin_transaction()
    producer.produce("transactions", b"taken back")
    producer.flush(WAIT_S_MAX)
    assert read(kafka, "transactions", committed=False) == [b"kept", b"taken back"]
    producer.abort_transaction(WAIT_S_MAX)
    assert read(kafka, "transactions") == [b"kept"]


def test_a_topic_that_nobody_made_is_not_made_by_asking(kafka: KafkaServer) -> None:
    asked = kafka.admin().list_topics("nobody.made.this", timeout=WAIT_S_MAX).topics["nobody.made.this"]
    assert asked.error is not None and asked.error.code() == KafkaError.UNKNOWN_TOPIC_OR_PART


def test_a_kill_takes_nothing_that_was_committed(kafka: KafkaServer) -> None:
    """Messages, the offset of a group, and the transaction that is open: its own id takes it over and aborts it."""
    kafka.create_topics("killed")
    producer = transactional(kafka, "killed")
    values = [b"%d" % number for number in range(2000)]
    for value in values:
        producer.produce("killed", value)
    consumer = Consumer(kafka.client() | {"group.id": "killed", "enable.auto.commit": False})
    consumer.subscribe(["killed"])
    until(lambda: consumer.poll(0.1) is None and bool(consumer.assignment()), "the group is formed")
    producer.send_offsets_to_transaction([TopicPartition("killed", 0, 1234)], consumer.consumer_group_metadata(), WAIT_S_MAX)
    producer.commit_transaction(WAIT_S_MAX)
    consumer.close()
    producer.begin_transaction()
    producer.produce("killed", b"open")
    producer.flush(WAIT_S_MAX)

    old = kafka.pid
    kafka.restart()

    assert kafka.pid != old
    assert read(kafka, "killed", committed=False) == [*values, b"open"]
    assert read(kafka, "killed") == values
    successor = transactional(kafka, "killed")
    successor.produce("killed", b"after")
    successor.commit_transaction(WAIT_S_MAX)
    assert read(kafka, "killed") == [*values, b"after"]
    again = Consumer(kafka.client() | {"group.id": "killed"})
    assert again.committed([TopicPartition("killed", 0)], WAIT_S_MAX)[0].offset == 1234
    again.close()


def _refused(settings: dict[str, str | int | float | bool]) -> set[int]:
    """The codes of the errors that a client meets until one is of its papers."""
    codes: set[int] = set()
    client = Producer(settings | {"error_cb": lambda error: codes.add(error.code())})
    until(lambda: client.poll(0.1) >= 0 and bool(codes & {KafkaError._AUTHENTICATION, KafkaError._SSL}), "it is refused")
    with pytest.raises(KafkaException):
        client.list_topics(timeout=0.5)
    return codes


@pytest.mark.parametrize(("user", "password"), [("cnctwin", "wrong"), ("nobody", None)])
def test_a_wrong_password_and_an_unknown_user_are_refused(secured_kafka: KafkaServer, user: str, password: str | None) -> None:
    assert KafkaError._AUTHENTICATION in _refused(secured_kafka.client(user, password))
    assert secured_kafka.admin().list_topics(timeout=WAIT_S_MAX).brokers


def test_a_server_of_another_authority_is_refused(secured_kafka: KafkaServer) -> None:
    system_s = {key: value for key, value in secured_kafka.client().items() if key != "ssl.ca.location"}
    assert KafkaError._SSL in _refused(system_s)


def test_a_user_does_what_it_is_allowed_and_no_more(secured_kafka: KafkaServer) -> None:
    secured_kafka.create_topics("plant.readings", "secret")
    secured_kafka.allow("cnctwin", "topic", "plant.", "write", "read", "describe", prefixed=True)
    secured_kafka.allow("cnctwin", "transactional_id", "plant.", "write", "describe", prefixed=True)
    secured_kafka.allow("cnctwin", "group", "reader", "read")

    def tried(user: str, topic: str) -> int | None:
        """The code of the error with which a message came back; None if it was taken."""
        errors: list[KafkaError | None] = []

        def delivered(error: KafkaError | None, message: Message) -> None:
            errors.append(error)

        producer = Producer(secured_kafka.client(user) | {"message.timeout.ms": 30_000})
        producer.produce(topic, b"1", on_delivery=delivered)
        assert producer.flush(WAIT_S_MAX) == 0
        return None if errors[0] is None else errors[0].code()

    assert tried("cnctwin", "plant.readings") is None
    assert tried("cnctwin", "secret") == KafkaError.TOPIC_AUTHORIZATION_FAILED
    assert tried("other", "plant.readings") == KafkaError.TOPIC_AUTHORIZATION_FAILED

    own = Producer(secured_kafka.client("cnctwin") | {"transactional.id": "plant.runner"})
    own.init_transactions(WAIT_S_MAX)
    own.begin_transaction()
    own.produce("plant.readings", b"2")
    own.commit_transaction(WAIT_S_MAX)
    assert read(secured_kafka, "plant.readings") == [b"1", b"2"]
    with pytest.raises(KafkaException) as refused:
        Producer(secured_kafka.client("other") | {"transactional.id": "plant.runner"}).init_transactions(WAIT_S_MAX)
    assert refused.value.args[0].code() == KafkaError.TRANSACTIONAL_ID_AUTHORIZATION_FAILED


def test_on_a_full_disk_it_ends_and_comes_back_with_all_that_it_acknowledged(kafka: KafkaServer) -> None:
    kafka.create_topics("full")
    noise = random.Random(1)
    values = [noise.randbytes(900_000) for _ in range(16)]
    taken: list[bytes] = []

    def delivered(error: KafkaError | None, message: Message) -> None:
        if error is None:
            taken.append(message.value() or b"")

    producer = Producer(kafka.client() | {"enable.idempotence": True, "linger.ms": 0})
    kafka.limit_files(11_000_000)
    for value in values:
        producer.produce("full", value, on_delivery=delivered)
        while len(producer) and kafka.running:
            producer.poll(0.1)
        if not kafka.running:
            break
    assert kafka.wait(WAIT_S_MAX) != 0
    producer.purge()
    producer.flush(WAIT_S_MAX)
    assert taken == values[: len(taken)] and 10 <= len(taken) < 13
    assert "Error while appending records to full-0" in kafka.log.read_text()

    kafka.limit_files(None)
    kafka.start()
    assert read(kafka, "full") == taken
    last = Producer(kafka.client())
    last.produce("full", b"room again", on_delivery=delivered)
    assert last.flush(WAIT_S_MAX) == 0
    assert read(kafka, "full")[-1] == b"room again"


def test_it_ends_with_the_process_that_started_it(tmp_path: Path) -> None:
    built()
    code = (
        "import sys, time; from pathlib import Path; from tests.kafka.kafka_server import KafkaServer;"
        "server = KafkaServer(Path(sys.argv[1])); server.start(); print(server.pid, flush=True); time.sleep(600)"
    )
    owner = subprocess.Popen([sys.executable, "-c", code, str(tmp_path)], stdout=subprocess.PIPE, text=True)
    assert owner.stdout is not None
    try:
        pid = int(owner.stdout.readline())
        assert "cnctwin.Server" in Path(f"/proc/{pid}/cmdline").read_text()
    finally:
        owner.send_signal(signal.SIGKILL)
        owner.wait()
        owner.stdout.close()
    until(lambda: not _lives(pid), "Kafka has ended")


def _lives(pid: int) -> bool:
    try:
        os.kill(pid, 0)
        return Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()[0] != "Z"
    except (ProcessLookupError, FileNotFoundError):
        return False
