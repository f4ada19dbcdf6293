"""The checks of an edge node of a peer against our host application: `CHECKS` has them in the order in which they are made."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import Any

from sparkplug.codec import decode
from sparkplug.datatype import DataType
from sparkplug.host import EventKind, HostApplication
from sparkplug.metric import Change
from sparkplug.quality import Quality
from sparkplug.topics import Topic, Verb
from sparkplug.values import Payload
from tests.peers.edge_pairing import EdgePairing, host_of
from tests.peers.metrics import (
    BY_NAME,
    NOTHING,
    OFFSETS,
    PART,
    datatype_of,
    our_value,
    scalars,
)
from tests.peers.pairing import DEVICE, QUIET_S, WRAP
from tests.wire.mqtt_packets import Connect

Check = Callable[[EdgePairing, float], None]


def births(it: EdgePairing, _patience_s: float) -> None:
    """Each scalar type at its limits, with its datatype."""
    device = it.device
    wrong = [
        f"{line['name']}: {device.readings[line['name']].value!r}"
        for line in scalars(it.peer.types_lacking)
        if device.readings[line["name"]].value != our_value(line) or device.bindings[line["name"]].datatype != datatype_of(line)
    ]
    assert not wrong, wrong
    assert not it.counted("malformed", "unknown_metrics")


def nulls(it: EdgePairing, patience_s: float) -> None:
    """A null in the birth, a value, and a null in data."""
    name = NOTHING["name"]
    assert it.device.readings[name].value is None
    it.data({**NOTHING, "value": "5"}, lambda: it.device.readings[name].value == 5, patience_s)
    it.data(NOTHING, lambda: it.device.readings[name].value is None, patience_s)


def units(it: EdgePairing, _patience_s: float) -> None:
    """The property engUnit of a birth."""
    assert it.device.readings[PART["name"]].unit == PART["unit"]


def dated(it: EdgePairing, _patience_s: float) -> None:
    """Time stamps of all metrics, seq 0 and Node Control/Rebirth without an alias in the NBIRTH."""
    ((_, birth), *_) = it.sent(Verb.NBIRTH)
    names = {metric.name: metric for metric in birth.metrics}
    assert birth.seq == 0 and names["bdSeq"].datatype is DataType.INT64
    control = names.get("Node Control/Rebirth")
    assert control is not None and control.value is False and control.datatype is DataType.BOOLEAN
    assert control.alias is None, f"Node Control/Rebirth has the alias {control.alias}"
    assert all(metric.timestamp_ms for metric in birth.metrics), "a metric without a time stamp"


def unretained(it: EdgePairing, patience_s: float) -> None:
    """Births and data go with QoS 0, not retained."""
    it.data({**PART, "value": "12"}, lambda: it.device.readings["part"].value == 12, patience_s)
    packets = [packet for verb in (Verb.NBIRTH, Verb.DBIRTH, Verb.DDATA) for packet, _ in it.sent(verb)]
    wrong = sorted(
        {f"{Topic.parse(packet.topic).verb.name} with QoS {packet.qos}" for packet in packets if packet.qos or packet.retain}
    )
    assert not wrong, wrong


def aliases(it: EdgePairing, patience_s: float) -> None:
    """Data by alias, without the name."""
    it.data({**PART, "value": "4711"}, lambda: it.device.readings["part"].value == 4711, patience_s)
    (*_, (_, data)) = it.sent(Verb.DDATA)
    (metric,) = data.metrics
    assert metric.alias is not None and metric.name is None


def shared(it: EdgePairing, patience_s: float) -> None:
    """A metric of the node and one of the device with the same name are two."""
    picture = it.host.picture(it.node)
    assert picture is not None and picture.own.readings["part"].value == -1
    it.data({**PART, "value": "815"}, lambda: it.device.readings["part"].value == 815, patience_s)
    assert picture.own.readings["part"].value == -1
    births = [payload for verb in (Verb.NBIRTH, Verb.DBIRTH) for _, payload in it.sent(verb)[-1:]]
    known = [
        metric.alias for payload in births for metric in payload.metrics if metric.name == "part" and metric.alias is not None
    ]
    assert len(known) == len(set(known)), f"one alias for two metrics: {known}"


def names(it: EdgePairing, patience_s: float) -> None:
    """Data by name."""
    it.data({**BY_NAME, "value": "2.25"}, lambda: it.device.readings["by name"].value == 2.25, patience_s)
    (*_, (_, data)) = it.sent(Verb.DDATA)
    (metric,) = data.metrics
    assert metric.alias is None and metric.name == "by name"


def datasets(it: EdgePairing, _patience_s: float) -> None:
    """A DataSet in the birth."""
    assert it.device.readings["offsets"].value == our_value(OFFSETS)


def templates(it: EdgePairing, _patience_s: float) -> None:
    """A definition in the NBIRTH and its instance in the DBIRTH."""
    picture = it.host.picture(it.node)
    value: Any = it.device.readings["x axis"].value
    assert (value.ref, [(m.name, m.value) for m in value.metrics]) == ("Axis", [("load", 37.5)])
    assert picture is not None and set(picture.own.templates) == {"Axis"}


def devices(it: EdgePairing, patience_s: float) -> None:
    """DDEATH and DBIRTH while the node lives."""
    it.tell(do="device death")
    it.until(lambda: not it.device.online, patience_s)
    assert not it.dead and it.device.readings["part"].quality is Quality.STALE
    it.tell(do="device birth")
    it.until(lambda: it.born, patience_s)
    it.data({**PART, "value": "3"}, lambda: it.device.readings["part"].value == 3, patience_s)


def wraps(it: EdgePairing, patience_s: float) -> None:
    """Sequence numbers past 255, more than twice: nothing lost, nothing doubted, each value once and in order."""
    before, first = it.host.counts, len(it.events)
    it.tell(do="run", count=WRAP, metric=PART)
    it.until(lambda: it.device.readings["part"].value == WRAP, patience_s)
    seen = [r.value for event in it.events[first:] if event.kind is EventKind.DATA for r in event.readings if r.name == "part"]
    assert seen == list(range(1, WRAP + 1))
    doubts = ("holes", "lost", "late", "sloppy_sequence", "rebirths_requested")
    assert {name: it.host.counts.get(name, 0) - before.get(name, 0) for name in doubts} == dict.fromkeys(doubts, 0)


def written(it: EdgePairing, patience_s: float) -> None:
    """A command for a metric of the device, by alias where the birth gave one."""
    assert it.host.send_command(it.node, DEVICE, [Change("part", 7, int(time.time() * 1000))])
    heard = it.hear(patience_s)
    (metric,) = heard["metrics"]
    birth = it.sent(Verb.DBIRTH)[-1][1]
    (alias,) = (declared.alias for declared in birth.metrics if declared.name == "part")
    assert heard["event"] == "command" and heard["device"] == DEVICE and metric["value"] == "7"
    assert metric["name"] == "part" or metric["alias"] == alias is not None


def rebirths(it: EdgePairing, patience_s: float) -> None:
    """Node Control/Rebirth of a host that comes later and asks for what it has missed."""
    count = len(it.sent(Verb.NBIRTH))
    later = host_of(it.broker, "later")
    later.start()
    deadline_s = time.monotonic() + patience_s
    try:
        while len(it.sent(Verb.NBIRTH)) == count:
            assert time.monotonic() < deadline_s, "no rebirth"
            it.tell(do="data", metrics=[{**PART, "value": "9"}])
            for _ in range(5):
                later.poll(0.05)
                it.events += it.host.poll(0.05)
        while (picture := later.picture(it.node)) is None or DEVICE not in picture.devices or not picture.devices[DEVICE].online:
            assert time.monotonic() < deadline_s, "no DBIRTH behind the NBIRTH"
            later.poll(0.05)
    finally:
        later.stop()


def reconnects(it: EdgePairing, patience_s: float) -> None:
    """The broker's restart. Our host is back first: not every peer can be asked for the birth that it would miss."""
    it.proxy.refuse()
    it.broker.restart()
    it.until(lambda: it.dead and it.host.online, patience_s)
    it.proxy.accept()
    it.until(lambda: it.born, patience_s)
    it.data({**PART, "value": "31"}, lambda: it.device.readings["part"].value == 31, patience_s)


