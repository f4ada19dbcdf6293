"""Nights of several machines that are published at once: each has its turn at the one node."""

import threading
import time
from pathlib import Path

import pytest

from cnctwin.validation import published
from sparkplug.broker import BrokerAddress
from sparkplug.edge_node import EdgeNode
from sparkplug.errors import AnotherRunsError
from sparkplug.metric import NodeId
from tests.sparkplug.test_session_lock import Other


def node(file: Path) -> EdgeNode:
    return EdgeNode(BrokerAddress(), NodeId("cnc", "twin-validation"), session_file=file)


def test_the_second_waits_until_the_first_is_done(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    file = tmp_path / "twin-validation.json"
    first = Other(file)
    threading.Timer(1.0, first.kill).start()
    begun_s = time.monotonic()
    published._own_turn(lambda: node(file)).stop()
    assert time.monotonic() - begun_s >= 0.5
    second = Other(file)
    monkeypatch.setattr(published, "TURN_S_MAX", 0.5)
    try:
        with pytest.raises(AnotherRunsError, match="another one runs"):
            published._own_turn(lambda: node(file))
    finally:
        second.kill()
