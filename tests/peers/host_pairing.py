"""A host application of a peer beside an edge node of ours."""

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
from tests.peers.counterpart import Counterpart
from tests.peers.metrics import (
    DEFINITION,
    INSTANCE,
    NODE_PART,
    NOTHING,
    OFFSETS,
    PART,
    Line,
    our_value,
    scalars,
    spec_of,
)
from tests.peers.pairing import DEVICE, Broker, Peer
from tests.wire.mqtt_packets import Publish
from tests.wire.proxy import Proxy

SMALL = ("Int8/0", "Int16/0")


class HostPairing(Counterpart):
    """A host application of a peer and an edge node of ours, each behind a proxy of its own."""

    def __init__(self, peer: Peer, broker: Broker, theirs: Proxy, ours: Proxy) -> None:
        super().__init__(peer)
        self.broker, self.wire_of_host, self.wire_of_edge = broker, theirs, ours
        self.host_id = f"host-{peer.name}"
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
        self.begin("host", *map(str, self.wire_of_host.address), "cnc", self.host_id)
        self.until(lambda: self.has("started"), timeout_s)
        until(lambda: len(self.states()) > count, timeout_s)

    def ask_rebirth(self) -> None:
        """Have the peer command a rebirth."""
        metric = {"name": "Node Control/Rebirth", "type": "Boolean", "value": "true"}
        self.tell(do="rebirth", node=self.node.node, metrics=[metric])

    def until(self, done: Callable[[], bool], timeout_s: float) -> None:
        """Read the program's lines until `done`."""
        deadline_s = time.monotonic() + timeout_s
        while not done():
            left_s = deadline_s - time.monotonic()
            assert left_s > 0, f"in vain; {str(self.heard[-3:])[:600]}"
            self.heard.append(json.loads(self.theirs.hear(left_s)))

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


def until(done: Callable[[], bool], timeout_s: float) -> None:
    """Wait until `done`."""
    deadline_s = time.monotonic() + timeout_s
    while not done():
        assert time.monotonic() < deadline_s, "in vain"
        time.sleep(0.02)
