"""A host session's admission, and what becomes of the rest: the device, its neighbours, the table."""

from __future__ import annotations

from random import Random

import pytest

from sparkplug.admission.gate import Gate
from sparkplug.admission.limits import Limits
from sparkplug.admission.refusal import Refusal
from sparkplug.codec import encode
from sparkplug.datatype import DataType
from sparkplug.host_session import EventKind, HostEvent, HostSession
from sparkplug.metric import NodeId
from sparkplug.quality import Quality
from sparkplug.topics import Topic, Verb
from sparkplug.values import Metric, Payload, Value

NODE = NodeId("cnc", "edge")
START_MS = 1_790_000_000_000
REBIRTHS = "rebirths_requested"


class Plant:
    """An edge node of the test's own making, and the host that hears it; a millisecond passes with each message."""

    def __init__(self, limits: Limits = Limits(), *, trusted: bool = False, node: NodeId = NODE) -> None:  # noqa: B008
        self.host = HostSession("scada", chance=Random(0), gate=Gate(limits, ("jobs",), lambda _: trusted))
        self.host.connected(START_MS)
        self.node, self.now_ms, self.seq = node, START_MS, 255

    def hear(self, verb: Verb, device: str | None = None, *metrics: Metric, stamp_ms: int | None = None) -> list[HostEvent]:
        self.now_ms += 1
        self.seq = 0 if verb is Verb.NBIRTH else (self.seq + 1) % 256
        payload = Payload(self.now_ms if stamp_ms is None else stamp_ms, metrics, self.seq)
        return self.host.message(str(Topic(verb, self.node, device)), encode(payload), self.now_ms)

    def born(self, *devices: str) -> Plant:
        self.hear(Verb.NBIRTH, None, Metric("bdSeq", 0, DataType.INT64, self.now_ms))
        for device in devices:
            assert kinds(self.hear(Verb.DBIRTH, device, number(1.0))) == ["birth"]
        return self

    def wait(self, seconds: int) -> list[HostEvent]:
        events = []
        for _ in range(seconds):
            self.now_ms += 1000
            events += self.host.tick(self.now_ms)
        return events

    def table(self) -> list[tuple[str | None, Refusal, bool]]:
        return [(row.device, row.reason, row.is_whole) for row in self.host.admission.quarantine.table()]


def number(value: float, name: str = "load", stamp_ms: int = START_MS, alias: int | None = None) -> Metric:
    return Metric(name, value, DataType.DOUBLE, stamp_ms, alias)


def text(value: Value, name: str = "program", datatype: DataType = DataType.STRING) -> Metric:
    return Metric(name, value, datatype, START_MS)


def kinds(events: list[HostEvent]) -> list[str]:
    return [event.kind.value for event in events]


BAD_NAMES = ["a" * 1025, "%" * 400, "lo\x07ad", "a\x00b", "\x7f", "\x85", "x\ufeff", "\ufdd0", "\uffff", "\U0001fffe", "/" * 70]
BAD_DEVICES = ["%" * 30_000, "+" if False else "a" * 256, "ö" * 128, "mill\x07", "\ufeffmill", "\ufdef"]
BAD_BIRTHS = [
    *((number(1.0, name), Refusal.NAME) for name in BAD_NAMES),
    (text("x" * 65_537), Refusal.SIZE),
    (text(b"x" * 1_048_577, datatype=DataType.BYTES), Refusal.SIZE),
    (text((0.0,) * 131_073, datatype=DataType.DOUBLE_ARRAY), Refusal.SIZE),
]


@pytest.mark.parametrize(("metric", "refusal"), BAD_BIRTHS, ids=repr)
def test_a_bad_birth_quarantines_its_device_and_a_good_one_lets_it_in_again(metric: Metric, refusal: Refusal) -> None:
    plant = Plant().born("mill", "lathe")
    death, refused = plant.hear(Verb.DBIRTH, "mill", number(2.0), metric)
    assert (death.kind, death.device, death.readings[0].quality) == (EventKind.DEATH, "mill", Quality.STALE)
    assert (refused.kind, refused.device, refused.refusal, refused.refused) == (EventKind.REFUSED, "mill", refusal, 1)
    assert refused.detail.isprintable() and len(refused.detail) < 300
    assert kinds(plant.hear(Verb.DDATA, "mill", number(3.0))) == ["refused"]
    assert kinds(plant.hear(Verb.DDATA, "lathe", number(3.0))) == ["data"]
    plant.wait(5)
    assert plant.host.counts[REBIRTHS] == 0, "nobody asks for a birth that is refused again"
    assert plant.table() == [("mill", refusal, True)]
    assert plant.host.admission.quarantine.table()[0].times == 2
    assert kinds(plant.hear(Verb.DBIRTH, "mill", number(4.0))) == ["birth"]
    assert kinds(plant.hear(Verb.DDATA, "mill", number(5.0))) == ["data"]
    assert plant.table() == []


