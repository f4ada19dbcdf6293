"""A connection at the moments that a broker does not bring about at will."""

import socket
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import suppress

import pytest
from paho.mqtt.enums import MQTTErrorCode
from paho.mqtt.packettypes import PacketTypes
from paho.mqtt.reasoncodes import ReasonCode

from sparkplug.actions import Disconnect, Publish, Subscribe
from sparkplug.broker import BrokerAddress
from sparkplug.transport import connection as connection_module
from sparkplug.transport import data_path as data_path_module
from sparkplug.transport.connection import MqttConnection
from sparkplug.transport.data_path import DataPath
from sparkplug.transport.dialling import UnreachableError
from sparkplug.transport.loop import Loop
from sparkplug.transport.packets import puback
from sparkplug.transport.paho_client import StreamClient
from sparkplug.transport.paho_path import PahoPath
from sparkplug.transport.sendable import Sendable
from tests.sparkplug.transport.pair import client_on, listener_of, nothing
from tests.wire import mqtt_packets

PATIENCE_S = 5.0
CONNACK = bytes.fromhex("20 02 00 00")


class FakeBroker:
    """The other end of whatever is dialled, without a broker's manners; `accepted` connections in order."""

    def __init__(self, monkeypatch: pytest.MonkeyPatch) -> None:
        self.ends: list[socket.socket] = []
        self.is_mute = False
        self.connack, self.mqtt_version = CONNACK, 4
        monkeypatch.setattr(connection_module, "dialled", self._dialled)

    def _dialled(self, *_: object) -> StreamClient:
        ours, theirs = socket.socketpair()
        theirs.settimeout(5.0)
        if not self.is_mute:
            theirs.sendall(self.connack)
        self.ends.append(theirs)
        return client_on(ours, self.mqtt_version)[0]

    def close(self) -> None:
        for end in self.ends:
            end.close()


@pytest.fixture
def broker(monkeypatch: pytest.MonkeyPatch) -> Iterator[FakeBroker]:
    broker = FakeBroker(monkeypatch)
    yield broker
    broker.close()


def wait_until(condition: Callable[[], bool]) -> None:
    deadline_s = time.monotonic() + 5.0
    while not condition():
        assert time.monotonic() < deadline_s
        time.sleep(0.005)


@pytest.mark.parametrize("error", [OSError("reset"), ValueError("no MQTT packet")])
@pytest.mark.parametrize("data_path", [True, False], ids=["data path", "paho"])
def test_whatever_fails_in_a_listener_ends_the_connection_and_not_the_driver(
    error: Exception, data_path: bool, broker: FakeBroker
) -> None:
    lost: list[float] = []

    def fails(_topic: str, _payload: bytes) -> None:
        raise error

    listener = listener_of(message=fails, lost=lambda: lost.append(time.monotonic()))
    connection = MqttConnection((BrokerAddress(),), "test", listener, data_path=data_path)
    connection.start()
    wait_until(lambda: connection.connects == 1)
    broker.ends[0].sendall(bytes.fromhex("30 04 00 01 61 62"))
    wait_until(lambda: connection.loop.turn(0.05) and bool(lost))
    assert connection.last_error == str(error)
    wait_until(lambda: connection.connects == 2)
    assert connection.last_error == ""
    connection.close((), 5.0)
    assert len(lost) == 2


def test_what_is_ready_for_a_connection_that_has_just_ended_disturbs_nobody(broker: FakeBroker) -> None:
    connection = MqttConnection((BrokerAddress(),), "test", listener_of())
    connection.ready(readable=True, writable=True)
    connection.start()
    wait_until(lambda: connection.connects == 1)
    connection.ready(readable=True, writable=True)  # another socket was meant: on this one nothing has come
    assert connection.last_error == ""
    connection.close((), 5.0)


def test_what_an_ended_connection_did_not_take_is_counted(monkeypatch: pytest.MonkeyPatch) -> None:
    attempts: list[int] = []

    def refuse(*_: object) -> None:
        attempts.append(1)
        raise UnreachableError("refused")

    monkeypatch.setattr(connection_module, "dialled", refuse)
    returned: list[int] = []
    connection = MqttConnection((BrokerAddress(),), "test", listener_of(unsent=lambda: returned.append(1)))
    connection.send((Publish("a", b""), Subscribe("b"), Publish("c", b"")))
    connection.start()
    wait_until(lambda: len(attempts) == 2)
    connection.close((), 5.0)
    assert (connection.unsent, connection.backlog, connection.last_error) == (2, 0, "refused")
    assert len(returned) >= 2


