"""One answer, read as it comes: whole, in pieces, in chunks, or not at all."""

import socket
import threading
import time
from collections.abc import Iterator
from contextlib import contextmanager
from urllib.parse import urlsplit

import pytest

from edge.controls.mtconnect.stream import Stream
from edge.errors import ConnectionLostError

HEAD = b"HTTP/1.1 200 OK\r\nContent-Type: multipart/mixed;boundary=b\r\n"


@contextmanager
def agent(*pieces: bytes, stays: bool = False, asked: list[bytes] | None = None) -> Iterator[str]:
    """Answers one request with these pieces, 20 ms apart, and hangs up unless it `stays`."""
    listener = socket.create_server(("127.0.0.1", 0))
    done = threading.Event()

    def serve() -> None:
        client, _ = listener.accept()
        with client:
            request = client.recv(65536)
            if asked is not None:
                asked.append(request)
            for piece in pieces:
                client.sendall(piece)
                time.sleep(0.02)
            if stays:
                done.wait(20)

    thread = threading.Thread(target=serve, daemon=True)
    thread.start()
    try:
        yield f"http://127.0.0.1:{listener.getsockname()[1]}"
    finally:
        done.set()
        thread.join(20)
        listener.close()


def opened(url: str, login: tuple[str, str] | None = None) -> Stream:
    return Stream(urlsplit(url), "/vmc/sample?from=1", login=login, timeout_s=5.0, head_s=0.5)


def body_of(stream: Stream) -> bytes:
    deadline_s, body = time.monotonic() + 20.0, b""
    while (data := stream.read()) != b"":
        assert time.monotonic() < deadline_s
        body += data or b""
    return body


@pytest.mark.parametrize(
    "pieces",
    [
        (HEAD + b"\r\none two",),
        (HEAD + b"Content-Length: 7\r\n\r\none", b" two"),
        (HEAD[:20], HEAD[20:] + b"\r\none", b" two"),
        (HEAD + b"Transfer-Encoding: chunked\r\n\r\n3\r\none\r\n", b"4\r\n two\r", b"\n0\r\n\r\n"),
        (b"HTTP/1.1 100 Continue\r\n\r\n" + HEAD + b"\r\none two",),
        (HEAD.replace(b"1.1", b"1.0", 1) + b"\r\none two",),
    ],
    ids=["until the end", "by length", "head in pieces", "chunked", "with a 100", "HTTP/1.0"],
)
def test_a_body_is_the_same_however_it_comes(pieces: tuple[bytes, ...]) -> None:
    with agent(*pieces) as url, opened(url) as stream:
        assert (stream.status, stream.reason, stream.content_type) == (200, "OK", "multipart/mixed;boundary=b")
        assert body_of(stream) == b"one two"
        assert stream.read() == b"", "the end is the end"


def test_what_has_not_come_is_not_waited_for() -> None:
    with agent(HEAD + b"\r\none", stays=True) as url, opened(url) as stream:
        time.sleep(0.1)
        assert (stream.read(), stream.read()) == (b"one", None)


def test_the_request_names_host_target_and_who_asks() -> None:
    asked: list[bytes] = []
    with agent(HEAD + b"\r\n", asked=asked) as url, opened(f"{url}/base", ("edge", "s3cret")):
        pass
    lines = asked[0].split(b"\r\n")
    assert lines[0] == b"GET /base/vmc/sample?from=1 HTTP/1.1"
    assert b"Authorization: Basic ZWRnZTpzM2NyZXQ=" in lines
    assert b"Host: " + url.removeprefix("http://").encode() in lines


def test_a_head_that_does_not_come_is_given_up() -> None:
    with agent(HEAD[:20], stays=True) as url, pytest.raises(TimeoutError, match="timed out"):
        opened(url)


def test_another_service_on_the_port_is_named_as_such() -> None:
    with (
        agent(b"SSH-2.0-OpenSSH_9.2\r\n\r\n") as url,
        pytest.raises(ConnectionLostError, match="what answers there is not HTTP"),
    ):
        opened(url)


@pytest.mark.parametrize("answer", [b"", b"SSH-2.0-OpenSSH_9.2\r\n\r\n", HEAD + b"x" * 200_000])
def test_whoever_speaks_no_http_is_a_lost_connection(answer: bytes) -> None:
    with agent(answer) as url, pytest.raises((ConnectionLostError, ConnectionResetError)):
        opened(url)


@pytest.mark.parametrize(
    "torn",
    [b"Content-Length: 70\r\n\r\none", b"Transfer-Encoding: chunked\r\n\r\n30\r\none", b"Transfer-Encoding: chunked\r\n\r\nzz"],
)
def test_a_body_that_is_torn_is_a_lost_connection(torn: bytes) -> None:
    with agent(HEAD + torn) as url, opened(url) as stream, pytest.raises(ConnectionLostError, match="is no whole HTTP message"):
        body_of(stream)
