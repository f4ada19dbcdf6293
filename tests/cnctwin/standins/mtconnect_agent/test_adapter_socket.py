"""The recording as an SHDR adapter on a socket."""

import contextlib
import socket
import time
from collections.abc import Iterator
from pathlib import Path

from tests.cnctwin.standins.mtconnect_agent.adapter_socket import ShdrAdapter
from tests.cnctwin.standins.mtconnect_agent.small_machine import at, write_machine
from tests.recordings import recording

LINES = [at(n, f"tool|{n}|Xload|{n}") for n in range(200)]


@contextlib.contextmanager
def adapter(folder: Path, lines: list[str], **options: object) -> Iterator[ShdrAdapter]:
    file, devices = write_machine(folder, lines)
    sending = ShdrAdapter(file, devices, **options)  # type: ignore[arg-type]
    sending.start()
    try:
        yield sending
    finally:
        sending.stop()


class Client:
    """What an agent does with an adapter: it reads lines, and asks now and then."""

    def __init__(self, sending: ShdrAdapter) -> None:
        self.connection = socket.create_connection(sending.address, timeout=60.0)
        self.file = self.connection.makefile("rb")

    def lines(self, count: int) -> list[str]:
        return [self.file.readline().decode().rstrip("\n") for _ in range(count)]

    def close(self) -> None:
        self.file.close()
        self.connection.close()


@contextlib.contextmanager
def client(sending: ShdrAdapter) -> Iterator[Client]:
    connected = Client(sending)
    try:
        yield connected
    finally:
        connected.close()


def test_the_first_client_is_sent_every_line_as_recorded(tmp_path: Path) -> None:
    lines = [*LINES[:3], "2017", "* adapterVersion: 1", f"{at(4, '@ASSET@|1|T|--multiline--A')}\n<T/>\n--multiline--A"]
    with adapter(tmp_path, lines, speed=float("inf")) as sending, client(sending) as agent:
        assert agent.lines(8) == "\n".join(lines).split("\n")
        assert sending.lines_unusable == 1
        assert sending.lines_sent == 6


def test_a_ping_is_answered_with_the_heartbeat(tmp_path: Path) -> None:
    with adapter(tmp_path, LINES[:1], speed=float("inf"), heartbeat_ms=1234) as sending, client(sending) as agent:
        assert agent.lines(1) == LINES[:1]
        agent.connection.sendall(b"* PI")
        agent.connection.sendall(b"NG\r\n* PING\n")
        assert agent.lines(2) == ["* PONG 1234", "* PONG 1234"]


def test_a_later_client_is_sent_the_present_values_first(tmp_path: Path) -> None:
    lines = [*LINES[:10], at(11, "logic|FAULT|7|||hot")]
    with adapter(tmp_path, lines, speed=float("inf")) as sending, client(sending) as first:
        assert first.lines(11) == lines
        with client(sending) as second:
            assert second.lines(3) == [at(9, "tool|9"), at(9, "Xload|9"), at(11, "logic|FAULT|7|||hot")]
        assert sending.finished


def test_playing_begins_with_the_first_client(tmp_path: Path) -> None:
    with adapter(tmp_path, LINES, speed=float("inf")) as sending:
        time.sleep(0.15)
        assert sending.lines_sent == 0


def test_the_pace_is_the_recorded_one_times_speed(tmp_path: Path) -> None:
    begun = time.monotonic()
    with adapter(tmp_path, LINES[:21], speed=40.0) as sending, client(sending) as agent:
        agent.lines(21)
        assert 0.5 <= time.monotonic() - begun < 10.0, "at its own pace, it would take 20 s"


def test_a_client_that_goes_away_does_not_disturb_the_other(tmp_path: Path) -> None:
    with adapter(tmp_path, LINES, speed=200.0) as sending, client(sending) as staying:
        with client(sending) as leaving:
            leaving.lines(1)
        assert staying.lines(200) == LINES


def test_a_client_that_takes_nothing_is_disconnected(tmp_path: Path) -> None:
    fat = [at(n, f"tool|{'x' * 60_000}{n}") for n in range(400)]
    with adapter(tmp_path, fat, speed=10_000.0, pending_bytes_max=500_000) as sending, client(sending):
        until = time.monotonic() + 60.0
        while not sending.clients_dropped and time.monotonic() < until:
            time.sleep(0.01)
        assert sending.clients_dropped == 1


def test_more_clients_than_the_bound_are_turned_away(tmp_path: Path) -> None:
    with adapter(tmp_path, LINES[:1], speed=1.0, clients_max=1) as sending, client(sending) as first:
        first.lines(1)
        with client(sending) as second:
            assert second.file.readline() == b""
        assert sending.clients == 1


def test_as_fast_as_possible_loses_nothing_of_a_whole_recording() -> None:
    path = recording("mtconnect/okuma.txt")
    sending = ShdrAdapter(path, recording("mtconnect/okuma_devices.xml"), speed=float("inf"), pending_bytes_max=100_000)
    sending.start()
    expected = path.read_text(encoding="utf-8").splitlines()
    try:
        with client(sending) as agent:
            assert agent.lines(len(expected)) == expected
    finally:
        sending.stop()
