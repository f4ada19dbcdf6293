"""The private broker: on loopback, nothing dropped silently, back after a kill with what it retained."""

import os
import signal
import socket
import time
from collections.abc import Callable
from pathlib import Path

import paho.mqtt.client as mqtt
import pytest

from cnctwin.errors import BrokerStartError, UsageError
from cnctwin.processes import child as child_module
from cnctwin.processes import given_broker, private_broker
from cnctwin.processes.given_broker import address, broker_or_own
from cnctwin.processes.private_broker import PrivateBroker, answers, find_mosquitto
from sparkplug.broker import BrokerAddress
from tests.cnctwin.program import is_alive, until
from tests.wire.mosquitto import Mosquitto, free_port

pytestmark = [pytest.mark.broker, pytest.mark.usefixtures("mosquitto_program")]
MESSAGES = 6000
SIZE = 2000


def client(port: int) -> mqtt.Client:
    made = mqtt.Client(mqtt.CallbackAPIVersion.VERSION2)
    made.connect("127.0.0.1", port)
    return made


def fetched_by_a_slow_reader(port: int, quiet_s_max: float) -> int:
    """Return how many of 6,000 messages reach a reader that begins to read only when all have been published, until it is
    quiet."""
    reader, got = client(port), []
    reader.socket().setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, 65_536)
    reader.on_message = lambda _client, _data, message: got.append(message.payload)
    subscribed = []
    reader.on_subscribe = lambda *_: subscribed.append(True)
    reader.subscribe("slow", 1)
    loop(reader, lambda: bool(subscribed))
    writer = client(port)
    for number in range(MESSAGES):
        writer.publish("slow", number.to_bytes(4, "big") * (SIZE // 4), 1).is_published()
    loop(writer, lambda: not writer._out_messages)
    loop(reader, lambda: len(got) == MESSAGES, lambda: len(got), quiet_s_max)
    for connection in (reader, writer):
        connection.disconnect()
    return len(set(got))


def loop(
    connection: mqtt.Client, done: Callable[[], bool], moved: Callable[[], int] = lambda: 0, quiet_s_max: float = 60.0
) -> None:
    """Read and write until it is done, or until nothing has moved for so long."""
    before, since_s = moved(), time.monotonic()
    while not done() and time.monotonic() - since_s < quiet_s_max:
        connection.loop(0.05)
        if moved() != before:
            before, since_s = moved(), time.monotonic()


def test_a_slow_reader_misses_nothing_which_it_does_by_default(tmp_path: Path) -> None:
    own = PrivateBroker(tmp_path, free_port())
    own.start()
    try:
        assert fetched_by_a_slow_reader(own.port, 60.0) == MESSAGES
    finally:
        own.stop()
    with Mosquitto(extra=("max_queued_messages 1000", "max_inflight_messages 20")) as default:
        assert fetched_by_a_slow_reader(default.port, 3.0) < MESSAGES


def test_killed_it_comes_back_on_its_port_with_what_it_retained(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(child_module, "RESTART_S_MIN", 0.0)
    own = PrivateBroker(tmp_path, free_port())
    own.start()
    try:
        writer = client(own.port)
        writer.publish("cnctwin/snapshot/thermal/vmc", b"kept", 1, retain=True)
        loop(writer, lambda: not writer._out_messages)
        writer.disconnect()
        until(lambda: b"kept" in stored(tmp_path), "the broker to save")
        pid = own.child.pid
        assert pid is not None
        os.kill(pid, signal.SIGKILL)
        until(own.watch, "the broker to be started again")
        until(lambda: answers("127.0.0.1", own.port), "the broker to answer")
        reader, got = client(own.port), []
        reader.on_message = lambda _client, _data, message: got.append(message.payload)
        reader.subscribe("#")
        loop(reader, lambda: bool(got))
        reader.disconnect()
        assert got == [b"kept"]
    finally:
        own.stop()
    assert not answers("127.0.0.1", own.port)


def stored(folder: Path) -> bytes:
    file = folder / "mosquitto.db"
    return file.read_bytes() if file.exists() else b""


def test_a_port_that_is_taken_is_named(tmp_path: Path) -> None:
    with socket.create_server(("127.0.0.1", 0)) as taken:
        port = taken.getsockname()[1]
        with pytest.raises(UsageError, match=rf"port {port} .* --port"):
            PrivateBroker(tmp_path, port)


def test_without_a_port_it_takes_the_usual_one_or_any_that_is_free(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    usual = free_port()
    monkeypatch.setattr(private_broker, "DEFAULT_PORT", usual)
    assert PrivateBroker(tmp_path).port == usual
    with socket.create_server(("127.0.0.1", usual)):
        other = PrivateBroker(tmp_path).port
        assert other != usual


def test_one_that_does_not_start_says_why_in_its_own_words(tmp_path: Path) -> None:
    own = PrivateBroker(tmp_path, free_port())
    (tmp_path / "mosquitto.conf").write_text("colour blue\n")
    with pytest.raises(BrokerStartError, match="colour"):
        own.start()
    assert not own.child.running


def test_where_mosquitto_is_not_installed_the_way_out_is_named(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(private_broker.shutil, "which", lambda *_, **__: None)
    with pytest.raises(BrokerStartError, match="scripts/setup"):
        find_mosquitto()


def test_a_given_broker_comes_before_that_of_the_environment(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.delenv(given_broker.BROKER_VARIABLE, raising=False)
    monkeypatch.delenv(given_broker.PASSWORD_VARIABLE, raising=False)
    assert address(None) is None
    monkeypatch.setenv(given_broker.BROKER_VARIABLE, "mqtts://viewer@hall-2")
    monkeypatch.setenv(given_broker.PASSWORD_VARIABLE, "hunter2")
    assert address(None) == BrokerAddress("hall-2", 8883, True, "viewer", "hunter2")
    chosen = address("mqtt://hall-3")
    assert chosen is not None
    assert chosen.host == "hall-3"
    with broker_or_own(chosen) as used:
        assert used is chosen


def test_without_a_broker_one_is_started_and_the_next_command_uses_it(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    port = free_port()
    monkeypatch.setattr(given_broker, "DEFAULT_PORT", port)
    monkeypatch.setattr(given_broker, "BrokerAddress", lambda: BrokerAddress(port=port))
    with broker_or_own(None) as first:
        assert first == BrokerAddress("127.0.0.1", port)
        assert "started a private one" in capsys.readouterr().err
        with broker_or_own(None) as second:
            assert second.port == port
            assert f"using the one on 127.0.0.1:{port}" in capsys.readouterr().err
        assert answers("127.0.0.1", port), "the second command must not end what the first one started"
    assert not answers("127.0.0.1", port)


def test_it_ends_with_what_started_it(tmp_path: Path) -> None:
    own = PrivateBroker(tmp_path, free_port())
    own.start()
    pid = own.child.pid
    own.stop()
    assert pid is not None
    assert not is_alive(pid)