@pytest.mark.parametrize("device", [*BAD_DEVICES, "jobs"], ids=lambda device: repr(device[:8]))
def test_a_device_with_a_name_that_no_topic_can_hold_is_never_born(device: str) -> None:
    plant = Plant().born("lathe")
    (refused,) = plant.hear(Verb.DBIRTH, device, number(1.0))
    assert refused.refusal is (Refusal.RESERVED if device == "jobs" else Refusal.NAME)
    assert refused.device is not None and refused.device.isprintable() and len(refused.device) <= 61
    assert kinds(plant.hear(Verb.DDATA, device, number(1.0))) == ["refused"]
    assert kinds(plant.hear(Verb.DDATA, "lathe", number(3.0))) == ["data"]
    picture = plant.host.picture(NODE)
    assert picture is not None and list(picture.devices) == ["lathe"]


def test_the_longest_names_are_let_in() -> None:
    plant = Plant().born("ö" * 127, "%" * 85)
    assert kinds(plant.hear(Verb.DBIRTH, "mill", number(1.0, "ä" * 512), number(1.0, "%" * 341))) == ["birth"]


def test_a_bad_birth_of_the_node_takes_its_devices_with_it() -> None:
    plant = Plant().born("mill")
    events = plant.hear(Verb.NBIRTH, None, Metric("bdSeq", 1, DataType.INT64, plant.now_ms), number(1.0, "a\x01"))
    assert [(event.kind.value, event.device) for event in events] == [("death", None), ("death", "mill"), ("refused", None)]
    assert [event.refused for event in plant.hear(Verb.DBIRTH, "mill", number(1.0))] == [1]
    assert [event.refused for event in plant.hear(Verb.NDATA, None, number(1.0))] == [0]
    plant.wait(5)
    assert plant.host.counts[REBIRTHS] == 0
    plant.born("mill")
    assert plant.table() == []


@pytest.mark.parametrize("node", [NodeId("c" * 300, "edge"), NodeId("cnc", "ed\x01ge"), NodeId("cnc", "#" * 0 + "%" * 100)])
def test_a_node_with_a_bad_name_is_not_listened_to(node: NodeId) -> None:
    plant = Plant(node=node)
    (event,) = plant.hear(Verb.NBIRTH, None, Metric("bdSeq", 0, DataType.INT64, START_MS))
    assert event.refusal is Refusal.NAME and str(event.node).isprintable()
    assert plant.host.nodes() == ()


AHEAD = Limits().ahead_ms_max
STRANGE_MS = [START_MS + AHEAD + 60_000, 2**63 - 1, 2**63, 2**64 - 1, START_MS + 900 * 31_557_600_000]


@pytest.mark.parametrize("stamp_ms", STRANGE_MS)
def test_a_reading_with_a_stamp_that_no_clock_has_is_kept_out_alone(stamp_ms: int) -> None:
    plant = Plant().born("mill")
    plant.hear(Verb.DBIRTH, "mill", number(1.0), number(1.0, "feed"))
    for _ in range(3):  # the second is read by the layout of the first, where there is one
        assert kinds(plant.hear(Verb.DDATA, "mill", number(2.0), number(3.0, "feed"))) == ["data"]
        data, refused = plant.hear(Verb.DDATA, "mill", number(2.0), number(3.0, "feed", stamp_ms))
        assert [reading.name for reading in data.readings] == ["load"] == list(data.names)
        assert (refused.refusal, refused.refused, refused.device) == (Refusal.STAMP, 1, "mill")
        assert "1 values kept out" in refused.detail and "feed" in refused.detail
        assert kinds(plant.hear(Verb.DDATA, "mill", number(2.0, stamp_ms=stamp_ms))) == ["refused"]
    assert plant.table() == [("mill", Refusal.STAMP, False)]


def test_a_layout_that_is_remembered_lets_no_strange_stamp_in() -> None:
    plant = Plant().born("mill")
    good_ms, strange_ms = START_MS + 1, START_MS + AHEAD + 10_000  # as many bytes
    for _ in range(3):
        assert kinds(plant.hear(Verb.DDATA, "mill", number(2.0, stamp_ms=good_ms))) == ["data"]
    assert kinds(plant.hear(Verb.DDATA, "mill", number(2.0, stamp_ms=strange_ms))) == ["refused"]
    plant.now_ms += 20_000
    plant.host.tick(plant.now_ms)
    assert kinds(plant.hear(Verb.DDATA, "mill", number(2.0, stamp_ms=strange_ms))) == ["data"], "the window moves with the clock"


@pytest.mark.parametrize("stamp_ms", STRANGE_MS)
def test_a_birth_with_a_strange_stamp_declares_its_metric_without_a_value(stamp_ms: int) -> None:
    plant = Plant().born()
    birth, refused = plant.hear(Verb.DBIRTH, "mill", number(1.0), number(7.0, "feed", stamp_ms), stamp_ms=stamp_ms)
    assert birth.timestamp_ms == plant.now_ms
    load, feed = birth.readings
    assert load.value == 1.0
    assert (feed.value, feed.quality, feed.timestamp_ms) == (None, Quality.BAD, plant.now_ms)
    assert feed.reason is not None and "kept out" in feed.reason
    assert refused.refusal is Refusal.STAMP
    picture = plant.host.picture(NODE)
    assert picture is not None and picture.devices["mill"].readings["feed"] == feed
    assert kinds(plant.hear(Verb.DDATA, "mill", number(2.0, "feed"))) == ["data"]


