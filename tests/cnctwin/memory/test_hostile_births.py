"""Anything that can be decoded, from a hostile edge, through one host session into everything that reads it.

Nothing raises, every message that is sent is one that MQTT and Mosquitto take, every ledger balances, and what is known of a
neighbour is what would be known of it if the hostile edge were not there.
"""

from __future__ import annotations

import re
from collections.abc import Iterable, Sequence
from pathlib import Path
from random import Random
from typing import Any

from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from cnctwin.api.live.plant import LivePlant
from cnctwin.memory.store.contract import Message
from cnctwin.memory.store.opening import open_store
from processors.discovery import discover
from processors.running.worker import Worker
from sparkplug.actions import Action, Publish
from sparkplug.admission.gate import Gate
from sparkplug.admission.limits import Limits
from sparkplug.admission.refusal import Quarantined
from sparkplug.codec import encode
from sparkplug.datatype import DataType
from sparkplug.edge_session import EdgeNodeSession
from sparkplug.host_session import EventKind, HostEvent, HostSession
from sparkplug.metric import Change, MetricSpec, NodeId
from sparkplug.schema import PayloadMessage
from sparkplug.topics import Topic, Verb
from sparkplug.values import Metric, Payload
from twin.vocabulary.nodes import is_twin_node
from twin.vocabulary.topics import RESERVED_MACHINES

GOOD, BAD = NodeId("cnc", "edge-okuma"), NodeId("cnc", "edge-hostile")
START_MS = 1_790_000_000_000
FORBIDDEN = re.compile("[\x00-\x1f\x7f-\x9f\ud800-\udfff\ufdd0-\ufdef\ufffe\uffff+#]")
LIMITS = Limits(metrics_a_device_max=12, metrics_a_node_max=40, devices_a_node_max=6, text_bytes_max=2000, value_bytes_max=4000)

DEVICES = (
    "mill",
    "lathe",
    "jobs",
    "ä" * 200,
    "%" * 200,
    "a\x07",
    "\ufeff",
    "\uffff",
    " ",
    ".",
    "..",
    "a.b",
    "x" * 70,
    "%2F",
    "'--",
)
NAMES = (
    *("spindle_rpm", "spindle_load_pct", "spindle_temp_c", "ambient_temp_c", "exec_state", "tool_number", "program"),
    *("twin/spindle_temp_c", "health/lag_s", "ledger/received", "edge_sequence", "bdSeq", "Node Control/Rebirth"),
    *("", "/", "a//b", "%", "+", "#", "a\x00b", "\x1b", "\u2028", "n" * 1024, "n" * 70_000, "%" * 1000, "/" * 300, "constructor"),
)
STAMPS_MS = (START_MS, START_MS, START_MS, 0, 1, 2**31, 2**53, 2**63 - 1, 2**63, 2**64 - 1, START_MS + 900 * 31_557_600_000)
VALUES: tuple[tuple[DataType, Any], ...] = (
    *((DataType.DOUBLE, value) for value in (0.0, -0.0, 1.0, 1e308, 5e-324, float("nan"), float("inf"), float("-inf"))),
    *((DataType.UINT64, value) for value in (0, 2**63, 2**64 - 1)),
    *((DataType.INT64, value) for value in (-(2**63), 2**63 - 1, 3)),
    *((DataType.DATETIME, value) for value in (0, 2**63 - 1)),
    *(
        (DataType.STRING, value)
        for value in ("", "ACTIVE", "constructor", "__proto__", "a\x00", "\ufeff", "x" * 3000, "<b>", "\u2028")
    ),
    *(
        (DataType.BOOLEAN, True),
        (DataType.BYTES, b"\xff" * 5000),
        (DataType.BYTES, b""),
        (DataType.UUID, "?"),
        (DataType.DOUBLE, None),
    ),
    *((DataType.DOUBLE_ARRAY, (1.0, float("nan"))), (DataType.STRING_ARRAY, ("a", "\x07")), (DataType.INT8_ARRAY, (0,) * 5000)),
)


