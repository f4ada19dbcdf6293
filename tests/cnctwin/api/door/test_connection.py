"""Connections that stay silent, drip, or come in numbers, over real sockets: they shut nobody out and hold no memory."""

import http.client
import re
import socket
import time
import tracemalloc
from collections.abc import Iterator

import httpx
import pytest

from cnctwin.api.access import Access
from cnctwin.api.application import create_app
from cnctwin.api.door import connection
from cnctwin.api.server import Server
from cnctwin.api.sources import Sources
from tests.cnctwin.api.served_plant import PATIENCE_S
from tests.cnctwin.api.small_plant import small_plant
from tests.edge.host_watch import wait

TOKEN = "a-token-of-more-than-sixteen"
GET = b"GET /livez HTTP/1.1\r\nHost: 127.0.0.1\r\n\r\n"
POST = b"POST /login HTTP/1.1\r\nHost: 127.0.0.1\r\nContent-Type: application/json\r\nContent-Length: %d\r\n\r\n"


@pytest.fixture
def server() -> Iterator[Server]:
    with Server(create_app(Sources(small_plant(), access=Access(TOKEN)))) as running:
        yield running


def connected(server: Server, source: str = "127.0.0.1") -> socket.socket:
    return socket.create_connection((server.host, server.port), timeout=PATIENCE_S, source_address=(source, 0))


def ended(one: socket.socket) -> bytes:
    """All that comes until the server closes the connection."""
    found = b""
    try:
        while part := one.recv(65536):
            found += part
    except ConnectionResetError:
        pass
    return found


def answer(one: socket.socket) -> int:
    """The status of the next answer, which is read to its end."""
    found = http.client.HTTPResponse(one)
    found.begin()
    found.read()
    return found.status


def alive(server: Server, source: str = "127.0.0.1") -> int:
    """The status of a question of somebody else."""
    transport = httpx.HTTPTransport(local_address=source)
    with httpx.Client(transport=transport, timeout=PATIENCE_S) as client:
        return client.get(f"{server.url}/livez").status_code


@pytest.mark.parametrize("begun", [b"", GET[:20], GET[:-2], b"GET /livez HTTP/1.1\r\n"])
def test_a_header_that_does_not_come_ends_the_connection(server: Server, monkeypatch: pytest.MonkeyPatch, begun: bytes) -> None:
    monkeypatch.setattr(connection, "HEADER_S_MAX", 0.3)
    with connected(server) as one:
        one.sendall(begun)
        assert ended(one) == b""