def bd_seqs(it: EdgePairing, patience_s: float) -> None:
    """Each connection has the next bdSeq, in the will and in the NBIRTH."""
    count = len(it.sent(Verb.NBIRTH))
    it.proxy.cut()
    it.until(lambda: len(it.sent(Verb.NBIRTH)) > count, patience_s)
    it.until(lambda: it.born, patience_s)
    numbers = []
    for seen in it.proxy.recorded:
        if isinstance(seen.packet, Connect) and seen.packet.will is not None:
            in_will = _bd_seq(decode(seen.packet.will.payload))
            births = it.sent(Verb.NBIRTH, seen.connection)
            assert {_bd_seq(payload) for _, payload in births} <= {in_will}, "the NBIRTH has another bdSeq than the will"
            numbers += [in_will] if births else []
    after = numbers[-2:]
    assert after[1] == (after[0] + 1) % 256, f"bdSeq {after[1]} after {after[0]}"


def wills(it: EdgePairing, _patience_s: float) -> None:
    """The will is an NDEATH with QoS 1, not retained, with bdSeq and without seq."""
    (connect, *_) = it.proxy.packets("up", Connect)
    will = connect.will
    assert will is not None and Topic.parse(will.topic).verb is Verb.NDEATH
    payload = decode(will.payload)
    assert payload.seq is None and [metric.name for metric in payload.metrics] == ["bdSeq"]
    assert not will.retain and will.qos == 1, f"QoS {will.qos}"


