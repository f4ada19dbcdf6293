"""The checks of a host application of a peer against our edge node: `CHECKS` has them in the order in which they are made."""

from __future__ import annotations

import json
import time
from collections.abc import Callable

from sparkplug.metric import NodeId
from sparkplug.topics import state_topic
from tests.peers.host_pairing import HostPairing, until
from tests.peers.metrics import (
    NOTHING,
    OFFSETS,
    PART,
    agree,
    datatype_of,
    spec_of,
)
from tests.peers.pairing import DEVICE, PATIENCE_S, QUIET_S, WRAP
from tests.wire.mqtt_packets import Connect

Check = Callable[[HostPairing, float], None]


def births(it: HostPairing, _patience_s: float) -> None:
    """Each scalar type at its limits, with its datatype."""
    known = it.metrics("birth")
    wrong = [
        f"{line['name']}: {heard and (heard['type'], heard['value'])}"
        for line in it.scalars()
        if (heard := known.get(line["name"])) is None or not agree(line, heard) or datatype_of(heard) is not datatype_of(line)
    ]
    assert not wrong, wrong


def smalls(it: HostPairing, patience_s: float) -> None:
    """Negative numbers of 8 and 16 bits, on a device of their own: they are sign-extended to 32 bits on the wire."""
    after = len(it.heard)
    it.edge.declare_device("small", [spec_of(line) for line in it.scalars(small=True)])
    try:
        it.until(lambda: it.has("birth", "small", after), patience_s)
        (birth,) = [line for line in it.heard[after:] if (line["event"], line["device"]) == ("birth", "small")]
        assert [metric["value"] for metric in birth["metrics"]] == ["-128", "-32768"]
    finally:
        it.edge.remove_device("small")
        it.end()


def nulls(it: HostPairing, patience_s: float) -> None:
    """A null in the birth, a value, and a null in data."""
    assert it.metrics("birth")["nothing"]["value"] is None
    for value in (5, None):
        after = len(it.heard)
        it.publish(("nothing", value))
        it.until(lambda after=after: it.has("data", DEVICE, after), patience_s)  # type: ignore[misc]
        assert agree({**NOTHING, "value": None if value is None else str(value)}, it.metrics("data", after)["nothing"])


def units(it: HostPairing, _patience_s: float) -> None:
    """The property engUnit of a birth."""
    assert it.metrics("birth")["part"]["unit"] == PART["unit"]


def aliases(it: HostPairing, patience_s: float) -> None:
    """Our data, which carry aliases and no names or datatypes."""
    after = len(it.heard)
    it.publish(("part", 4711), ("Int64/0", -5), ("UInt64/1", 2**64 - 1), ("String/1", "Ö"))
    it.until(lambda: len(it.metrics("data", after)) == 4, patience_s)
    said = {name: metric["value"] for name, metric in it.metrics("data", after).items()}
    assert said == {"part": "4711", "Int64/0": "-5", "UInt64/1": str(2**64 - 1), "String/1": "Ö"}


def datasets(it: HostPairing, _patience_s: float) -> None:
    """A DataSet in the birth."""
    table = it.metrics("birth")["offsets"]["value"]
    assert (table["columns"], table["rows"]) == (OFFSETS["value"]["columns"], OFFSETS["value"]["rows"])


def templates(it: HostPairing, _patience_s: float) -> None:
    """An instance in the DBIRTH."""
    value = it.metrics("birth")["x axis"]["value"]
    assert (value["ref"], [(m["name"], float(m["value"])) for m in value["metrics"]]) == ("Axis", [("load", 37.5)])


def devices(it: HostPairing, patience_s: float) -> None:
    """DDEATH and DBIRTH while the node lives, with the aliases of before, and data behind them without a rebirth of all."""
    after, count = len(it.heard), it.births()
    it.edge.remove_device(DEVICE)
    it.until(lambda: it.has("death", DEVICE, after), patience_s)
    assert not it.has("death", None, after)
    it.edge.declare_device(DEVICE, it.specs)
    it.until(lambda: it.has("birth", DEVICE, after), patience_s)
    it.publish(("part", 3))
    it.until(lambda: it.metrics("data", after).get("part", {}).get("value") == "3", patience_s)
    time.sleep(QUIET_S)
    assert it.births() == count


def wraps(it: HostPairing, patience_s: float) -> None:
    """Sequence numbers past 255, more than twice: each value once and in order, and no rebirth asked for."""
    after, count = len(it.heard), it.births()
    for number in range(1, WRAP + 1):
        it.publish(("part", number))
    it.until(lambda: it.metrics("data", after).get("part", {}).get("value") == str(WRAP), patience_s)
    lines = [line for line in it.heard[after:] if line["event"] == "data"]
    assert [int(metric["value"]) for line in lines for metric in line["metrics"]] == list(range(1, WRAP + 1))
    assert it.births() == count


