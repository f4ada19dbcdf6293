"""A runner that is fenced comes in once more if it had its name by right; one that has just come ends."""

from threading import Event
from types import SimpleNamespace
from typing import Any

import pytest

pytest.importorskip("confluent_kafka", reason="no confluent-kafka in this Python; install the extra kafka")

from cnctwin.kafka import running as module
from cnctwin.kafka.running import SETTLED_S, run_over_kafka
from cnctwin.kafka.settings import KafkaSettings
from cnctwin.kafka.transaction import FencedError
from processors.discovery import discover

CLAIMED: Any = SimpleNamespace(name="cnctwin.cnc.thermal.r0")
"""A stand-in for a claimed name."""


class Runners:
    """Runners that are fenced after so many seconds each; the one after them is stopped."""

    def __init__(self, *lived_s: float) -> None:
        self.lived_s, self.now_s, self.started = list(lived_s), 1000.0, 0

    def __call__(self, *_: object, **__: object) -> "Runners":
        return self

    def run(self, stop: Event) -> None:
        self.started += 1
        if not self.lived_s:
            stop.set()
            return
        self.now_s += self.lived_s.pop(0)
        raise FencedError("kafka: r0 is taken by another process")


def without_kafka(monkeypatch: pytest.MonkeyPatch, runners: Runners) -> None:
    """Replace whatever would ask the cluster for something: no thread waits for an answer after the test."""
    monkeypatch.setattr(module, "Runner", runners)
    monkeypatch.setattr(module, "ensure", lambda *_, **__: None)
    monkeypatch.setattr(module, "refuse_overlap", lambda *_: None)
    monkeypatch.setattr(module, "Transactions", lambda *_: CLAIMED)


def start(monkeypatch: pytest.MonkeyPatch, runners: Runners, stop: Event | None = None) -> None:
    without_kafka(monkeypatch, runners)
    monkeypatch.setattr(module.time, "monotonic", lambda: runners.now_s)
    processor = discover()["thermal"]
    pairs = [(processor, processor.configured({}))]
    run_over_kafka(
        KafkaSettings(bootstrap="127.0.0.1:1"), pairs, stop or Event(), group="cnc", member="r0", claimed=CLAIMED, broker=None
    )


def test_a_runner_that_was_in_for_long_comes_in_again_each_time(monkeypatch: pytest.MonkeyPatch) -> None:
    runners = Runners(SETTLED_S, 3 * SETTLED_S)
    start(monkeypatch, runners)
    assert runners.started == 3


def test_one_that_has_just_come_leaves_the_name_to_the_other(monkeypatch: pytest.MonkeyPatch) -> None:
    runners = Runners(SETTLED_S, SETTLED_S - 1)
    with pytest.raises(FencedError):
        start(monkeypatch, runners)
    assert runners.started == 2


def test_one_that_is_to_end_does_not_begin(monkeypatch: pytest.MonkeyPatch) -> None:
    runners, stop = Runners(), Event()
    stop.set()
    start(monkeypatch, runners, stop)
    assert runners.started == 0