class Broker:
    """A host application for workers that has nothing to say, and takes only what MQTT and Mosquitto take."""

    online, dropped, reconnects, queue_depth, backlog = True, 0, 0, 0, 0
    quarantine: tuple[Quarantined, ...] = ()

    def __init__(self) -> None:
        self.last: dict[str, bytes] = {}

    def take(self, messages: Iterable[Publish]) -> None:
        for message in messages:
            raw = message.topic.encode()
            assert 0 < len(raw) <= 65_535
            assert not FORBIDDEN.search(message.topic), f"Mosquitto closes the connection: {message.topic!r:.200}"
            assert message.topic.count("/") <= 200, "Mosquitto takes no more levels"
            assert len(message.payload) < 5_000_000
            self.last[message.topic] = message.payload

    def publish_plain(self, topic: str, payload: bytes, *, qos: int = 0, retain: bool = False) -> bool:
        self.take([Publish(topic, payload, qos, retain)])
        return True

    def publish_all(self, messages: Sequence[Publish]) -> bool:
        self.take([Publish(*message) for message in messages])
        return True

    def want_birth(self, _: NodeId) -> None: ...
    def send_command(self, *_: Any) -> bool:
        return True

    def subscribe_plain(self, _: str) -> None: ...
    def start(self) -> None: ...
    def stop(self) -> None: ...


class Edge:
    """A worker's edge node: the real session, on the broker above."""

    online, backlog = True, 0

    def __init__(self, name: str, broker: Broker, specs: Sequence[MetricSpec] = ()) -> None:
        self._session, self._broker = EdgeNodeSession(NodeId("cnc", name), specs, now_ms=START_MS), broker
        self._session.connecting(0, START_MS)
        self._do(self._session.connected(START_MS))

    def _do(self, actions: Sequence[Action]) -> bool:
        self._broker.take(action for action in actions if isinstance(action, Publish))
        return bool(actions)

    def declare_device(self, device: str, metrics: Iterable[MetricSpec]) -> None:
        self._do(self._session.declare_device(device, metrics, START_MS))

    def remove_device(self, device: str) -> None:
        self._do(self._session.remove_device(device, START_MS))

    def publish(self, device: str | None, changes: Sequence[Change]) -> bool:
        return True if device is None else self._do(self._session.publish(device, changes, START_MS))

    def start(self) -> None: ...
    def stop(self, timeout_s: float = 5.0) -> None: ...


class Readers:
    """Every processor, the live plant and a store behind one host session."""

    def __init__(self, folder: Path) -> None:
        self.session = HostSession(
            "scada", chance=Random(0), gate=Gate(LIMITS, RESERVED_MACHINES, lambda node: is_twin_node(node.node))
        )
        self.session.connected(START_MS)
        self.broker = Broker()
        self.workers = [
            Worker(one, one.configured({}), self.broker, Edge(one.node, self.broker))  # type: ignore[arg-type]
            for one in discover().values()
        ]
        self.live = LivePlant()
        self.live.watch(None)
        self.live.watch("mill")
        self.store = open_store(str(folder), writable=True)
        self.now_ms = START_MS

    def hear(self, topic: str, payload: bytes) -> None:
        self.now_ms += 10
        self.take(self.session.message(topic, payload, self.now_ms))

    def take(self, events: list[HostEvent]) -> None:
        now_s = self.now_ms / 1000
        for event in events:
            for worker in self.workers:
                if worker.listens_to(event.node.node):
                    worker.take(event, now_s)
                    assert worker.engine.ledger.balance == 0
                    assert worker._faults.faults == 0, (worker.name, worker.fault)
        self.live.take(events, self.now_ms)
        self.live.flush(self.now_ms)
        self.store.append([Message(self.now_ms, event) for event in events if event.kind is not EventKind.REFUSED])

    def known_of(self, machine: str) -> tuple[Any, ...]:
        """Return what readers know of a machine: the mirror's topics, the page, the store."""
        mirror = {topic: payload for topic, payload in self.broker.last.items() if topic.startswith(f"cnc/{machine}/")}
        state = self.live.state(machine, 0)
        assert state is not None
        stored = [message.event for message in self.store.messages(machine, START_MS, START_MS + 10_000_000)]
        assert len(stored) > 20
        return mirror, state["measured"], stored


