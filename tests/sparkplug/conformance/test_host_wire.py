"""A host application as its broker sees it: a recording proxy stands between HostApplication and a real Mosquitto."""

import json
import time
from collections.abc import Callable, Iterator
from contextlib import AbstractContextManager
from typing import Any

import paho.mqtt.publish
import pytest

from sparkplug.broker import BrokerAddress
from sparkplug.codec import parse
from sparkplug.host import HostApplication
from tests.sparkplug.conformance.life import EPOCH_MS, HOST_ID, NODE, STATE_TOPIC, change, whole_edge_life
from tests.wire.mosquitto import Mosquitto
from tests.wire.mqtt_packets import Acknowledgement, Connack, Connect, Disconnect, Packet, Publish, Suback, Subscribe, Will
from tests.wire.proxy import Proxy

pytestmark = [pytest.mark.broker, pytest.mark.usefixtures("way")]

CLOCK_S_MAX = 10.0


def _poll_until(host: HostApplication, proxy: Proxy, matches: Callable[[Packet], bool], count: int = 1) -> None:
    """Poll as an application does, until the proxy has seen `count` such packets."""
    deadline_s = time.monotonic() + 60.0
    while sum(matches(packet) for packet in proxy.packets()) < count:
        assert time.monotonic() < deadline_s, f"{count} packets did not come"
        host.poll(0.05)


def _birth(packet: Packet) -> bool:
    return isinstance(packet, Publish) and packet.topic == STATE_TOPIC and b"true" in packet.payload


def _own_birth(packet: Packet) -> bool:
    return _birth(packet) and isinstance(packet, Publish) and packet.qos == 1 and packet.retain


def _live(broker: Mosquitto, proxy: Proxy, version: int) -> None:
    """Birth, a command, news of its own death, a cut, the next birth, and the end."""
    host = HostApplication(BrokerAddress(port=proxy.port), HOST_ID, ("spBv1.0/cnc/#",), mqtt_version=version)
    host.start()
    _poll_until(host, proxy, lambda packet: isinstance(packet, Publish) and _birth(packet), count=2)
    for sent in whole_edge_life().sent[:2]:
        _say(broker, sent.raw.topic, sent.raw.payload)
    while host.picture(NODE) is None or not host.picture(NODE).devices:  # type: ignore[union-attr]
        host.poll(0.05)
    assert host.send_command(NODE, "okuma", [change("tool_number", 5, EPOCH_MS)])
    _poll_until(host, proxy, lambda packet: isinstance(packet, Publish) and "DCMD" in packet.topic)
    _say(broker, STATE_TOPIC, b'{"online":false,"timestamp":1}', retain=True)
    _poll_until(host, proxy, _is_up_birth(proxy, 2))
    _poll_until(host, proxy, lambda _: _pubacks(proxy, 0) >= 2)  # else it would be sent once more after the cut
    proxy.cut()
    _poll_until(host, proxy, _is_up_birth(proxy, 3))
    _poll_until(host, proxy, lambda _: _pubacks(proxy, 1) >= 1)
    host.stop()
    proxy.wait_for(lambda packet: isinstance(packet, Disconnect))


def _pubacks(proxy: Proxy, connection: int) -> int:
    return sum(packet.kind == "puback" for packet in proxy.packets("down", Acknowledgement, connection=connection))


def _is_up_birth(proxy: Proxy, count: int) -> Callable[[Packet], bool]:
    """Matches as soon as the host itself has published `count` births."""
    return lambda _: sum(_birth(packet) for packet in proxy.packets("up", Publish)) >= count


def _say(broker: Mosquitto, topic: str, payload: bytes, *, retain: bool = False) -> None:
    """Publish as somebody else, past the proxy."""
    paho.mqtt.publish.single(topic, payload, qos=1, retain=retain, hostname="127.0.0.1", port=broker.port)


@pytest.fixture(scope="module")
def new_broker() -> Callable[[], AbstractContextManager[Mosquitto]]:
    """At which broker the lives are lived; tests/hivemq has another one."""
    return Mosquitto


@pytest.fixture(scope="module")
def lives(way: str, new_broker: Callable[[], AbstractContextManager[Mosquitto]]) -> Iterator[dict[int, Proxy]]:
    """The recordings of the same life with MQTT 3.1.1 (4) and with MQTT 5."""
    recordings = {}
    for version in (4, 5):
        with new_broker() as broker, Proxy(broker.address) as proxy:
            _live(broker, proxy, version)
            recordings[version] = proxy
    yield recordings


