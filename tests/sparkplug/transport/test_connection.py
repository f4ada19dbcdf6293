"""What a connection does at the moments that a broker does not bring about at will."""

import socket
import time
from collections.abc import Callable, Iterator

import pytest
from paho.mqtt.enums import MQTTErrorCode
from paho.mqtt.packettypes import PacketTypes
from paho.mqtt.reasoncodes import ReasonCode

from sparkplug.actions import Publish, Subscribe
from sparkplug.broker import BrokerAddress
from sparkplug.transport import connection as connection_module
from sparkplug.transport.connection import MqttConnection
from sparkplug.transport.dialling import UnreachableError
from sparkplug.transport.paho_client import StreamClient
from sparkplug.transport.paho_path import PahoPath
from tests.sparkplug.transport.pair import client_on, listener_of, nothing

CONNACK = bytes.fromhex("20 02 00 00")


class FakeBroker:
    """The other end of whatever is dialled, without a broker's manners; `accepted` connections in order."""

    def __init__(self, monkeypatch: pytest.MonkeyPatch) -> None:
        self.ends: list[socket.socket] = []
        monkeypatch.setattr(connection_module, "dialled", self._dialled)

    def _dialled(self, *_: object) -> StreamClient:
        ours, theirs = socket.socketpair()
        theirs.settimeout(5.0)
        theirs.sendall(CONNACK)
        self.ends.append(theirs)
        return client_on(ours)[0]

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
        path = PahoPath(client, stream, listener_of(confirmed=confirmed.append), nothing)
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
