"""The proxy in front of a real Mosquitto: what it records, and the faults it makes."""

import contextlib
import socket
import time
from collections.abc import Iterator

import paho.mqtt.client as paho
import pytest
from paho.mqtt.enums import CallbackAPIVersion, MQTTProtocolVersion
from paho.mqtt.packettypes import PacketTypes
from paho.mqtt.reasoncodes import ReasonCode

from tests.wire.mosquitto import Mosquitto, free_port
from tests.wire.mqtt_packets import Connack, Connect, Disconnect, Packet, Publish, Subscribe
from tests.wire.proxy import Proxy

pytestmark = pytest.mark.broker

CONNACK = bytes.fromhex("20 02 00 00")
KEEP_ALIVE_S = 60


def _connect(proxy: Proxy, client_id: str, will: str = "") -> socket.socket:
    """A raw MQTT 3.1.1 session; `will` is a topic of at most 100 characters."""
    flags, tail = (0x06, _text(will) + _text("gone")) if will else (0x02, b"")
    body = _text("MQTT") + bytes([4, flags]) + KEEP_ALIVE_S.to_bytes(2, "big") + _text(client_id) + tail
    client = socket.create_connection(proxy.address, timeout=30.0)
    client.sendall(bytes([0x10, len(body)]) + body)
    assert client.recv(4) == CONNACK
    return client


def _text(text: str) -> bytes:
    return len(text).to_bytes(2, "big") + text.encode()


def _publish(topic: str, payload: bytes) -> bytes:
    body = _text(topic) + payload
    return bytes([0x30, len(body)]) + body


def _subscribe(client: socket.socket, topic_filter: str) -> None:
    body = b"\0\1" + _text(topic_filter) + b"\0"
    client.sendall(bytes([0x82, len(body)]) + body)
    assert client.recv(5) == bytes.fromhex("90 03 0001 00")


@contextlib.contextmanager
def _watching(broker: Mosquitto, topic_filter: str) -> Iterator[socket.socket]:
    """A subscriber that is connected to the broker itself, beside the proxy."""
    with Proxy(upstream=broker.address) as clear, contextlib.closing(_connect(clear, "watcher")) as watcher:
        _subscribe(watcher, topic_filter)
        yield watcher


def test_everything_that_a_client_and_the_broker_say_is_recorded(proxy: Proxy) -> None:
    client = paho.Client(CallbackAPIVersion.VERSION2, "edge", protocol=MQTTProtocolVersion.MQTTv311)
    client.will_set("will/topic", b"dead", qos=1, retain=True)
    client.connect("127.0.0.1", proxy.port, keepalive=33)
    client.loop_start()
    proxy.wait_for(lambda packet: isinstance(packet, Connack))
    client.subscribe("a/#", qos=1)
    proxy.wait_for(lambda packet: isinstance(packet, Subscribe))
    client.publish("a/b", b"hello", qos=1).wait_for_publish(60.0)
    proxy.wait_for(lambda packet: isinstance(packet, Publish), count=2)
    client.disconnect()
    proxy.wait_for(lambda packet: isinstance(packet, Disconnect))
    client.loop_stop()

    (connect,) = proxy.packets("up", Connect)
    assert (connect.version, connect.client_id, connect.clean, connect.keepalive_s) == (4, "edge", True, 33)
    assert connect.will is not None
    assert (connect.will.topic, connect.will.qos, connect.will.retain) == ("will/topic", 1, True)
    names = [type(packet).__name__ for packet in proxy.packets("up")]
    assert names[:3] == ["Connect", "Subscribe", "Publish"]
    assert names[-1] == "Disconnect"
    (echo,) = proxy.packets("down", Publish)
    assert (echo.topic, echo.payload, echo.qos) == ("a/b", b"hello", 1)
    times = [seen.at_s for seen in proxy.recorded]
    assert times == sorted(times)
    assert sum(packet.size for packet in proxy.packets("up")) == len(proxy.bytes_of("up"))


def test_mqtt_5_properties_and_reasons_are_seen(proxy: Proxy) -> None:
    client = paho.Client(CallbackAPIVersion.VERSION2, "edge", protocol=MQTTProtocolVersion.MQTTv5)
    client.connect("127.0.0.1", proxy.port, clean_start=True)
    client.loop_start()
    proxy.wait_for(lambda packet: isinstance(packet, Connack))
    client.disconnect(reasoncode=ReasonCode(PacketTypes.DISCONNECT, identifier=0x04))
    proxy.wait_for(lambda packet: isinstance(packet, Disconnect))
    client.loop_stop()
    (connect,) = proxy.packets("up", Connect)
    assert (connect.version, connect.clean) == (5, True)
    (connack,) = proxy.packets("down", Connack)
    assert dict(connack.properties)["topic_alias_maximum"] == 10
    (disconnect,) = proxy.packets("up", Disconnect)
    assert disconnect.reason == 0x04


def test_a_cut_resets_the_client_and_fires_the_will_at_once(mosquitto: Mosquitto, proxy: Proxy) -> None:
    with _watching(mosquitto, "will") as watcher, contextlib.closing(_connect(proxy, "edge", "will")) as edge:
        began_s = time.monotonic()
        proxy.cut()
        with pytest.raises(ConnectionResetError):
            edge.recv(1)
        assert watcher.recv(100) == _publish("will", b"gone")
        assert time.monotonic() - began_s < KEEP_ALIVE_S, "a client that is silent is given up later"


