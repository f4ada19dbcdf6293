"""Records that find no room are counted, and told as one hole with what holds behind it."""

import time
from typing import Any

import pytest

pytest.importorskip("confluent_kafka", reason="no confluent-kafka in this Python; install the extra kafka")

from confluent_kafka import KafkaError, KafkaException

from cnctwin.kafka.bridge import outward
from cnctwin.kafka.settings import KafkaSettings
from sparkplug.host_event import EventKind, HostEvent
from sparkplug.metric import NodeId, Reading
from sparkplug.quality import Quality
from sparkplug.records.record import Origin, RecordReader
from tests.wire.mosquitto import free_port

NODE = NodeId("cnc", "edge")


class Queue:
    """A producer with room for so many messages; `large` are refused for their size."""

    def __init__(self, *_: Any, **__: Any) -> None:
        self.room = self.large = 4
        self.sent: list[tuple[Any, bytes]] = []
        self.waiting = 0

    def produce(self, topic: str, value: bytes, key: bytes, partition: int, report: Any, headers: Any) -> None:
        if value == b"large":
            raise KafkaException(KafkaError(KafkaError.MSG_SIZE_TOO_LARGE))
        if self.waiting >= self.room:
            raise BufferError
        self.waiting += 1
        self.sent.append((headers, value))

    def poll(self, _: float) -> None:
        """Nothing comes."""

    def __len__(self) -> int:
        return self.waiting


@pytest.fixture
def out(monkeypatch: pytest.MonkeyPatch) -> outward.Outward:
    monkeypatch.setattr(outward, "Producer", Queue)
    return outward.Outward(KafkaSettings(bootstrap="k:1"), "bridge-0")


def said(out: outward.Outward) -> list[tuple[str, Any]]:
    """Kind and value of all records that went out."""
    queue: Any = out._producer
    events = [RecordReader().read(*sent).event for sent in queue.sent]
    return [(event.kind.value, event.readings[0].value if event.readings else event.detail) for event in events if event]


def put(out: outward.Outward, value: float, kind: EventKind = EventKind.DATA) -> bool:
    readings = (Reading("load", value, 1000, Quality.GOOD, None, None, False),)
    return out.put("readings", "okuma", HostEvent(kind, NODE, "okuma", 1000, readings), 1000, Origin(0, 1, 2))


@pytest.mark.parametrize("kind", [EventKind.DATA, EventKind.DEATH])
def test_one_hole_stands_before_the_first_record_after_the_loss(out: outward.Outward, kind: EventKind) -> None:
    queue: Any = out._producer
    assert [put(out, float(number)) for number in range(6)] == [True] * 4 + [False] * 2
    assert not put(out, 6.0, kind)
    assert out.take_untold() == [], "there is no room yet"
    queue.waiting = 3
    assert not put(out, 7.0), "room for one record is none"
    queue.waiting = 2
    assert out.dropped == 4
    assert out.take_untold() == [(NODE, "okuma")] and out.take_untold() == []
    assert put(out, 7.0, EventKind.BIRTH)
    assert said(out)[4:] == [("hole", "4 messages of okuma found no room on the way to the log"), ("birth", 7.0)]
    queue.waiting = 0
    assert put(out, 8.0)
    assert said(out)[-1] == ("data", 8.0)


def test_the_newest_plain_message_of_a_topic_goes_out_once_there_is_room(out: outward.Outward) -> None:
    queue: Any = out._producer
    queue.waiting = 4
    for payload in (b"old", b"new"):
        plain = HostEvent(EventKind.PLAIN, NodeId("", ""), None, 1000, topic="twin/description/okuma", payload=payload)
        assert not out.put_plain("readings", "okuma", -1, plain, 1000)
    assert out.dropped == 1
    out.poll()
    assert queue.sent == []
    queue.waiting = 0
    out.poll()
    out.poll()
    assert [value for _, value in queue.sent] == [b"new"]


def test_what_is_too_large_for_the_cluster_is_lost_once_and_ends_nothing(out: outward.Outward) -> None:
    plain = HostEvent(EventKind.PLAIN, NodeId("", ""), None, 1000, topic="t", payload=b"large")
    assert out.put_plain("readings", "okuma", -1, plain, 1000)
    assert (out.failed, out.dropped) == (1, 0)
    assert put(out, 1.0)


def test_a_producer_that_is_beyond_help_ends_the_bridge(out: outward.Outward, monkeypatch: pytest.MonkeyPatch) -> None:
    """The broker keeps the messages that were not acknowledged, and delivers them to the next bridge."""

    def refuse(*_: Any, **__: Any) -> None:
        raise KafkaException(KafkaError(KafkaError._FATAL))

    monkeypatch.setattr(out._producer, "produce", refuse)
    with pytest.raises(outward.BridgeError, match="bridge-0 cannot go on"):
        out.keep("births", "key", b"value")


@pytest.mark.parametrize("code", [KafkaError.TOPIC_AUTHORIZATION_FAILED, KafkaError.OUT_OF_ORDER_SEQUENCE_NUMBER])
def test_a_record_that_is_refused_for_good_ends_the_bridge(out: outward.Outward, code: int) -> None:
    class Refused:
        def topic(self) -> str:
            return "cnctwin.cnc.readings"

    message: Any = Refused()
    out.delivered_one(KafkaError(code), message)
    with pytest.raises(outward.BridgeError, match=r"cnctwin\.cnc\.readings: "):
        out.poll()


def test_errors_of_a_cluster_that_is_away_take_nothing_from_what_was_delivered() -> None:
    """librdkafka counts errors that nobody has taken yet with the records that wait."""
    out = outward.Outward(KafkaSettings(bootstrap=f"127.0.0.1:{free_port()}"), "bridge-0")
    deadline_s = time.monotonic() + 30.0
    while out.waiting == 0:
        assert time.monotonic() < deadline_s, "no error came"
        time.sleep(0.02)
    out.poll()
    assert out.delivered == 0
    assert out.close() == 0


def test_what_was_delivered_never_falls(out: outward.Outward) -> None:
    queue: Any = out._producer
    assert put(out, 1.0) and put(out, 2.0)
    told = []
    for waiting in (3, 0, 1, 0):  # two records and an error; nothing; an error; nothing
        queue.waiting = waiting
        out.poll()
        told.append(out.delivered)
    assert told == [0, 2, 2, 2]