def test_the_past_may_be_bounded_as_well() -> None:
    plant = Plant(Limits(oldest_ms=START_MS)).born("mill")
    assert kinds(plant.hear(Verb.DDATA, "mill", number(1.0, stamp_ms=START_MS - 1))) == ["refused"]
    assert kinds(plant.hear(Verb.DDATA, "mill", number(1.0, stamp_ms=START_MS))) == ["data"]
    assert kinds(Plant().born("mill").hear(Verb.DDATA, "mill", number(1.0, stamp_ms=1))) == ["data"]


def test_a_value_that_is_too_long_is_kept_out_alone() -> None:
    plant = Plant().born()
    plant.hear(Verb.DBIRTH, "mill", number(1.0), text("O1"))
    data, refused = plant.hear(Verb.DDATA, "mill", number(2.0), text("x" * 70_000))
    assert [reading.name for reading in data.readings] == ["load"]
    assert (refused.refusal, refused.refused) == (Refusal.SIZE, 1)
    assert kinds(plant.hear(Verb.DDATA, "mill", text("x" * 65_536))) == ["data"]


def test_what_is_over_a_quota_is_refused_and_the_rest_stays() -> None:
    limits = Limits(metrics_a_device_max=3, metrics_a_node_max=5, devices_a_node_max=3)
    plant = Plant(limits).born()
    three = [number(1.0, name) for name in "abc"]
    assert kinds(plant.hear(Verb.DBIRTH, "a", *three, number(1.0, "d"))) == ["refused"]
    assert kinds(plant.hear(Verb.DBIRTH, "a", *three)) == ["birth"]
    assert kinds(plant.hear(Verb.DBIRTH, "b", *three)) == ["refused"], "the node has one, a has three"
    assert kinds(plant.hear(Verb.DBIRTH, "a", three[0])) == ["birth"]
    assert kinds(plant.hear(Verb.DBIRTH, "b", three[0])) == ["birth"]
    assert kinds(plant.hear(Verb.DBIRTH, "c", three[0])) == ["birth"]
    assert kinds(plant.hear(Verb.DBIRTH, "d", three[0])) == ["refused"]
    assert kinds(plant.hear(Verb.DDATA, "d", three[0])) == ["refused"]
    plant.hear(Verb.DDEATH, "a")
    assert kinds(plant.hear(Verb.DBIRTH, "d", three[0])) == ["birth"], "one that is offline makes room"
    picture = plant.host.picture(NODE)
    assert picture is not None and list(picture.devices) == ["b", "c", "d"]


def test_a_trusted_node_is_free_of_quotas_and_of_nothing_else() -> None:
    plant = Plant(Limits(metrics_a_device_max=1, devices_a_node_max=1), trusted=True).born("a", "b")
    assert kinds(plant.hear(Verb.DBIRTH, "c", number(1.0), number(1.0, "feed"))) == ["birth"]
    assert kinds(plant.hear(Verb.DBIRTH, "d", number(1.0, "\x01"))) == ["refused"]


def test_a_group_has_so_many_nodes_and_no_more() -> None:
    plant = Plant(Limits(nodes_a_group_max=2))
    for name in ("a", "b", "c"):
        plant.node = NodeId("cnc", name)
        events = plant.hear(Verb.NBIRTH, None, Metric("bdSeq", 0, DataType.INT64, START_MS))
        assert kinds(events) == ["refused" if name == "c" else "birth"]
    assert len(plant.host.nodes()) == 2


def test_many_names_that_are_refused_take_little_room_and_ask_for_no_rebirth() -> None:
    plant = Plant(Limits(devices_a_node_max=1)).born("mill")
    for device in range(3000):
        plant.hear(Verb.DBIRTH, f"d{device}", number(1.0))
    for device in range(3000):
        assert kinds(plant.hear(Verb.DDATA, f"d{device}", number(1.0))) == ["refused"]
    assert len(plant.host.admission.quarantine) <= 65
    plant.wait(5)
    assert plant.host.counts[REBIRTHS] == 0


def test_a_row_goes_when_nothing_has_been_refused_for_an_hour() -> None:
    plant = Plant().born("mill")
    plant.hear(Verb.DDATA, "mill", number(1.0, stamp_ms=2**63))
    assert plant.table()
    plant.now_ms += 3_600_000
    plant.host.tick(plant.now_ms)
    assert plant.table() == []


def test_limits_are_whole_numbers() -> None:
    with pytest.raises(ValueError, match="id_bytes_max = 0 is no whole number from 1"):
        Limits(id_bytes_max=0)
