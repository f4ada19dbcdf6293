"""A server that means harm: its answers unfold, never end, drip or are of another shape; a reader gets one line, and soon."""

import gzip
import time

import pytest

from cnctwin.memory.store.contract import StoreError
from cnctwin.memory.store.influx import plain_http
from cnctwin.memory.store.influx.address import parse
from cnctwin.memory.store.influx.plain_http import PlainHttp
from cnctwin.memory.store.influx.server import ServerAwayError
from tests.processors.alerts.courier.receiving_server import Answer, ReceivingServer

BOMB = gzip.compress(gzip.compress(bytes(64 * 1024 * 1024), 1), 9)


def asked(reply: Answer, timeout_s: float = 30.0) -> str:
    with ReceivingServer() as server:
        server.usual = reply
        return PlainHttp(parse(f"victoriametrics+{server.url}?timeout_s={timeout_s}", {})).get("/metrics", {"a": ["1", "2"]})


def test_an_answer_that_would_unfold_is_refused_unread() -> None:
    with pytest.raises(StoreError, match=r"/metrics: the answer is compressed \('gzip, gzip'\), which was not asked for"):
        asked(Answer(200, BOMB, headers=(("Content-Encoding", "gzip, gzip"),)))


def test_an_answer_without_an_end_is_refused(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(plain_http, "ANSWER_BYTES_MAX", 10_000)
    assert asked(Answer(200, b"x" * 10_000)) == "x" * 10_000
    with pytest.raises(StoreError, match="the answer is longer than 10000 bytes; ask for less at once"):
        asked(Answer(200, b"x" * 10_001))


def test_an_answer_that_drips_has_one_deadline_for_all_of_it(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("processors.alerts.courier.exchange.CONNECT_S_MAX", 0.5)
    begun_s = time.monotonic()
    with pytest.raises(StoreError, match="no answer within 1 s"):
        asked(Answer(200, b"{}" * 500, drip=True), timeout_s=1.0)
    with ReceivingServer() as server, pytest.raises(ServerAwayError, match="no answer within 1 s"):
        server.usual = Answer(204, b"", drip=True)
        PlainHttp(parse(f"influx1+{server.url}?timeout_s=1", {})).post_lines("/write", b"m v=1 1\n", {"db": "x"})
    assert time.monotonic() - begun_s < 60, "the server itself drips for 400 s"


@pytest.mark.parametrize("text", [b"<html>", b"", b"[" * 100_000])
def test_what_is_no_document_is_one_line(text: bytes) -> None:
    with ReceivingServer() as server:
        server.usual = Answer(200, text)
        with pytest.raises(StoreError, match="the answer is no JSON; is that a VictoriaMetrics"):
            PlainHttp(parse(f"victoriametrics+{server.url}", {})).get_json("/api/v1/series", {})
