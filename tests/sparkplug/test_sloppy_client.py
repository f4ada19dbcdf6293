"""Our host application against a real edge node that is not ours, `sparkplug-client` 3.2.4, over a real Mosquitto.

It is sloppy: its will has QoS 0, its bdSeq is a UInt64 that is always 0, its metrics carry no time stamps, it offers no
`Node Control/Rebirth`, and without `publishDeath` it ends without a word. All of it is taken as it comes.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator
from contextlib import ExitStack, contextmanager

import pytest

from sparkplug.broker import BrokerAddress
from sparkplug.codec import decode
from sparkplug.datatype import DataType
from sparkplug.host import EventKind, HostApplication, HostEvent
from sparkplug.metric import Change, NodeId
from sparkplug.node_picture import NodePicture
from sparkplug.quality import Quality
from sparkplug.topics import Topic, Verb
from tests.peers.npm_peer import NodeProcess
from tests.wire.mosquitto import Mosquitto
from tests.wire.mqtt_packets import Connect, Publish
from tests.wire.proxy import Proxy

pytestmark = [pytest.mark.node, pytest.mark.broker]

NODE = NodeId("cnc", "js")
PATIENCE_S = 60.0


class Listening:
    """A host application and all its events."""

    def __init__(self, application: HostApplication) -> None:
        self.application = application
        self.events: list[HostEvent] = []

    def until(self, done: Callable[[], bool], timeout_s: float = PATIENCE_S) -> None:
        """Poll until `done`."""
        deadline_s = time.monotonic() + timeout_s
        while not done():
            assert time.monotonic() < deadline_s, f"in vain; {self.application.counts}, {self.events[-3:]}"
            self.events += self.application.poll(0.05)

    def for_seconds(self, seconds: float) -> None:
        """Poll for a while."""
        deadline_s = time.monotonic() + seconds
        while time.monotonic() < deadline_s:
            self.events += self.application.poll(0.05)

    @property
    def picture(self) -> NodePicture:
        """Return what is known of the node."""
        picture = self.application.picture(NODE)
        assert picture is not None
        return picture

    @property
    def born(self) -> bool:
        """Return whether node and device are."""
        picture = self.application.picture(NODE)
        return picture is not None and picture.online and "lathe" in picture.devices and picture.devices["lathe"].online

    @property
    def part(self) -> object:
        """The counter that the device publishes."""
        return self.picture.devices["lathe"].readings["part"].value if self.born else None


@contextmanager
def listening(broker: Mosquitto, mqtt_version: int = 4, again_ms: int = 100) -> Iterator[Listening]:
    """A host application that is online; its requests for a rebirth are a tenth of a second apart, so that a loop would show."""
    application = HostApplication(
        BrokerAddress(port=broker.port),
        "scada",
        reorder_timeout_ms=200,
        rebirth_interval_ms_min=again_ms,
        mqtt_version=mqtt_version,
    )
    application.start()
    host = Listening(application)
    try:
        host.until(lambda: application.online)
        yield host
    finally:
        application.stop()


@contextmanager
def client(address: tuple[str, int], *, publish_death: bool = False) -> Iterator[NodeProcess]:
    """The peer, born."""
    url = f"mqtt://{address[0]}:{address[1]}"
    with NodeProcess("client.mjs", url, *NODE, str(publish_death).lower()) as process:
        assert process.hear() == "birth"
        yield process


@pytest.mark.parametrize("mqtt_version", [4, 5])
def test_its_births_and_data_are_taken_without_a_question(mosquitto: Mosquitto, mqtt_version: int) -> None:
    with listening(mosquitto, mqtt_version) as host, client(mosquitto.address) as peer:
        host.until(lambda: host.born)
        born = host.picture.devices["lathe"].readings
        assert {name: (r.value, r.quality, r.unit) for name, r in born.items()} == {
            "load": (37.5, Quality.GOOD, "%"),
            "part": (0, Quality.GOOD, None),
            "mode": (None, Quality.GOOD, None),
        }
        assert host.picture.own.readings["uptime"].value == 12
        assert all(abs(r.timestamp_ms - time.time() * 1000) < 60_000 for r in born.values()), "the payload's time stands in"
        peer.tell("data 600")
        host.until(lambda: host.part == 600)
        host.for_seconds(0.5)
    seen = [r.value for event in host.events if event.kind is EventKind.DATA for r in event.readings]
    assert seen == list(range(1, 601))
    counts = host.application.counts
    assert {name: counts.get(name, 0) for name in ("holes", "malformed", "late", "rebirths_requested")} == dict.fromkeys(
        ("holes", "malformed", "late", "rebirths_requested"), 0
    )


def test_a_host_that_comes_later_asks_once_and_is_answered(mosquitto: Mosquitto) -> None:
    with ExitStack() as stack:
        with listening(mosquitto) as earlier:  # it sees the birth; else this could be on its way still when the later one listens
            peer = stack.enter_context(client(mosquitto.address))
            earlier.until(lambda: earlier.born)
        host = stack.enter_context(listening(mosquitto, again_ms=2000))
        peer.tell("data 3")
        host.until(lambda: host.born)
        assert [peer.hear() for _ in range(3)] == ["data 3", "ncmd Node Control/Rebirth true", "birth"]
        peer.tell("data 50")
        host.until(lambda: host.part == 53)
        host.for_seconds(2.5)  # if it were not content, it would ask again meanwhile
        assert host.application.counts["rebirths_requested"] == 1
        assert host.application.counts["births"] == 2


def test_kill_9_makes_everything_stale(mosquitto: Mosquitto) -> None:
    with listening(mosquitto) as host, client(mosquitto.address) as peer:
        host.until(lambda: host.born)
        peer.kill()
        host.until(lambda: not host.picture.online)
        readings = [r for _, owner in host.picture.owners() for r in owner.readings.values()]
        assert len(readings) == 4 and {r.quality for r in readings} == {Quality.STALE}
        host.for_seconds(0.5)
        assert host.application.counts.get("rebirths_requested", 0) == 0, "a dead node is not asked"


def test_a_restart_is_taken_although_its_bd_seq_is_zero_again(mosquitto: Mosquitto) -> None:
    with listening(mosquitto) as host:
        for life in (1, 2):
            with client(mosquitto.address) as peer:
                host.until(lambda: host.born)
                peer.tell("data 5")
                host.until(lambda: host.part == 5)
            host.until(lambda: not host.picture.online)
            assert host.application.counts["births"] == 2 * life
        assert host.application.counts.get("rebirths_requested", 0) == 0


def test_a_stop_that_publishes_its_death_is_seen(mosquitto: Mosquitto) -> None:
    with listening(mosquitto) as host, client(mosquitto.address, publish_death=True) as peer:
        host.until(lambda: host.born)
        peer.tell("stop")
        host.until(lambda: not host.picture.online)
        assert [event.device for event in host.events if event.kind is EventKind.DEATH] == [None, "lathe"]


def test_a_stop_without_a_word_cannot_be_seen_by_any_host(mosquitto: Mosquitto) -> None:
    with listening(mosquitto) as host, client(mosquitto.address) as peer:
        host.until(lambda: host.born)
        peer.tell("stop")
        host.for_seconds(1.0)
        assert host.picture.online


def test_a_command_reaches_it(mosquitto: Mosquitto) -> None:
    with listening(mosquitto) as host, client(mosquitto.address) as peer:
        host.until(lambda: host.born)
        assert host.application.send_command(NODE, None, [Change("uptime", 0, 1)])
        assert peer.hear() == "ncmd uptime 0"


def test_this_is_how_sloppy_it_is(mosquitto: Mosquitto, proxy: Proxy) -> None:
    with listening(mosquitto) as host, client(proxy.address) as peer:
        host.until(lambda: host.born)
        peer.tell("data 1")
        host.until(lambda: host.part == 1)
    (connect,) = proxy.packets("up", Connect)
    assert connect.will is not None and connect.will.qos == 0
    sent = [(Topic.parse(packet.topic), decode(packet.payload)) for packet in proxy.packets("up", Publish)]
    births = [payload for topic, payload in sent if topic.verb is Verb.NBIRTH]
    names = {metric.name: metric for metric in births[0].metrics}
    assert names["bdSeq"].datatype is DataType.UINT64
    assert "Node Control/Rebirth" not in names
    assert all(metric.timestamp_ms is None for _, payload in sent for metric in payload.metrics)
