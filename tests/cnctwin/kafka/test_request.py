"""A request that never returns holds nobody up."""

from threading import Event

import pytest

pytest.importorskip("confluent_kafka", reason="no confluent-kafka in this Python; install the extra kafka")

from cnctwin.kafka import request as module
from cnctwin.kafka.request import HungError, Request, closed


def test_an_answer_or_an_error_comes_through() -> None:
    assert Request(lambda: 7).answer() == 7
    with pytest.raises(ZeroDivisionError):
        Request(lambda: 1 // 0).answer()


def test_one_that_hangs_is_left_behind(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(module, "CLOSE_S_MAX", 0.05)
    forever = Event()
    hung = Request(forever.wait)
    with pytest.raises(HungError, match=r"within 0\.01 s"):
        hung.answer(0.01)
    assert not hung.is_over and not closed(forever.wait, "cnctwin.cnc.results")
    forever.set()
    assert hung.answer(30.0) is True and hung.is_over and closed(forever.wait, "cnctwin.cnc.results")
