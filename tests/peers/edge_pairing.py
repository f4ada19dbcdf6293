"""An edge node of a peer beside a host application of ours."""

from __future__ import annotations

import json
import time
from collections.abc import Callable
from typing import Any

from sparkplug.broker import BrokerAddress
from sparkplug.codec import decode
from sparkplug.host import HostApplication, HostEvent
from sparkplug.metric import NodeId
from sparkplug.node_picture import Owner
from sparkplug.topics import Topic, Verb
from sparkplug.values import Payload
from tests.peers.counterpart import Counterpart
from tests.peers.metrics import (
    BY_NAME,
    DEFINITION,
    INSTANCE,
    NODE_PART,
    NOTHING,
    OFFSETS,
    PART,
    Line,
    scalars,
)
from tests.peers.pairing import DEVICE, Broker, Peer
from tests.wire.mqtt_packets import Publish
from tests.wire.proxy import Proxy

AGAIN_S = 5.0


def host_of(broker: Broker, host_id: str) -> HostApplication:
    """Return a host application of ours."""
    address = BrokerAddress(*broker.address)
    return HostApplication(address, host_id, reorder_timeout_ms=500, rebirth_interval_ms_min=500)


class EdgePairing(Counterpart):
    """An edge node of a peer behind a proxy that records it, and a host application of ours on the same broker."""

    def __init__(self, peer: Peer, broker: Broker, proxy: Proxy) -> None:
        super().__init__(peer)
        self.broker, self.proxy = broker, proxy
        self.node = NodeId("cnc", f"edge-{peer.name}")
        self.host = host_of(broker, "scada")
        self.events: list[HostEvent] = []
        self.host.start()

    def close(self) -> None:
        """End both sides."""
        self.end()
        self.host.stop()

    def lines(self) -> dict[str, list[Line]]:
        """Return the metrics that the peer declares: those that it can."""
        device = [*scalars(self.peer.types_lacking), PART, BY_NAME]
        optional = {"null": [NOTHING], "dataset": [OFFSETS], "template": [INSTANCE]}
        device += [line for check, lines in optional.items() if check not in self.peer.lacks for line in lines]
        node = [NODE_PART] + ([] if "template" in self.peer.lacks else [DEFINITION])
        return {"node": node, "device": device}

    def start(self, primary: str = "") -> None:
        """Start the peer's program, with or without a primary host."""
        self.begin("edge", *map(str, self.proxy.address), *self.node, primary)
        self.tell(**self.lines())
        while self.hear()["event"] != "started":
            pass

    def hear(self, timeout_s: float = 90.0) -> dict[str, Any]:
        """Return the next line of the program."""
        said: dict[str, Any] = json.loads(self.theirs.hear(timeout_s))
        return said

    def until(self, done: Callable[[], bool], timeout_s: float) -> None:
        """Poll our host until `done`."""
        deadline_s = time.monotonic() + timeout_s
        while not done():
            assert time.monotonic() < deadline_s, f"in vain; {self.host.counts}, {self.events[-3:]}"
            self.events += self.host.poll(0.05)

    def data(self, metric: Line, shows: Callable[[], bool], timeout_s: float) -> None:
        """Have the peer send a metric of its device until our host shows it.

        QoS 0: what a peer sends while its connection is lost is lost as well, and a peer that has just been born again may still
        take itself for disconnected. So it is told to send again after each birth, and every AGAIN_S.
        """
        told_at_births, told_s = -1, 0.0

        def is_shown() -> bool:
            nonlocal told_at_births, told_s
            births, now_s = self.host.counts.get("births", 0), time.monotonic()
            if self.born and (births != told_at_births or now_s - told_s > AGAIN_S):
                told_at_births, told_s = births, now_s
                self.tell(do="data", metrics=[metric])
            return self.born and shows()

        self.until(is_shown, timeout_s)

    def ready(self, timeout_s: float) -> None:
        """Have a peer that runs and is born, whatever came before; our host is there first."""
        self.until(lambda: self.host.online, timeout_s)
        if self.process is None:
            births = self.host.counts.get("births", 0)
            self.start()
            self.until(lambda: self.host.counts.get("births", 0) >= births + 2, timeout_s)  # of node and device
        self.until(lambda: self.born, timeout_s)

    @property
    def device(self) -> Owner:
        """Return what our host knows of the device."""
        picture = self.host.picture(self.node)
        assert picture is not None
        return picture.devices[DEVICE]

    @property
    def born(self) -> bool:
        """Return True where node and device are online."""
        picture = self.host.picture(self.node)
        return picture is not None and picture.online and DEVICE in picture.devices and picture.devices[DEVICE].online

    @property
    def dead(self) -> bool:
        """Return True where the node is offline."""
        picture = self.host.picture(self.node)
        return picture is not None and not picture.online

    def sent(self, verb: Verb, connection: int | None = None) -> list[tuple[Publish, Payload]]:
        """Return what the peer published, as bytes and as we read it."""
        packets = self.proxy.packets("up", Publish, connection=connection)
        return [(packet, decode(packet.payload)) for packet in packets if Topic.parse(packet.topic).verb is verb]

    def counted(self, *names: str) -> dict[str, int]:
        """Return counts of our host that are not zero."""
        return {name: self.host.counts[name] for name in names if self.host.counts.get(name)}