def written(it: HostPairing, patience_s: float) -> None:
    """A command for a metric of our device."""
    alias = it.metrics("birth")["part"].get("alias")
    it.tell(do="write", node=it.node.node, device=DEVICE, metrics=[{**PART, "value": "7", "alias": alias}])
    while (command := it.commands.get(timeout=patience_s)).device is None:
        pass  # the rebirth that began the pairing
    assert (command.device, command.name, command.value) == (DEVICE, "part", 7)


def rebirths(it: HostPairing, patience_s: float) -> None:
    """Node Control/Rebirth, commanded by the peer."""
    after, count = len(it.heard), it.births()
    it.ask_rebirth()
    until(lambda: it.births() > count, patience_s)
    it.until(lambda: it.has("birth", DEVICE, after), patience_s)


def late(it: HostPairing, patience_s: float) -> None:
    """A host that comes later asks for a rebirth by itself when it hears of a node that it does not know."""
    it.end()
    count = it.births()
    it.start(PATIENCE_S)
    deadline_s = time.monotonic() + patience_s
    try:
        while it.births() == count:
            assert time.monotonic() < deadline_s, "it asked for nothing"
            it.publish(("part", 1))
            time.sleep(0.2)
        it.until(lambda: it.has("birth", DEVICE), patience_s)
    except AssertionError:
        it.end()
        raise


def deaths(it: HostPairing, patience_s: float) -> None:
    """The will of our edge node, whose bdSeq the peer has to compare, and the birth behind it."""
    after = len(it.heard)
    it.wire_of_edge.cut()
    it.until(lambda: it.has("death", None, after), patience_s)
    it.until(lambda: it.has("birth", DEVICE, after), patience_s)


def states(it: HostPairing, _patience_s: float) -> None:
    """The will on STATE and the birth on it: QoS 1, retained, the same time stamp, in JSON."""
    (connect, *_) = it.wire_of_host.packets("up", Connect)
    will = connect.will
    assert will is not None and will.topic == state_topic(it.host_id)
    assert (will.qos, will.retain) == (1, True)
    (packet, birth), *_ = it.states()
    assert (packet.qos, packet.retain, birth["online"]) == (1, True, True)
    dead = json.loads(will.payload)
    assert dead["online"] is False and dead["timestamp"] == birth["timestamp"]


def restamps(it: HostPairing, patience_s: float) -> None:
    """Each connection has a will with a new time stamp, which its STATE repeats."""
    first = len(it.states())
    it.wire_of_host.cut()
    until(lambda: any(state["online"] for _, state in it.states()[first:]), patience_s)
    wills = [json.loads(c.will.payload)["timestamp"] for c in it.wire_of_host.packets("up", Connect) if c.will is not None]
    assert wills[-1] > wills[0], "the will of the second connection has the time stamp of the first"
    assert it.states()[-1][1]["timestamp"] == wills[-1]


def reconnects(it: HostPairing, patience_s: float) -> None:
    """The broker's restart: the host says again that it is online, and our data arrive."""
    first = len(it.states())
    it.broker.restart()
    until(lambda: any(state["online"] for _, state in it.states()[first:]) and it.edge.online, patience_s)
    after = len(it.heard)
    it.ask_rebirth()
    it.until(lambda: it.has("birth", DEVICE, after), patience_s)
    it.publish(("part", 31))
    it.until(lambda: it.metrics("data", after).get("part", {}).get("value") == "31", patience_s)


def waited_for(it: HostPairing, patience_s: float) -> None:
    """An edge node of ours whose primary host the peer is: born when its STATE says online, its session over when it goes."""
    it.end()
    proxy = it.wire_of_edge
    edge = it._edge(NodeId("cnc", f"waiting-{it.peer.name}"), proxy, it.host_id)
    edge.start()
    try:
        time.sleep(QUIET_S)
        assert not edge.online, "born without its primary host"
        it.start(PATIENCE_S)
        until(lambda: edge.online, patience_s)
        it.tell(do="stop")
        until(lambda: not edge.online, patience_s)
    finally:
        edge.stop()
        it.end()


CHECKS: dict[str, Check] = {
    "birth": births,
    "null": nulls,
    "unit": units,
    "alias": aliases,
    "dataset": datasets,
    "template": templates,
    "device": devices,
    "wrap": wraps,
    "write": written,
    "rebirth": rebirths,
    "state": states,
    "restamp": restamps,
    "death": deaths,
    "restart": reconnects,
    "late": late,
    "small": smalls,
    "primary": waited_for,
}
