"""Agents that mean harm: bombs, drips, floods, and those that send an edge round in circles."""

import gzip
import socket
import threading
import time
import tracemalloc
from collections.abc import Callable
from contextlib import suppress

import pytest

from edge.adapter import Wait
from edge.config import EdgeConfig
from edge.controls.mtconnect import connection as connection_module
from edge.controls.mtconnect.config import MtconnectConfig
from edge.controls.mtconnect.connection import MtconnectConnection, fetch
from edge.controls.mtconnect.cursor import Request
from edge.errors import ConnectionLostError
from tests.edge.controls.mtconnect.agent_documents import probe, streams, value
from tests.edge.controls.mtconnect.test_connection import BASELINE, Reader, answer, multipart, part, server

Answer = Callable[[socket.socket], None]
BOMB = gzip.compress(gzip.compress(bytes(256 * 1024 * 1024), 1), 9)
DRIP_S = 0.02


def encoded(encoding: str, body: bytes, kind: str = "text/xml") -> Answer:
    head = f"HTTP/1.1 200 OK\r\nContent-Type: {kind}\r\nContent-Encoding: {encoding}\r\nContent-Length: {len(body)}\r\n\r\n"
    return lambda client: client.sendall(head.encode() + body)


def dripping(begin: bytes) -> Answer:
    """Send the beginning at once, and then a byte at a time."""

    def drip(client: socket.socket) -> None:
        client.sendall(begin)
        with suppress(OSError):
            while True:
                client.sendall(b"x")
                time.sleep(DRIP_S)

    return drip


def config(url: str, **options: object) -> EdgeConfig[MtconnectConfig]:
    return EdgeConfig(source=MtconnectConfig.model_validate({"url": url, "heartbeat_ms": 100} | options))


@pytest.mark.parametrize("encoding", ["gzip, gzip", "gzip", "deflate", "br", "zstd", "x-gzip"])
def test_a_body_that_would_unfold_is_refused_unread(encoding: str) -> None:
    assert len(BOMB) < 10_000
    asked = list[bytes]()
    with server(encoded(encoding, BOMB), asked=asked) as url:
        tracemalloc.start()
        try:
            with pytest.raises(ConnectionLostError) as refused:
                fetch(config(url), Request("/probe"))
            _, peak_bytes = tracemalloc.get_traced_memory()
        finally:
            tracemalloc.stop()
    assert str(refused.value).startswith(f"{url}/probe: the agent sends Content-Encoding: {encoding!r}, which was not asked for")
    assert "\n" not in str(refused.value)
    assert peak_bytes < 8 * 1024 * 1024
    assert b"Accept-Encoding: identity" in asked[0].split(b"\r\n")


def test_a_bomb_in_a_stream_costs_the_edge_a_reconnect_and_no_memory() -> None:
    alive = multipart(part(streams(11, [value("rpm", 10, "1")])))
    bomb = encoded("gzip, gzip", BOMB, "multipart/mixed; boundary=b")
    with server(answer(probe()), BASELINE, bomb, alive) as url, Reader(url, heartbeat_ms=2000) as reader:
        reader.wait(lambda: reader.cursor.next_sequence == 11)
        assert reader.connection.reconnects == 1


def test_identity_is_no_encoding() -> None:
    with server(encoded("identity", probe())) as url:
        assert fetch(config(url), Request("/probe")) == probe()


@pytest.mark.parametrize(
    ("begin", "reason"),
    [
        (b"HTTP/1.1 200 OK\r\nX-Slow: ", "timed out"),
        (b"HTTP/1.1 200 OK\r\nContent-Type: text/xml\r\n\r\n", "no whole document within 1.8 s"),
        (b"HTTP/1.1 200 OK\r\nContent-Type: text/xml\r\nContent-Length: 99999\r\n\r\n", "no whole document within 1.8 s"),
    ],
    ids=["the head", "a body until the end", "a body by length"],
)
def test_an_agent_that_drips_is_let_go_by_the_deadline_and_the_edge_goes_on(begin: bytes, reason: str) -> None:
    with (
        server(dripping(begin), answer(probe()), BASELINE, multipart(part(streams(11, [value("rpm", 10, "1")])))) as url,
        Reader(url, timeout_s=0.3, heartbeat_ms=2000 if b"\r\n\r\n" in begin else 100) as reader,
    ):
        errors = set[str]()
        reader.wait(lambda: errors.add(reader.connection.last_error) or reader.cursor.next_sequence == 11)
        assert any(reason in error for error in errors), errors


def test_nobody_else_waits_for_a_document_that_drips() -> None:
    """The caller gets a wait for each piece, which the thread that all edges share spends on the others."""
    with server(dripping(b"HTTP/1.1 200 OK\r\nContent-Type: text/xml\r\n\r\n")) as url:
        connection = MtconnectConnection(config(url, timeout_s=5.0))
        waits = list[Wait]()
        for step in connection.steps():
            assert isinstance(step, Wait)
            assert step.sock is not None
            assert not step.sock.getblocking()
            waits.append(step)
            time.sleep(DRIP_S)
            if len(waits) == 5:
                break
        connection.close()


def test_a_document_without_an_end_is_given_up(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(connection_module, "DOCUMENT_BYTES_MAX", 300_000)

    def flood(client: socket.socket) -> None:
        client.sendall(b"HTTP/1.1 200 OK\r\nContent-Type: text/xml\r\nTransfer-Encoding: chunked\r\n\r\n")
        with suppress(OSError):
            while True:
                client.sendall(b"1000\r\n" + bytes(0x1000) + b"\r\n")

    with server(flood) as url, pytest.raises(ConnectionLostError, match="document of more than 300000 bytes"):
        fetch(config(url), Request("/probe"))


@pytest.mark.parametrize(
    "reply",
    [
        lambda client: client.shutdown(socket.SHUT_RDWR),
        answer(probe(), status="503 Service Unavailable", kind="text/html"),
        answer(b"<MTConnectStreams/>"),
    ],
    ids=["closes at once", "refuses", "sends no document"],
)
def test_who_answers_badly_at_once_is_asked_less_and_less_often(reply: Answer) -> None:
    waited = list[float]()
    done = threading.Event()

    def wait(seconds: float) -> None:
        waited.append(seconds)
        if len(waited) == 12:
            connection.close()
            done.set()

    with server(reply) as url:
        reader = Reader(url)
        connection = MtconnectConnection(reader.config, wait=wait)
        reader.connection = connection
        with reader:
            assert done.wait(60)
    assert all(seconds >= 0.125 * 2**turn for turn, seconds in enumerate(waited[:6], start=1)), waited
    assert max(waited) <= connection_module.BACKOFF_S_MAX


def test_an_agent_that_is_another_instance_in_each_document_is_asked_less_and_less_often() -> None:
    asked, waited = list[bytes](), list[float]()
    done = threading.Event()

    def wait(seconds: float) -> None:
        waited.append(seconds)
        if len(waited) == 8:
            connection.close()
            done.set()

    def anew(client: socket.socket) -> None:
        document = probe() if b"/probe" in asked[-1] else streams(12, [value("rpm", 11, "2")])
        answer(document.replace(b'instanceId="1"', b'instanceId="%d"' % (1000 + len(asked))))(client)

    assert b'instanceId="1"' in probe()
    assert b'instanceId="1"' in streams(12)
    with server(anew, asked=asked) as url:
        reader = Reader(url)
        connection = MtconnectConnection(reader.config, wait=wait)
        reader.connection = connection
        with reader:
            assert done.wait(60)
    assert min(waited[-2:]) >= 1.0 > waited[0], waited
    assert len(asked) < 40
