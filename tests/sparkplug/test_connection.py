"""The hand-over between the connection's own thread and one that drives it, at the moments where both see the connection end."""

import os
import resource
import socket
from collections.abc import Iterator

import paho.mqtt.client as paho
import pytest
from paho.mqtt.enums import CallbackAPIVersion, MQTTErrorCode
from paho.mqtt.packettypes import PacketTypes
from paho.mqtt.reasoncodes import ReasonCode

from sparkplug.actions import Connect, Publish, Subscribe
from sparkplug.broker import BrokerAddress
from sparkplug.connection import Listener, MqttConnection
from sparkplug.paho_client import ReadingAheadClient, ready


def nothing(*_: object) -> None:
    pass


@pytest.fixture
def connection() -> Iterator[MqttConnection]:
    """A connection that was never started, with a client that its broker seems to have accepted."""
    listener = Listener(lambda _: Connect(None), nothing, nothing, nothing, nothing, nothing)
    connection = MqttConnection((BrokerAddress(),), "test", listener)
    connection._client, connection._accepted = client(), True
    yield connection
    connection.close((), 0.0)


def client() -> ReadingAheadClient:
    return ReadingAheadClient(CallbackAPIVersion.VERSION2, "test")


def test_a_driver_that_sees_the_end_of_an_old_connection_leaves_the_new_one_alone(
    connection: MqttConnection, monkeypatch: pytest.MonkeyPatch
) -> None:
    later = client()

    def ends(_client: paho.Client, _wait_s: float) -> bool:
        connection._client = later  # the connection's own thread was quicker, and has connected again
        return False

    monkeypatch.setattr(connection, "_step", ends)
    assert connection.drive(0.0)
    assert not connection._ended
    assert not connection._idle.is_set(), "the own thread would spin while it is driven"


@pytest.mark.parametrize("error", [OSError("reset"), ValueError("no MQTT packet")])
def test_whatever_fails_while_driving_ends_the_connection_and_not_the_driver(
    error: Exception, connection: MqttConnection, monkeypatch: pytest.MonkeyPatch
) -> None:

    def fails(_client: paho.Client, _wait_s: float) -> bool:
        raise error

    monkeypatch.setattr(connection, "_step", fails)
    assert connection.drive(0.0)
    assert connection._ended
    assert connection.last_error == str(error)
    assert not connection.drive(0.0), "there is nothing to drive until the own thread has connected again"


def test_what_an_ended_connection_did_not_take_is_counted(connection: MqttConnection, monkeypatch: pytest.MonkeyPatch) -> None:
    connection._client = None
    connection.send((Publish("a", b""), Subscribe("b"), Publish("c", b"")))

    def refuse(*_: object) -> None:
        raise OSError("refused")

    monkeypatch.setattr(connection, "_open", refuse)
    with pytest.raises(OSError, match="refused"):
        connection._serve(BrokerAddress())
    assert (connection.unsent, connection.backlog) == (2, 0)


def test_a_message_with_the_packet_id_of_a_barrier_confirms_nothing(monkeypatch: pytest.MonkeyPatch) -> None:
    confirmed: list[int] = []
    listener = Listener(lambda _: Connect(None), nothing, nothing, nothing, nothing, nothing, confirmed.append)
    connection = MqttConnection((BrokerAddress(),), "test", listener)
    connection._barriers[7] = 1
    reason = ReasonCode(PacketTypes.PUBACK)
    connection._on_publish(client(), None, 7, reason, None)  # as paho does when it has written a QoS 0 message
    assert confirmed == []

    def acknowledged() -> MQTTErrorCode:
        connection._on_publish(client(), None, 7, reason, None)
        return MQTTErrorCode.MQTT_ERR_CONN_LOST

    reading = client()
    monkeypatch.setattr(reading, "loop_read", acknowledged)
    assert not connection._read(reading, None)
    assert confirmed == [1]
    connection.close((), 0.0)


def test_waiting_knows_descriptors_above_1023() -> None:
    soft, hard = resource.getrlimit(resource.RLIMIT_NOFILE)
    resource.setrlimit(resource.RLIMIT_NOFILE, (max(soft, 1_200), hard))
    held = [os.dup(0) for _ in range(1_100)]
    here, there = socket.socketpair()
    try:
        assert here.fileno() > 1_023
        assert ready([here], [here], 0.0) == set()
        there.send(b"x")
        assert ready([here], [], 1.0) == {here.fileno()}
    finally:
        here.close()
        there.close()
        for descriptor in held:
            os.close(descriptor)
        resource.setrlimit(resource.RLIMIT_NOFILE, (soft, hard))
    with pytest.raises(ValueError, match="negative"):
        ready([here], [], 0.0)
