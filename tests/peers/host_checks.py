"""The checks of a host application of a peer against our edge node: `CHECKS` has them in the order in which they are made."""

from __future__ import annotations

import json
import queue
import time
from collections.abc import Callable
from typing import Any

from sparkplug.broker import BrokerAddress
from sparkplug.edge_node import EdgeNode
from sparkplug.edge_session import Command
from sparkplug.metric import Change, NodeId
from sparkplug.topics import Topic, Verb, state_topic
from tests.peers.metrics import (
    DEFINITION,
    INSTANCE,
    NODE_PART,
    NOTHING,
    OFFSETS,
    PART,
    Line,
    agree,
    datatype_of,
    our_value,
    scalars,
    spec_of,
)
from tests.peers.pairing import PATIENCE_S, Broker, Peer
from tests.peers.process import PeerProcess
from tests.peers.toolchain import command_of
from tests.wire.mqtt_packets import Connect, Publish
from tests.wire.proxy import Proxy

QUIET_S = 2.0
WRAP = 600
DEVICE = "lathe"
SMALL = ("Int8/0", "Int16/0")


class HostPairing:
    """A host application of a peer and an edge node of ours, each behind a proxy of its own."""

    def __init__(self, peer: Peer, broker: Broker, theirs: Proxy, ours: Proxy) -> None:
        self.peer, self.broker, self.wire_of_host, self.wire_of_edge = peer, broker, theirs, ours
        self.host_id = f"host-{peer.name}"
        self.process: PeerProcess | None = None
        self.heard: list[dict[str, Any]] = []
        self.commands: queue.SimpleQueue[Command] = queue.SimpleQueue()
        self.edge = self._edge(NodeId("cnc", f"ours-{peer.name}"), ours)
        self.edge.start()

    def _edge(self, node: NodeId, proxy: Proxy, primary: str | None = None) -> EdgeNode:
        templates: dict[str, Any] = {} if "template" in self.peer.lacks else {"Axis": our_value(DEFINITION)}
        optional = {"dataset": OFFSETS, "template": INSTANCE}
        lines = [*self.scalars(), PART, NOTHING]
        lines += [line for check, line in optional.items() if check not in self.peer.lacks]
        self.node = node
        edge = EdgeNode(
            BrokerAddress(*proxy.address),
            node,
            [spec_of(NODE_PART)],
            primary_host=primary,
            templates=templates,
            on_command=self.commands.put,
        )
        edge.declare_device(DEVICE, [spec_of(line) for line in lines])
        self.specs = [spec_of(line) for line in lines]
        return edge

    def scalars(self, *, small: bool = False) -> list[Line]:
        """Return the metrics of the scalar types: negative ones of 8 and 16 bits, or all others."""
        return [line for line in scalars(self.peer.types_lacking) if (line["name"] in SMALL) == small]

    def close(self) -> None:
        """End both sides."""
        self.end()
        self.edge.stop()

    def end(self) -> None:
        """Kill the peer's program."""
        if self.process is not None:
            self.process.kill()
            self.process = None

    def ready(self, timeout_s: float) -> None:
        """Have a peer that runs and knows our edge node, whatever came before."""
        if self.process is None:
            self.start(timeout_s)
            until(lambda: self.edge.online, timeout_s)
            self.ask_rebirth()
        self.until(lambda: self.has("birth", DEVICE), timeout_s)

    def start(self, timeout_s: float) -> None:
        """Start the peer's program, and wait until it has said that it is online."""
        count = len(self.states())
        self.heard.clear()
        command, folder = command_of(self.peer.name)
        self.process = PeerProcess([*command, "host", *map(str, self.wire_of_host.address), "cnc", self.host_id], folder)
        self.until(lambda: self.has("started"), timeout_s)
        until(lambda: len(self.states()) > count, timeout_s)

    def ask_rebirth(self) -> None:
        """Have the peer command a rebirth."""
        metric = {"name": "Node Control/Rebirth", "type": "Boolean", "value": "true"}
        self.tell(do="rebirth", node=self.node.node, metrics=[metric])

    def tell(self, **line: Any) -> None:
        """Write a line to the program."""
        assert self.process is not None
        self.process.tell(json.dumps(line))

    def until(self, done: Callable[[], bool], timeout_s: float) -> None:
        """Read the program's lines until `done`."""
        assert self.process is not None
        deadline_s = time.monotonic() + timeout_s
        while not done():
            left_s = deadline_s - time.monotonic()
            assert left_s > 0, f"in vain; {str(self.heard[-3:])[:600]}"
            self.heard.append(json.loads(self.process.hear(left_s)))

    def has(self, event: str, device: str | None = None, after: int = 0) -> bool:
        """Return True where the peer has said so."""
        return any(line["event"] == event and line.get("device") == device for line in self.heard[after:])

    def metrics(self, event: str, after: int = 0) -> dict[str, Line]:
        """Return what the peer said last of each metric of the device."""
        lines = [line for line in self.heard[after:] if line["event"] == event and line["device"] == DEVICE]
        return {metric["name"]: metric for line in lines for metric in line["metrics"]}

    def publish(self, *changes: tuple[str, Any]) -> None:
        """Send one DDATA of ours."""
        now_ms = int(time.time() * 1000)
        assert self.edge.publish(DEVICE, [Change(name, value, now_ms) for name, value in changes])

    def states(self) -> list[tuple[Publish, Any]]:
        """Return the STATE messages that the peer published."""
        packets = self.wire_of_host.packets("up", Publish)
        return [(packet, json.loads(packet.payload)) for packet in packets if packet.topic == state_topic(self.host_id)]

    def births(self) -> int:
        """Return how many NBIRTHs ours has sent."""
        return sum(Topic.parse(packet.topic).verb is Verb.NBIRTH for packet in self.wire_of_edge.packets("up", Publish))


Check = Callable[[HostPairing, float], None]


def until(done: Callable[[], bool], timeout_s: float) -> None:
    """Wait until `done`."""
    deadline_s = time.monotonic() + timeout_s
    while not done():
        assert time.monotonic() < deadline_s, "in vain"
        time.sleep(0.02)


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