def test_a_message_with_the_packet_id_of_a_barrier_confirms_nothing(monkeypatch: pytest.MonkeyPatch) -> None:
    confirmed: list[int] = []
    ours, theirs = socket.socketpair()
    with ours, theirs:
        client, stream = client_on(ours)
        path = PahoPath(client, stream, listener_of(confirmed=confirmed.append), nothing, Sendable("test"))
        path._barriers[7] = 1
        reason = ReasonCode(PacketTypes.PUBACK)
        path._on_publish(client, None, 7, reason, None)  # as paho does when it has written a QoS 0 message
        assert confirmed == []

        def acknowledged() -> MQTTErrorCode:
            stream.recv(4)
            path._on_publish(client, None, 7, reason, None)
            return MQTTErrorCode.MQTT_ERR_SUCCESS

        monkeypatch.setattr(client, "loop_read", acknowledged)
        path.received(b"\x40\x02\x00\x07")
        assert confirmed == [1]


def test_a_mute_broker_and_one_that_takes_long_to_reach_keep_no_other_connection_waiting(
    broker: FakeBroker, monkeypatch: pytest.MonkeyPatch
) -> None:
    loop = Loop()
    heard: list[bytes] = []
    broker.is_mute = True
    mute = MqttConnection((BrokerAddress(),), "mute", listener_of(), loop=loop)
    mute.start()
    wait_until(lambda: len(broker.ends) == 1)
    unreached, may_end = MqttConnection((BrokerAddress(),), "unreached", listener_of(), loop=loop), threading.Event()

    def hangs(*_: object) -> None:
        may_end.wait(PATIENCE_S)
        raise UnreachableError("timed out")

    monkeypatch.setattr(connection_module, "dialled", hangs)
    unreached.start()
    broker.is_mute = False
    monkeypatch.setattr(connection_module, "dialled", broker._dialled)
    good = MqttConnection((BrokerAddress(),), "good", listener_of(message=lambda _, payload: heard.append(payload)), loop=loop)
    good.start()
    wait_until(lambda: loop.turn(0.05) and good.connects == 1)
    broker.ends[-1].sendall(bytes.fromhex("30 04 00 01 61 62"))
    wait_until(lambda: loop.turn(0.05) and heard == [b"b"])
    may_end.set()
    for connection in (mute, unreached, good):
        connection.close((), PATIENCE_S)
    assert (mute.connects, unreached.connects) == (0, 0)


@pytest.mark.parametrize("data_path", [True, False], ids=["data path", "paho"])
def test_what_a_driver_sends_goes_out_whole_and_in_order_whatever_the_socket_takes(data_path: bool, broker: FakeBroker) -> None:
    connection = MqttConnection((BrokerAddress(),), "test", listener_of(), data_path=data_path)
    connection.start()
    wait_until(lambda: connection.loop.turn(0.05) and connection.connects == 1)
    theirs = broker.ends[0]
    messages = [Publish("a/b", bytes((number % 256,)) * 3_000, number % 2) for number in range(1_000)]
    for message in messages:
        connection.send((message,))
    assert connection.loop.turn(0.0)
    assert connection.backlog > 0, "the socket does not take so much at once"
    connected = mqtt_packets.PacketReader()
    got: list[mqtt_packets.Publish] = []
    theirs.settimeout(0.0)
    while len(got) < len(messages):
        assert connection.loop.turn(0.05)
        with suppress(BlockingIOError):
            got += [packet for packet in connected.feed(theirs.recv(65_536)) if isinstance(packet, mqtt_packets.Publish)]
    assert [(packet.payload, packet.qos) for packet in got] == [(message.payload, message.qos) for message in messages]
    ids = [packet.packet_id for packet in got if packet.packet_id is not None]
    assert len(set(ids)) == len(ids) == 500
    assert connection.backlog == 0
    connection.close((), PATIENCE_S)