class Hostile:
    """An edge that says anything that can be decoded; now and then something that means well, so that the rest is read at all."""

    def __init__(self, chance: Random) -> None:
        self._chance = chance
        self._seq, self._sent = 0, 0

    def message(self) -> tuple[str, bytes]:
        chance = self._chance
        verb = chance.choice((Verb.DBIRTH, Verb.DBIRTH, *[Verb.DDATA] * 6, Verb.NDATA, Verb.DDEATH))
        if self._sent == 0 or chance.random() < 0.05:
            verb = Verb.NBIRTH
        device = chance.choice(DEVICES if chance.random() < 0.2 else DEVICES[:2]) if verb.of_device else None
        self._seq = 0 if verb is Verb.NBIRTH else chance.randrange(256) if chance.random() < 0.03 else (self._seq + 1) % 256
        self._sent += 1
        names = chance.sample(NAMES if chance.random() < 0.2 else NAMES[:9], chance.randrange(6))
        metrics = [_metric(chance, name) for name in names]
        if verb is Verb.NBIRTH:
            metrics = [Metric("bdSeq", self._sent % 256, DataType.INT64, START_MS), *metrics[: chance.randrange(2)]]
        stamp_ms = chance.choice(STAMPS_MS) if chance.random() < 0.2 else START_MS + 10 * self._sent
        return str(Topic(verb, BAD, device)), encode(Payload(stamp_ms, tuple(metrics), self._seq))


def _metric(chance: Random, name: str) -> Metric:
    datatype, value = chance.choice(VALUES)
    alias = chance.choice((None, None, 0, 1, 2, 2**64 - 1))
    return Metric(name, value, datatype, chance.choice(STAMPS_MS), alias, is_historical=chance.random() < 0.1)


def neighbour() -> list[tuple[str, bytes]]:
    """The life of a machine that means well."""
    session = EdgeNodeSession(GOOD, now_ms=START_MS)
    specs = [MetricSpec("spindle_rpm", DataType.DOUBLE), MetricSpec("spindle_load_pct", DataType.DOUBLE)]
    actions = [*session.declare_device("okuma", specs, START_MS)]
    session.connecting(0, START_MS)
    actions += session.connected(START_MS)
    for second in range(20):
        at_ms = START_MS + 1000 * second
        changes = [Change("spindle_rpm", 1000.0 + second, at_ms), Change("spindle_load_pct", 20.0 + second, at_ms)]
        actions += session.publish("okuma", changes, at_ms)
    return [(action.topic, action.payload) for action in actions if isinstance(action, Publish)]


@given(seed=st.integers(0, 2**32))
@settings(max_examples=10, deadline=None, suppress_health_check=[HealthCheck.too_slow, HealthCheck.function_scoped_fixture])
def test_what_a_hostile_edge_says_raises_nowhere_and_touches_no_neighbour(tmp_path_factory: Any, seed: int) -> None:
    chance = Random(seed)
    sender = Hostile(chance)
    alone, beside = (Readers(tmp_path_factory.mktemp("store")) for _ in range(2))
    try:
        for topic, payload in neighbour():
            for _ in range(chance.randrange(8)):
                beside.hear(*sender.message())
            alone.hear(topic, payload)
            beside.hear(topic, payload)
        beside.take(beside.session.tick(beside.now_ms + 3000))
        assert beside.known_of("okuma") == alone.known_of("okuma")
        assert not [topic for topic in beside.broker.last if topic.startswith("cnc/jobs/")]
    finally:
        alone.store.close()
        beside.store.close()


def test_bytes_that_no_encoder_writes_raise_nowhere_either(tmp_path: Path) -> None:
    """A name that is no UTF-8, a value in two fields, an empty metric."""
    readers = Readers(tmp_path)
    try:
        message = PayloadMessage(timestamp=START_MS, seq=0)
        message.metrics.add()
        message.metrics.add(name="x", datatype=int(DataType.DOUBLE), alias=1)
        for verb in (Verb.NBIRTH, Verb.DBIRTH, Verb.DDATA, Verb.NDEATH):
            device = "mill" if verb.of_device else None
            for payload in (message.SerializeToString(), b"\x12\x03\x0a\x01\xff", b"", b"\xff"):
                readers.hear(str(Topic(verb, BAD, device)), payload)
    finally:
        readers.store.close()