both = pytest.mark.parametrize("version", [4, 5], ids=["MQTT 3.1.1", "MQTT 5"])


def _state(message: Publish | Will) -> dict[str, Any]:
    state: dict[str, Any] = json.loads(message.payload.decode("utf-8"))
    return state


def _births(proxy: Proxy, connection: int) -> list[Publish]:
    return [packet for packet in proxy.packets("up", Publish, connection=connection) if _birth(packet)]


@pytest.mark.tck("tck-id-message-flow-phid-sparkplug-clean-session-311")
def test_with_mqtt_311_the_session_is_clean(lives: dict[int, Proxy]) -> None:
    connects = lives[4].packets("up", Connect)
    assert [(connect.version, connect.clean) for connect in connects] == [(4, True), (4, True)]


@pytest.mark.tck("tck-id-message-flow-phid-sparkplug-clean-session-50")
def test_with_mqtt_5_the_start_is_clean_and_the_session_ends_with_the_connection(lives: dict[int, Proxy]) -> None:
    connects = lives[5].packets("up", Connect)
    assert [(connect.version, connect.clean) for connect in connects] == [(5, True), (5, True)]
    assert all(dict(connect.properties).get("session_expiry_interval", 0) == 0 for connect in connects)


@both
@pytest.mark.tck(
    "tck-id-host-topic-phid-death-required",
    "tck-id-host-topic-phid-death-payload-timestamp-connect",
    "tck-id-operational-behavior-host-application-connect-will",
    "tck-id-operational-behavior-host-application-connect-will-topic",
    "tck-id-operational-behavior-host-application-connect-will-payload",
    "tck-id-operational-behavior-host-application-connect-will-qos",
    "tck-id-operational-behavior-host-application-connect-will-retained",
    "tck-id-payloads-state-will-message",
    "tck-id-payloads-state-will-message-qos",
    "tck-id-payloads-state-will-message-retain",
    "tck-id-payloads-state-will-message-payload",
)
def test_the_will_stands_in_the_connect_with_the_time_of_the_connect(lives: dict[int, Proxy], version: int) -> None:
    proxy = lives[version]
    stamps = []
    for connect in proxy.packets("up", Connect):
        assert connect.will is not None
        assert (connect.will.topic, connect.will.qos, connect.will.retain) == (STATE_TOPIC, 1, True)
        state = _state(connect.will)
        assert (set(state), state["online"]) == ({"online", "timestamp"}, False)
        stamps.append(state["timestamp"])
    seen_s = [seen.at_s for seen in proxy.recorded if isinstance(seen.packet, Connect)]
    wall_ms = time.time() * 1000 - time.monotonic() * 1000
    for stamp, at_s in zip(stamps, seen_s, strict=True):
        assert abs(stamp - (wall_ms + at_s * 1000)) < CLOCK_S_MAX * 1000


@both
@pytest.mark.tck(
    "tck-id-host-topic-phid-birth-message",
    "tck-id-host-topic-phid-birth-qos",
    "tck-id-host-topic-phid-birth-retain",
    "tck-id-host-topic-phid-birth-topic",
    "tck-id-host-topic-phid-birth-sub-required",
    "tck-id-host-topic-phid-birth-required",
    "tck-id-message-flow-phid-sparkplug-subscription",
    "tck-id-message-flow-phid-sparkplug-state-publish",
    "tck-id-operational-behavior-host-application-connect-birth",
    "tck-id-operational-behavior-host-application-connect-birth-topic",
    "tck-id-operational-behavior-host-application-connect-birth-qos",
    "tck-id-operational-behavior-host-application-connect-birth-retained",
    "tck-id-operational-behavior-primary-application-state-with-multiple-servers-state",
    "tck-id-payloads-state-subscribe",
    "tck-id-payloads-state-birth",
    "tck-id-principles-birth-certificates-order",
)
def test_after_the_connack_come_the_subscriptions_and_then_the_birth(lives: dict[int, Proxy], version: int) -> None:
    proxy = lives[version]
    for number in (0, 1):
        connect, own, nodes, birth = proxy.packets("up", connection=number)[:4]
        assert isinstance(connect, Connect)
        assert isinstance(own, Subscribe)
        assert [name for name, _ in own.filters] == [STATE_TOPIC]
        assert isinstance(nodes, Subscribe)
        assert [name for name, _ in nodes.filters] == ["spBv1.0/cnc/#"]
        assert isinstance(birth, Publish)
        assert (birth.topic, birth.qos, birth.retain) == (STATE_TOPIC, 1, True)
        times_s = {type(seen.packet): seen.at_s for seen in reversed(proxy.recorded) if seen.connection == number}
        assert times_s[Connack] < times_s[Subscribe]