def test_a_cut_in_the_middle_of_a_packet_keeps_it_from_the_broker(mosquitto: Mosquitto, proxy: Proxy) -> None:
    with _watching(mosquitto, "#") as watcher, contextlib.closing(_connect(proxy, "edge", "will")) as edge:
        proxy.cut_when(lambda packet: isinstance(packet, Publish), bytes_passed=5)
        edge.sendall(_publish("data", b"never whole"))
        assert watcher.recv(100) == _publish("will", b"gone")
        assert [packet.payload for packet in proxy.packets("up", Publish)] == [b"never whole"]


def test_a_cut_behind_a_packet_lets_it_through(mosquitto: Mosquitto, proxy: Proxy) -> None:
    with _watching(mosquitto, "#") as watcher, contextlib.closing(_connect(proxy, "edge", "will")) as edge:
        proxy.cut_after_packets(2)
        edge.sendall(_publish("data", b"1") + _publish("data", b"2") + _publish("data", b"3"))
        expected = _publish("data", b"1") + _publish("data", b"2") + _publish("will", b"gone")
        assert _read(watcher, len(expected)) == expected
        with pytest.raises(ConnectionResetError):
            edge.recv(1)


def test_a_cut_after_bytes_counts_them(mosquitto: Mosquitto, proxy: Proxy) -> None:
    with _watching(mosquitto, "#") as watcher, contextlib.closing(_connect(proxy, "edge", "will")) as edge:
        proxy.cut_after_bytes(len(_publish("data", b"1")) + 3)
        edge.sendall(_publish("data", b"1") + _publish("data", b"2"))
        expected = _publish("data", b"1") + _publish("will", b"gone")
        assert _read(watcher, len(expected)) == expected


def test_the_last_words_of_a_client_that_does_not_listen_any_more_are_recorded(proxy: Proxy) -> None:
    for number in range(20):
        edge = _connect(proxy, "edge")
        _subscribe(edge, "a")
        edge.sendall(_publish("a", b"x" * 100) * 50 + bytes.fromhex("e000"))
        edge.close()
        proxy.wait_for(lambda packet: isinstance(packet, Disconnect), count=number + 1)
    assert len(proxy.packets("up", Publish)) == 1000


def test_a_delay_keeps_the_order_and_adds_the_time(proxy: Proxy) -> None:
    with contextlib.closing(_connect(proxy, "edge")) as edge:
        _subscribe(edge, "a")
        proxy.delay(0.3, "up")
        began_s = time.monotonic()
        edge.sendall(_publish("a", b"1"))
        edge.sendall(_publish("a", b"2"))
        expected = _publish("a", b"1") + _publish("a", b"2")
        assert _read(edge, len(expected)) == expected
        assert time.monotonic() - began_s >= 0.3


def test_a_stall_moves_nothing_until_it_is_resumed(proxy: Proxy) -> None:
    with contextlib.closing(_connect(proxy, "edge")) as edge:
        _subscribe(edge, "a")
        proxy.stall("down")
        edge.sendall(_publish("a", b"1"))
        edge.settimeout(0.2)
        with pytest.raises(TimeoutError):
            edge.recv(1)
        proxy.resume()
        edge.settimeout(30.0)
        assert _read(edge, len(_publish("a", b"1"))) == _publish("a", b"1")


def test_refused_connections_are_refused_until_they_are_accepted_again(proxy: Proxy) -> None:
    proxy.refuse()
    with pytest.raises(ConnectionRefusedError):
        socket.create_connection(proxy.address, timeout=5.0)
    proxy.accept()
    _connect(proxy, "edge").close()
    assert proxy.connections == 1


def test_a_dead_broker_closes_the_client_and_comes_back_on_the_same_port(mosquitto: Mosquitto, proxy: Proxy) -> None:
    with contextlib.closing(_connect(proxy, "edge")) as edge:
        mosquitto.kill()
        with contextlib.suppress(ConnectionResetError):
            assert edge.recv(1) == b""
        with contextlib.closing(socket.create_connection(proxy.address, timeout=30.0)) as early:
            assert early.recv(1) == b""
    port = mosquitto.port
    mosquitto.restart()
    assert mosquitto.port == port
    _connect(proxy, "edge").close()


def test_retained_messages_survive_a_restart_where_the_broker_persists() -> None:
    with Mosquitto(persistent=True) as broker, Proxy(upstream=broker.address) as proxy:
        with contextlib.closing(_connect(proxy, "edge")) as edge:
            edge.sendall(b"\x31" + _publish("kept", b"value")[1:])
            edge.sendall(bytes.fromhex("e000"))
            assert edge.recv(1) == b""
        broker.restart()
        with contextlib.closing(_connect(proxy, "late")) as late:
            _subscribe(late, "kept")
            assert _read(late, 13) == b"\x31" + _publish("kept", b"value")[1:]


def test_what_is_no_mqtt_reaches_the_broker_untouched(proxy: Proxy) -> None:
    with contextlib.closing(socket.create_connection(proxy.address, timeout=30.0)) as client:
        client.sendall(b"GET / HTTP/1.1\r\n\r\n" + bytes(80))
        with contextlib.suppress(ConnectionResetError):
            assert client.recv(1) == b""
    assert proxy.packets() == []
    assert proxy.bytes_of("up").startswith(b"GET /")


def test_waiting_in_vain_says_what_came_instead(proxy: Proxy) -> None:
    _connect(proxy, "edge").close()
    with pytest.raises(TimeoutError, match=r"0 of 1 packets.*Connect"):
        proxy.wait_for(_never, timeout_s=0.05)


def _never(_packet: Packet) -> bool:
    return False


def test_two_brokers_get_two_ports(mosquitto: Mosquitto) -> None:
    assert free_port() != mosquitto.port


def _read(client: socket.socket, count: int) -> bytes:
    """Exactly `count` bytes, or what came until the other side closed."""
    data = b""
    while len(data) < count and (more := client.recv(count - len(data))):
        data += more
    return data
