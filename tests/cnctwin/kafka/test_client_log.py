"""Lines of librdkafka's clients: one of a kind in a minute, with the number of those that were held back."""

import logging
import time
from collections.abc import Callable

import pytest

pytest.importorskip("confluent_kafka", reason="no confluent-kafka in this Python; install the extra kafka")

from confluent_kafka import Consumer, KafkaError, Producer
from confluent_kafka.admin import AdminClient

from cnctwin.kafka.client_log import EVERY_S, KINDS_MAX, LOG, Reach, Seldom, kind_of
from cnctwin.kafka.settings import KafkaSettings
from tests.wire.mosquitto import free_port

WITHIN_S = 20.0
REFUSED = "FAIL [rdkafka#{client}] [thrd:k:{port}/bootstrap]: k:{port}/{broker}: Connect to ipv4#10.0.0.1:{port} failed: \
Connection refused (after {ms}ms in state CONNECT{more})"


class Lines:
    """A filter with a clock of its own, and what goes through it."""

    def __init__(self) -> None:
        self.now_s = 1000.0
        self.filter = Seldom(lambda: self.now_s)

    def say(self, text: str, *args: object) -> str | None:
        """Return what becomes of a line; None where it is held back."""
        record = logging.LogRecord("kafka", logging.WARNING, "", 0, text, args, None)
        return record.getMessage() if self.filter.filter(record) else None


def refused(client: str = "consumer-4", port: int = 9092, broker: str = "1", ms: int = 0, more: str = "") -> str:
    return REFUSED.format(client=client, port=port, broker=broker, ms=ms, more=more)


def test_one_line_of_a_kind_goes_through_in_a_minute_and_tells_of_the_others() -> None:
    lines = Lines()
    assert lines.say(refused()) == refused()
    for number in range(30):
        lines.now_s += EVERY_S / 31
        more = f", {number} identical error(s) suppressed" if number else ""
        assert (
            lines.say(refused(f"{('consumer', 'producer')[number % 2]}-{number}", 9000 + number, "bootstrap", number, more))
            is None
        )
    assert lines.say("kafka: %s", "the coordinator is loading") == "kafka: the coordinator is loading"
    lines.now_s += EVERY_S / 31 + 0.001
    assert lines.say(refused()) == f"{refused()} (30 like it were held back)"
    lines.now_s += EVERY_S
    assert lines.say(refused()) == refused()


@pytest.mark.parametrize(
    "other", ["a line of another kind", refused().replace("k:", "l:"), refused().replace("refused", "reset")]
)
def test_lines_of_another_kind_go_through(other: str) -> None:
    lines = Lines()
    assert lines.say(refused()) is not None
    assert lines.say(other) == other


def test_the_kinds_that_are_known_are_bounded() -> None:
    lines = Lines()
    for number in range(KINDS_MAX + 1):
        assert lines.say("kind " + "x" * number) is not None
    assert len(lines.filter._kinds) == KINDS_MAX
    assert lines.say("kind " + "x" * KINDS_MAX) is None
    assert lines.say("kind ") is not None, "the oldest was forgotten"


def test_a_line_with_a_percent_sign_is_said_as_it_is() -> None:
    lines = Lines()
    assert lines.say("100% of it") == "100% of it"
    lines.say("100% of it")
    lines.now_s += EVERY_S
    assert lines.say("100% of it") == "100% of it (1 like it were held back)"


def test_other_troubles_are_said_and_those_of_one_connection_are_in_the_log_already(
    monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture
) -> None:
    monkeypatch.setattr(LOG, "filters", [Seldom()])
    for code in (KafkaError._TRANSPORT, KafkaError.TOPIC_AUTHORIZATION_FAILED):
        Reach().failed(KafkaError(code, "trouble"))
    assert caplog.messages == ["kafka: trouble"]


def test_the_cluster_goes_and_comes_back_in_a_line_each(caplog: pytest.LogCaptureFixture) -> None:
    reach, down = Reach(), KafkaError(KafkaError._ALL_BROKERS_DOWN, "1/1 brokers are down")
    for _ in range(2):
        reach.answered()
        reach.failed(down)
        reach.failed(down)
        reach.answered()
        reach.answered()
    away, back = "kafka: the cluster does not answer: 1/1 brokers are down", "kafka: the cluster answers again"
    assert caplog.messages == [away, back] * 2


def consumed(settings: KafkaSettings) -> Callable[[], object]:
    """Return what a reader of the log does in each turn."""
    consumer = Consumer(settings.client() | {"group.id": "nobody"})
    consumer.subscribe(["nothing"])
    return lambda: consumer.consume(10, 0.1)


def produced(settings: KafkaSettings) -> Callable[[], object]:
    """Return what a writer does in each turn."""
    producer = Producer(settings.client())
    return lambda: producer.poll(0.1)


def asked(settings: KafkaSettings) -> Callable[[], object]:
    """Return what a client that asks does."""
    admin = AdminClient(settings.client())
    return lambda: admin.poll(0.1)


@pytest.mark.parametrize("client", [consumed, produced, asked])
def test_a_client_of_a_cluster_that_is_away_says_so_here_and_once(
    client: Callable[[KafkaSettings], Callable[[], object]],
    monkeypatch: pytest.MonkeyPatch,
    caplog: pytest.LogCaptureFixture,
    capfd: pytest.CaptureFixture[str],
) -> None:
    heard = Seldom()
    monkeypatch.setattr(LOG, "filters", [heard])
    turn = client(KafkaSettings(bootstrap=f"127.0.0.1:{free_port()}"))
    until_s = time.monotonic() + WITHIN_S
    while not any(held for _, held in heard._kinds.values()):
        assert time.monotonic() < until_s, "no attempt but the first is heard of"
        turn()
    lines = [record.getMessage() for record in caplog.records if record.name == LOG.name]
    assert any("Connection refused" in line for line in lines)
    assert len(lines) == len(set(map(kind_of, lines))), "one line of each kind"
    assert "rdkafka" not in capfd.readouterr().err, "librdkafka writes nothing by itself"
