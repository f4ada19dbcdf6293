"""The bridge hears machines before it knows what was published: what the broker says meanwhile would be lost."""

from collections.abc import Iterator
from threading import Event
from types import SimpleNamespace
from typing import Any

import pytest

pytest.importorskip("confluent_kafka", reason="no confluent-kafka in this Python; install the extra kafka")

from cnctwin.kafka.bridge import bridge as module
from cnctwin.kafka.bridge.bridge import Bridge
from cnctwin.kafka.settings import KafkaSettings
from cnctwin.kafka.topics import Topics
from processors.discovery import discover
from processors.errors import SnapshotError
from tests.processors.streams import data

WAIT_S_MAX = 30.0


class Host:
    """A host application that hears one message of a machine at each poll."""

    online, queue_depth, on_life = True, 1, None

    def __init__(self) -> None:
        self.polls = 0

    def poll(self, *_: float) -> list[Any]:
        self.polls += 1
        return [data(float(self.polls), spindle_rpm=1000.0)]

    def nodes(self) -> list[Any]:
        return []

    def picture(self, _: object) -> None:
        return None

    def __getattr__(self, name: str) -> Any:
        return lambda *_, **__: []


class Node:
    """An edge node that is online once it is started."""

    online = is_stopped = False

    def start(self) -> None:
        self.online = True

    def stop(self) -> None:
        self.is_stopped = True


class Results:
    """Results published earlier: `begin` learns them once `known` is set, or fails with `error`."""

    def __init__(self) -> None:
        self.known, self.error = Event(), ""
        self.turns = 0
        self.is_closed = False

    def begin(self) -> None:
        assert self.known.wait(WAIT_S_MAX)
        if self.error:
            raise SnapshotError(self.error)

    def turn(self) -> None:
        self.turns += 1

    def close(self) -> None:
        self.is_closed = True

    def __getattr__(self, name: str) -> Any:
        return lambda *_: None


class Log:
    """A log that keeps the events it is given."""

    def __init__(self) -> None:
        self.events: list[Any] = []

    def put(self, topic: str, key: str, event: Any, *_: Any) -> bool:
        self.events.append(event)
        return True

    def close(self) -> int:
        return 0

    def __getattr__(self, name: str) -> Any:
        return lambda *_: []


@pytest.fixture
def it(monkeypatch: pytest.MonkeyPatch) -> Iterator[Any]:
    results, log, node = Results(), Log(), Node()
    monkeypatch.setattr(module, "Back", lambda *_, **__: results)
    monkeypatch.setattr(module, "Outward", lambda *_, **__: log)
    monkeypatch.setattr(module, "Reports", lambda *_: SimpleNamespace(is_due=lambda _: False, leave=lambda _: None, close=list))
    processor = discover()["thermal"]
    host: Any = Host()
    nodes: Any = {"thermal": node}
    settings, pairs = KafkaSettings(bootstrap="127.0.0.1:1"), [(processor, processor.configured({}))]
    bridge = Bridge(settings, Topics("cnc"), "b0", pairs, host=host, nodes=nodes)
    bridge.prepare()
    yield SimpleNamespace(bridge=bridge, results=results, log=log, node=node)
    results.known.set()


def test_machines_are_heard_before_the_edge_nodes_are_born(it: Any) -> None:
    for _ in range(3):
        it.bridge.turn()
    assert len(it.log.events) == 3
    assert not it.node.online and it.results.turns == 0
    it.results.known.set()
    it.bridge._learning.answer(WAIT_S_MAX)
    it.bridge.turn()
    assert it.node.online and it.results.turns == 1 and len(it.log.events) == 4


def test_a_log_that_does_not_answer_ends_the_bridge(it: Any) -> None:
    it.results.error = "the end of partitions [3] is not reached within 120 s"
    it.results.known.set()
    with pytest.raises(SnapshotError, match="partitions"):
        it.bridge.run(Event())
    assert not it.node.online


def test_a_bridge_that_is_to_stop_does_not_wait_for_what_it_learns(it: Any) -> None:
    stop = Event()
    stop.set()
    it.bridge.run(stop)
    assert not it.results.is_closed and not it.node.is_stopped


def test_of_several_bridges_one_hands_on_what_a_processor_of_cells_listens_to(monkeypatch: pytest.MonkeyPatch) -> None:
    """Otherwise every bridge would write each command to all partitions."""
    for name in ("Back", "Outward", "Reports"):
        monkeypatch.setattr(module, name, lambda *_, **__: Results())
    processor, host = discover()["alerts"], Host()
    of = lambda nodes: Bridge(  # noqa: E731
        KafkaSettings(bootstrap="127.0.0.1:1"),
        Topics("cnc"),
        "b0",
        [(processor, processor.configured({}))],
        host=host,  # type: ignore[arg-type]
        nodes=nodes,
    )
    alone, other = of({"alerts": Node()})._plain_filters(), of({})._plain_filters()
    assert set(processor.listens) <= set(alone) and processor.listens
    assert not set(processor.listens) & set(other)