def test_the_outbox_is_full_by_number_and_by_bytes(broker: FakeBroker, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(connection_module, "OUTBOX_MAX", 10)
    monkeypatch.setattr(connection_module, "OUTBOX_BYTES_MAX", 1_000)
    connection = MqttConnection((BrokerAddress(),), "test", listener_of())
    connection.send([Publish("a", b"")] * 9)
    assert not connection.full
    connection.send([Publish("a", b"")])
    assert connection.full
    other = MqttConnection((BrokerAddress(),), "test", listener_of())
    other.send((Publish("a", bytes(1_000)),))
    assert other.full
    other.start()
    wait_until(lambda: other.connects == 1)
    other.send((Publish("a", bytes(1_000)),))
    wait_until(lambda: not other.full)
    other.close((), PATIENCE_S)


def test_a_broker_that_takes_nothing_holds_a_disconnect_up_for_a_bounded_time(
    broker: FakeBroker, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(connection_module, "CONNECT_TIMEOUT_S", 0.3)
    connection = MqttConnection((BrokerAddress(),), "test", listener_of())
    connection.start()
    wait_until(lambda: connection.connects == 1)
    for _ in range(1_000):
        connection.send((Publish("a", bytes(3_000)),))
    began_s = time.monotonic()
    connection.close((Publish("a", b"death"), Disconnect()), 2.0)
    assert time.monotonic() - began_s < PATIENCE_S
    assert connection.unsent > 0


@pytest.mark.parametrize("code", [0x00, 0x10, 0x87, 0x99])
def test_a_barrier_is_confirmed_or_refused_by_its_acknowledgement(code: int, broker: FakeBroker) -> None:
    confirmed: list[int] = []
    connection = MqttConnection((BrokerAddress(),), "test", listener_of(confirmed=confirmed.append), mqtt_version=4)
    connection.start()
    wait_until(lambda: connection.loop.turn(0.05) and connection.connects == 1)
    path = connection._path
    assert isinstance(path, DataPath)
    path.barrier("cnctwin/barrier", 17)
    (packet_id,) = path._unacknowledged
    assert packet_id >= 32_768
    path._acknowledged(packet_id, code)
    assert not path._unacknowledged
    assert confirmed == ([17] if code < 0x80 else [])
    assert bool(connection.last_error) == (code >= 0x80)
    connection.close((), PATIENCE_S)


def test_no_more_messages_are_out_than_the_broker_may_leave_unacknowledged(
    broker: FakeBroker, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(data_path_module, "UNACKNOWLEDGED_MAX", 3)
    connection = MqttConnection((BrokerAddress(),), "test", listener_of())
    connection.start()
    wait_until(lambda: connection.loop.turn(0.05) and connection.connects == 1)
    connection.send([Publish("a", b"", 1)] * 5 + [Publish("a", b"last")])
    assert connection.loop.turn(0.0)
    assert connection.backlog == 3
    path = connection._path
    assert isinstance(path, DataPath)
    broker.ends[0].sendall(b"".join(puback(packet_id) for packet_id in path._unacknowledged))
    wait_until(lambda: connection.loop.turn(0.05) and connection.backlog == 0)
    connection.close((), PATIENCE_S)


@pytest.mark.parametrize("qos", [0, 1])
@pytest.mark.parametrize("data_path", [True, False], ids=["data path", "paho"])
def test_a_message_that_cannot_be_sent_is_dropped_and_counted_and_the_others_go_out(
    data_path: bool, qos: int, broker: FakeBroker, caplog: pytest.LogCaptureFixture
) -> None:
    connection = MqttConnection((BrokerAddress(),), "test", listener_of(), data_path=data_path)
    connection.start()
    wait_until(lambda: connection.loop.turn(0.05) and connection.connects == 1)
    connection.sendable.packet_bytes_max = 100
    for topic, payload in (("cnc/" + "%25" * 30_000, b""), ("cnc/a\x07", b""), ("a/+", b""), ("a\ud800", b""), ("a", bytes(101))):
        assert not connection.sendable.takes(Publish(topic, payload, qos))
        connection.send((Publish("a", b"before", qos), Publish(topic, payload, qos), Publish("a", b"after", qos)))
    connected = mqtt_packets.PacketReader()
    got: list[bytes] = []
    broker.ends[0].settimeout(0.0)
    deadline_s = time.monotonic() + PATIENCE_S
    while len(got) < 10 and time.monotonic() < deadline_s:
        assert connection.loop.turn(0.05)
        with suppress(BlockingIOError):
            packets = connected.feed(broker.ends[0].recv(65_536))
            got += [packet.payload for packet in packets if isinstance(packet, mqtt_packets.Publish)]
    assert got == [b"before", b"after"] * 5
    assert (connection.sendable.unsendable, connection.connects, connection.unsent) == (10, 1, 0)
    assert "'cnc/%25%25%25%25%25%25%25%25%25%25%25%25%25%25%25%25%25%25%2…' (90004 characters) cannot be sent" in caplog.text
    connection.close((), PATIENCE_S)


def test_the_largest_packet_that_a_broker_of_mqtt_5_takes_is_kept_to(broker: FakeBroker) -> None:
    broker.connack = bytes.fromhex("20 08 00 00 05 27 00 00 00 64")
    connection = MqttConnection((BrokerAddress(),), "test", listener_of(), mqtt_version=5)
    broker.mqtt_version = 5
    connection.start()
    wait_until(lambda: connection.loop.turn(0.05) and connection.connects == 1)
    assert connection.sendable.packet_bytes_max == 100
    assert connection.sendable.takes(Publish("a", bytes(80)))
    assert not connection.sendable.takes(Publish("a", bytes(100)))
    connection.close((), PATIENCE_S)
