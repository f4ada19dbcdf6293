"""Aliases that a node and its device share, as Tahu Java gives them to metrics of one name: the topic tells which is meant."""

from __future__ import annotations

from random import Random

import pytest

from sparkplug.actions import Publish
from sparkplug.codec import encode, parse
from sparkplug.datatype import DataType
from sparkplug.host_session import HostEvent, HostSession
from sparkplug.metric import Change, NodeId
from sparkplug.node_picture import NodePicture, Owner
from sparkplug.values import Metric, Payload

NODE = NodeId("cnc", "tahu")
START_MS = 1_790_000_000_000
REBIRTH = Metric("Node Control/Rebirth", False, DataType.BOOLEAN, START_MS)
BD_SEQ = Metric("bdSeq", 0, DataType.INT64, START_MS)


class Tahu:
    """An edge node with a device whose metrics `load` and `state` have the names, and so the aliases, of the node's own."""

    def __init__(self, device_type: DataType = DataType.DOUBLE) -> None:
        self.host = HostSession("scada", chance=Random(0))
        self.host.connected(START_MS)
        self.host.actions.clear()
        self.seq, self.now_ms = -1, START_MS
        self.device_type = device_type
        self.born()

    def born(self) -> None:
        self.seq = -1
        own = (
            BD_SEQ,
            REBIRTH,
            Metric("load", 1.0, DataType.DOUBLE, self.now_ms, 1),
            Metric("state", "up", DataType.STRING, 1, 2),
        )
        device = (Metric("load", None, self.device_type, self.now_ms, 1), Metric("part", 0, DataType.INT32, self.now_ms, 3))
        self.say("NBIRTH/tahu", *own)
        self.say("DBIRTH/tahu/lathe", *device)

    def say(self, topic: str, *metrics: Metric) -> list[HostEvent]:
        self.seq, self.now_ms = (self.seq + 1) % 256, self.now_ms + 1
        return self.host.message(f"spBv1.0/cnc/{topic}", encode(Payload(self.now_ms, metrics, seq=self.seq)), self.now_ms)

    def data(self, device: str | None, *values: tuple[int, float | int, DataType]) -> dict[str, object]:
        topic = "NDATA/tahu" if device is None else f"DDATA/tahu/{device}"
        (event,) = self.say(topic, *(Metric(None, value, datatype, self.now_ms, alias) for alias, value, datatype in values))
        assert event.device == device
        return {reading.name: reading.value for reading in event.readings}

    def asked(self) -> list[Publish]:
        self.host.tick(self.now_ms + 60_000)
        return [action for action in self.host.actions if isinstance(action, Publish)]


def test_a_shared_alias_means_the_metric_of_whom_the_topic_names() -> None:
    tahu = Tahu()
    assert tahu.data(None, (1, 2.0, DataType.DOUBLE)) == {"load": 2.0}
    assert tahu.data("lathe", (1, 3.0, DataType.DOUBLE), (3, 7, DataType.INT32)) == {"load": 3.0, "part": 7}
    picture = tahu.host.picture(NODE)
    assert picture is not None
    assert picture.own.readings["load"].value == 2.0
    assert picture.devices["lathe"].readings["load"].value == 3.0
    assert tahu.host.counts["sloppy_aliases"] == 1
    assert tahu.host.counts["unknown_metrics"] == 0
    assert tahu.asked() == []


def test_remembered_layouts_of_both_stay_right_over_births_of_either() -> None:
    tahu = Tahu(DataType.INT32)
    for number in range(1, 40):
        if number % 10 == 0:
            tahu.born()
        if number % 7 == 0:
            tahu.say("DBIRTH/tahu/lathe", Metric("other" if number % 2 else "load", 0, DataType.INT32, tahu.now_ms, 1))
        assert tahu.data(None, (1, float(number), DataType.DOUBLE)) == {"load": float(number)}
        ((name, value),) = tahu.data("lathe", (1, number, DataType.INT32)).items()
        assert (type(value), value, name in ("load", "other")) == (int, number, True)
    assert tahu.host.counts["unknown_metrics"] == 0
    assert any(route.layouts._hits for route in tahu.host._routes.values()), "no layout was ever used"


def test_an_alias_of_another_owner_is_unknown_to_this_one() -> None:
    tahu = Tahu()
    assert tahu.data("lathe", (2, 1, DataType.INT32)) == {}
    assert tahu.host.counts["unknown_metrics"] == 1
    assert len(tahu.asked()) == 1


def test_a_device_that_was_not_born_again_with_its_node_is_not_read_by_its_old_aliases() -> None:
    tahu = Tahu()
    tahu.seq = -1
    tahu.say("NBIRTH/tahu", BD_SEQ, REBIRTH, Metric("new", 1.0, DataType.DOUBLE, tahu.now_ms, 3))
    assert tahu.data("lathe", (3, 1, DataType.INT32)) == {}


def test_unique_aliases_are_not_counted_however_often_a_birth_comes() -> None:
    tahu = Tahu()
    tahu.host.counts.clear()
    for alias in range(10, 20):
        tahu.say("DBIRTH/tahu/mill", Metric("load", 0.0, DataType.DOUBLE, tahu.now_ms, alias))
    assert tahu.host.counts["sloppy_aliases"] == 0
    tahu.born()
    assert tahu.host.counts["sloppy_aliases"] == 1


def test_a_device_that_uses_up_aliases_leaves_none_behind() -> None:
    picture = NodePicture(NODE)
    device = Owner()
    for start in range(0, 1000, 10):
        metrics = tuple(Metric(f"m{i}", 1.0, DataType.DOUBLE, 1, start + i) for i in range(10))
        device.bear(parse(encode(Payload(1, metrics))), 1, picture.holders)
    assert len(picture.holders) == len(device.aliases) == 10


@pytest.mark.parametrize(("device", "alias"), [(None, 1), ("lathe", 1)])
def test_a_command_carries_the_shared_alias_on_the_topic_of_whom_it_is_for(device: str | None, alias: int) -> None:
    tahu = Tahu()
    command = tahu.host.command(NODE, device, [Change("load", 5.0, START_MS)], START_MS)
    (metric,) = parse(command.payload).metrics
    assert (metric.alias, "DCMD" in command.topic) == (alias, device is not None)