@both
@pytest.mark.tck("tck-id-host-topic-phid-birth-required", "tck-id-message-flow-phid-sparkplug-state-publish")
def test_the_broker_has_granted_the_subscriptions_before_it_takes_the_birth(lives: dict[int, Proxy], version: int) -> None:
    for number in (0, 1):
        down = lives[version].packets("down", connection=number)
        taken = next(i for i, packet in enumerate(down) if isinstance(packet, Acknowledgement) and packet.kind == "puback")
        granted = [reason for packet in down[:taken] if isinstance(packet, Suback) for reason in packet.reasons]
        assert len(granted) >= 2
        assert max(granted) < 0x80


@both
@pytest.mark.tck(
    "tck-id-host-topic-phid-birth-payload",
    "tck-id-host-topic-phid-birth-payload-timestamp",
    "tck-id-message-flow-phid-sparkplug-state-publish-payload",
    "tck-id-message-flow-phid-sparkplug-state-publish-payload-timestamp",
    "tck-id-operational-behavior-host-application-connect-birth-payload",
    "tck-id-payloads-state-birth-payload",
)
def test_the_birth_says_online_with_the_time_stamp_of_the_will(lives: dict[int, Proxy], version: int) -> None:
    for number in (0, 1):
        (connect,) = lives[version].packets("up", Connect, connection=number)
        assert connect.will is not None
        for birth in _births(lives[version], number):
            assert _state(birth) == {"online": True, "timestamp": _state(connect.will)["timestamp"]}


@both
@pytest.mark.tck("tck-id-message-flow-hid-sparkplug-state-message-delivered")
def test_news_of_its_own_death_makes_it_say_again_that_it_is_online(lives: dict[int, Proxy], version: int) -> None:
    seen = [s for s in lives[version].recorded if s.connection == 0 and isinstance(s.packet, Publish)]
    told = next(i for i, s in enumerate(seen) if s.direction == "down" and b'"online":false' in s.packet.payload)  # type: ignore[attr-defined]
    again = [s for s in seen[told + 1 :] if s.direction == "up"]
    assert _own_birth(again[0].packet)
    assert len(_births(lives[version], 0)) == 2


@both
@pytest.mark.tck(
    "tck-id-host-topic-phid-death-topic",
    "tck-id-host-topic-phid-death-qos",
    "tck-id-host-topic-phid-death-retain",
    "tck-id-host-topic-phid-death-payload",
    "tck-id-host-topic-phid-death-payload-timestamp-disconnect-clean",
    "tck-id-operational-behavior-host-application-termination",
    "tck-id-operational-behavior-host-application-death-topic",
    "tck-id-operational-behavior-host-application-death-payload",
    "tck-id-operational-behavior-host-application-death-qos",
    "tck-id-operational-behavior-host-application-death-retained",
    "tck-id-operational-behavior-host-application-disconnect-intentional",
)
def test_the_death_goes_directly_before_the_disconnect_with_the_present_time(lives: dict[int, Proxy], version: int) -> None:
    *_, death, disconnect = lives[version].packets("up")
    assert isinstance(disconnect, Disconnect)
    assert isinstance(death, Publish)
    assert (death.topic, death.qos, death.retain) == (STATE_TOPIC, 1, True)
    state = _state(death)
    assert (set(state), state["online"]) == ({"online", "timestamp"}, False)
    (connect,) = lives[version].packets("up", Connect, connection=1)
    assert connect.will is not None
    assert state["timestamp"] > _state(connect.will)["timestamp"]


@both
@pytest.mark.tck(
    "tck-id-topics-dcmd-topic",
    "tck-id-topics-dcmd-mqtt",
    "tck-id-payloads-dcmd-qos",
    "tck-id-payloads-dcmd-retain",
    "tck-id-payloads-dcmd-seq",
)
def test_a_command_goes_with_qos_0_not_retained_and_without_sequence_number(lives: dict[int, Proxy], version: int) -> None:
    (command,) = (packet for packet in lives[version].packets("up", Publish) if "DCMD" in packet.topic)
    assert (command.topic, command.qos, command.retain) == ("spBv1.0/cnc/DCMD/edge-okuma/okuma", 0, False)
    assert not parse(command.payload).HasField("seq")