def kills(it: EdgePairing, patience_s: float) -> None:
    """Kill -9: the will takes the node and its device offline, and everything becomes stale."""
    it.end()
    it.until(lambda: it.dead, patience_s)
    picture = it.host.picture(it.node)
    assert picture is not None
    assert {r.quality for _, owner in picture.owners() for r in owner.readings.values()} == {Quality.STALE}


def stops(it: EdgePairing, patience_s: float) -> None:
    """The end by its own will: an NDEATH that our host takes."""
    it.data(
        {**PART, "value": "77"}, lambda: it.device.readings["part"].value == 77, patience_s
    )  # it has done what it does after a birth
    it.tell(do="stop")
    try:
        it.until(lambda: it.dead, patience_s)
    finally:
        it.end()


def waits(it: EdgePairing, patience_s: float) -> None:
    """An edge node with a primary host is born when that host is online, and ends its session when it goes."""
    it.end()
    it.until(lambda: it.dead, patience_s)
    count = len(it.sent(Verb.NBIRTH))
    it.start("primary")
    try:
        with _quiet(it, count):
            deadline_s = time.monotonic() + QUIET_S
            while time.monotonic() < deadline_s:
                it.events += it.host.poll(0.05)
        primary = host_of(it.broker, "primary")
        primary.start()
        try:
            _poll_both(it, primary, lambda: it.born, patience_s)
        finally:
            primary.stop()
        it.until(lambda: it.dead, patience_s)
    finally:
        it.end()


@contextmanager
def _quiet(it: EdgePairing, births: int) -> Iterator[None]:
    yield
    assert len(it.sent(Verb.NBIRTH)) == births, "born without its primary host"


def _poll_both(it: EdgePairing, other: HostApplication, done: Callable[[], bool], timeout_s: float) -> None:
    deadline_s = time.monotonic() + timeout_s
    while not done():
        assert time.monotonic() < deadline_s, "in vain"
        other.poll(0.02)
        it.events += it.host.poll(0.02)


def _bd_seq(payload: Payload) -> Any:
    (metric,) = (metric for metric in payload.metrics if metric.name == "bdSeq")
    return metric.value


CHECKS: dict[str, Check] = {
    "birth": births,
    "certificate": dated,
    "qos": unretained,
    "null": nulls,
    "unit": units,
    "alias": aliases,
    "shared": shared,
    "name": names,
    "dataset": datasets,
    "template": templates,
    "device": devices,
    "wrap": wraps,
    "write": written,
    "rebirth": rebirths,
    "will": wills,
    "restart": reconnects,
    "bdseq": bd_seqs,
    "kill": kills,
    "stop": stops,
    "primary": waits,
}
