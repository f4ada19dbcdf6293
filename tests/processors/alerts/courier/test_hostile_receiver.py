"""A receiver that means harm: its answers unfold, drip or never end, and cost neither memory nor time."""

import gzip
import time
import tracemalloc

import pytest

from processors.alerts.courier.exchange import ANSWER_BYTES_MAX, Answer, Request, exchanged, judged
from processors.alerts.courier.outcome import Outcome, Verdict
from tests.processors.alerts.courier.receiving_server import Answer as Reply
from tests.processors.alerts.courier.receiving_server import ReceivingServer

BOMB = gzip.compress(gzip.compress(bytes(256 * 1024 * 1024), 1), 9)


def asked(reply: Reply, timeout_s: float = 30.0) -> tuple[Answer | Outcome, ReceivingServer]:
    with ReceivingServer() as server:
        server.usual = reply
        return exchanged(Request("POST", server.url, {}, content=b"x"), timeout_s), server


@pytest.mark.parametrize("encoding", ["gzip, gzip", "gzip", "br", "deflate"])
def test_an_answer_that_would_unfold_is_left_unread_and_judged_by_its_status(encoding: str) -> None:
    asked(Reply())  # what is loaded once is not counted
    tracemalloc.start()
    try:
        answer, server = asked(Reply(200, BOMB, headers=(("Content-Encoding", encoding),)))
        _, peak_bytes = tracemalloc.get_traced_memory()
    finally:
        tracemalloc.stop()
    assert isinstance(answer, Answer)
    assert (answer.body, answer.wrong) == (b"", f"is compressed ({encoding!r}), which was not asked for")
    assert judged(answer, Request("POST", server.url, {})).verdict is Verdict.DELIVERED
    assert peak_bytes < 8 * 1024 * 1024
    assert server.received[0].headers["accept-encoding"] == "identity"


def test_a_long_answer_is_cut() -> None:
    answer, _ = asked(Reply(200, bytes(3 * ANSWER_BYTES_MAX)))
    assert isinstance(answer, Answer)
    assert (len(answer.body), answer.wrong) == (ANSWER_BYTES_MAX, f"is longer than {ANSWER_BYTES_MAX} bytes")


def test_an_answer_that_drips_has_one_deadline_for_all_of_it(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("processors.alerts.courier.exchange.CONNECT_S_MAX", 1.0)
    begun_s = time.monotonic()
    outcome, _ = asked(Reply(200, b"{}" * 500, drip=True), timeout_s=1.0)
    assert time.monotonic() - begun_s < 60, "the server itself drips for 400 s"
    assert isinstance(outcome, Outcome)
    assert outcome.verdict is Verdict.UNSURE
    assert "no answer within 1 s" in outcome.reason


def test_an_answer_of_the_usual_kind_is_whole() -> None:
    answer, _ = asked(Reply())
    assert isinstance(answer, Answer)
    assert (answer.status, answer.body, answer.wrong) == (200, b"{}", "")