def test_a_header_that_drips_ends_at_its_deadline_not_at_its_last_byte(server: Server, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(connection, "HEADER_S_MAX", 0.5)
    with connected(server) as one:
        one.settimeout(0.05)
        deadline_s = time.monotonic() + PATIENCE_S
        for byte in GET[:12] * 1000:
            try:
                one.sendall(bytes((byte,)))
                if one.recv(1) == b"":
                    break
            except TimeoutError:
                assert time.monotonic() < deadline_s, "it drips for ever"
            except (BrokenPipeError, ConnectionResetError):
                break


def test_a_second_request_on_a_connection_has_its_deadline_too(server: Server, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(connection, "HEADER_S_MAX", 0.3)
    with connected(server) as one:
        one.sendall(GET)
        assert answer(one) == 200
        one.sendall(GET[:10])
        ended(one)


@pytest.mark.parametrize("before", [b"", GET])
def test_a_body_that_does_not_come_ends_the_connection(server: Server, monkeypatch: pytest.MonkeyPatch, before: bytes) -> None:
    monkeypatch.setattr(connection, "BODY_S_MAX", 0.3)
    with connected(server) as one:
        one.sendall(before + POST % 400 + b'{"token"')
        answers = ended(one)
    assert answers.count(b"HTTP/1.1") == (1 if before else 0)


def test_a_request_in_pieces_is_answered(server: Server) -> None:
    body = b'{"token": "%s"}' % TOKEN.encode()
    whole = GET + POST % len(body) + body + GET
    with connected(server) as one:
        for start in range(0, len(whole), 7):
            one.sendall(whole[start : start + 7])
            time.sleep(0.001)
        found = b""
        while found.count(b"HTTP/1.1") < 3:
            found += one.recv(65536)
    assert re.findall(rb"HTTP/1.1 (\d+)", found) == [b"200", b"204", b"200"]


def test_a_log_in_that_is_too_long_is_refused_before_it_is_read(server: Server) -> None:
    with connected(server) as one:
        one.sendall(POST % 7_900_000)
        assert answer(one) == 413


def test_bodies_that_are_poured_in_without_a_token_take_no_memory(server: Server) -> None:
    """Bodies of sixty connections, in pieces whose sum nobody says beforehand; 7.9 MB each had taken 480 MB."""
    head = POST.replace(b"Content-Length: %d", b"Transfer-Encoding: chunked").replace(b"/login", b"%s")
    part = b"10000\r\n" + b"x" * 65536 + b"\r\n"
    paths = [b"/login", b"/predict", b"/jobs"] * 20
    tracemalloc.start()
    try:
        held = [connected(server) for _ in paths]
        for one, path in zip(held, paths, strict=True):
            one.settimeout(5.0)
            try:
                one.sendall(head % path)
                for _ in range(120):
                    one.sendall(part)
            except (TimeoutError, BrokenPipeError, ConnectionResetError):
                continue
        _, peak = tracemalloc.get_traced_memory()
        assert alive(server, "127.0.0.2") == 200
    finally:
        tracemalloc.stop()
        for one in held:
            one.close()
    assert peak < 30_000_000


def test_who_goes_on_sending_what_was_refused_is_let_go(server: Server, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(connection, "LINGER_S_MAX", 0.3)
    with connected(server) as one:
        one.sendall(POST % 7_900_000)
        found = answer(one)
        with pytest.raises((BrokenPipeError, ConnectionResetError)):
            while True:
                one.sendall(b"x" * 1000)
                time.sleep(0.01)
    assert found == 413


def test_what_was_refused_leaves_the_connection_to_the_next_question(server: Server) -> None:
    with connected(server) as one:
        one.sendall(POST % 10_000 + b"x" * 10_000)
        assert answer(one) == 413
        one.sendall(GET)
        assert answer(one) == 200


def test_three_hundred_silent_connections_shut_nobody_out(server: Server) -> None:
    """Neither at another address nor at the same one, long before their deadline."""
    silent = [connected(server) for _ in range(310)]
    try:
        assert [alive(server, source) for source in ("127.0.0.2", "127.0.0.1")] == [200, 200]
        open_now = [one for one in server._server.server_state.connections if one.is_open]  # type: ignore[union-attr]
        assert len(open_now) <= connection.OF_ONE_MAX + 2
    finally:
        for one in silent:
            one.close()


def test_many_addresses_together_have_a_limit_and_the_greediest_makes_room(
    server: Server, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(connection, "CONNECTIONS_MAX", 20)
    few = connected(server, "127.0.0.3")
    many = [connected(server, f"127.0.1.{number % 2}") for number in range(40)]
    try:
        assert alive(server, "127.0.0.2") == 200
        few.sendall(GET)
        assert answer(few) == 200
    finally:
        for one in [few, *many]:
            one.close()


def test_an_address_whose_connections_all_ask_for_something_is_told_so(server: Server, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(connection, "OF_ONE_MAX", 3)
    busy = [connected(server) for _ in range(3)]
    try:
        for one in busy:
            one.sendall(POST % 100)
        state = server._server.server_state
        wait(lambda: sum(not one.is_idle for one in state.connections) == 3, "the requests to be begun")  # type: ignore[union-attr]
        with connected(server) as more:
            refusal = ended(more)
        assert refusal.startswith(b"HTTP/1.1 503")
        assert b"too many connections" in refusal
        assert alive(server, "127.0.0.2") == 200
    finally:
        for one in busy:
            one.close()


def test_a_proxy_has_many_connections(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(connection, "OF_ONE_MAX", 3)
    access = Access(proxy_header="X-User", proxy="127.0.0.2")
    with Server(create_app(Sources(small_plant(), access=access))) as server:
        held = [connected(server, "127.0.0.2") for _ in range(10)]
        try:
            for one in held:
                one.sendall(GET)
                assert answer(one) == 200
        finally:
            for one in held:
                one.close()
