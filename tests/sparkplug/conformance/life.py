"""A whole life of an edge node and of a host application, every message of it kept for the tests of the statements."""

from __future__ import annotations

from dataclasses import dataclass, field
from random import Random
from typing import Any

from sparkplug.actions import Action, Connect, Disconnect, Publish, Subscribe, WalkToNextServer
from sparkplug.codec import encode, parse
from sparkplug.datatype import DataType
from sparkplug.edge_session import REBIRTH, EdgeNodeSession
from sparkplug.host_session import HostEvent, HostSession
from sparkplug.metric import Change, MetricSpec, NodeId
from sparkplug.quality import Quality
from sparkplug.topics import Topic, Verb
from sparkplug.values import DataSet, Metric, Parameter, Payload, Template

NODE = NodeId("cnc", "edge-okuma")
HOST_ID = "scada"
STATE_TOPIC = "spBv1.0/STATE/scada"
EPOCH_MS = 1_750_000_000_000
AXIS = Template(
    ref=None,
    metrics=(Metric("position", None, DataType.DOUBLE), Metric("load", None, DataType.DOUBLE)),
    parameters=(Parameter("letter", DataType.STRING, "X"), Parameter("stroke", DataType.DOUBLE, None)),
    version="1.0",
    is_definition=True,
)
X_AXIS = Template(
    ref="Axis",
    metrics=(
        Metric("position", 12.5, DataType.DOUBLE, EPOCH_MS),
        Metric("load", 3.0, DataType.DOUBLE, EPOCH_MS),
    ),
    parameters=(Parameter("letter", DataType.STRING, "X"),),
)
OFFSETS = DataSet(("tool", "length"), (DataType.UINT8, DataType.DOUBLE), ((1, 120.5), (2, None)))
NODE_METRICS = (
    MetricSpec("health/lag", DataType.INT64, unit="ms", value=0),
    MetricSpec("health/agent", DataType.STRING),
)
OKUMA_METRICS = (
    MetricSpec("spindle_load", DataType.DOUBLE, unit="%", low=0.0, high=200.0),
    MetricSpec("tool_number", DataType.INT32),
    MetricSpec("execution", DataType.STRING),
    MetricSpec("x_axis", DataType.TEMPLATE, value=X_AXIS),
    MetricSpec("offsets", DataType.DATASET, value=OFFSETS),
)
PROBE_METRICS = (MetricSpec("temperature", DataType.FLOAT, unit="°C", value=20.5),)


@dataclass(frozen=True)
class Sent:
    """A message that an edge node handed to its transport."""

    session: int
    at_ms: int
    topic: Topic
    payload: Any
    raw: Publish

    @property
    def verb(self) -> Verb:
        """The message type."""
        return self.topic.verb

    @property
    def names(self) -> list[str]:
        """The names of its metrics."""
        return [metric.name for metric in self.payload.metrics]

    def metric(self, name: str) -> Any:
        """The one metric with this name, as the protobuf message."""
        (found,) = (metric for metric in self.payload.metrics if metric.name == name)
        return found


@dataclass
class EdgeLife:
    """Drives an EdgeNodeSession and keeps what it sends; the time goes on by 100 ms with each step."""

    session: EdgeNodeSession
    now_ms: int = EPOCH_MS
    connects: list[Connect] = field(default_factory=list)
    sent: list[Sent] = field(default_factory=list)
    log: list[tuple[int, Action | Connect]] = field(default_factory=list)

    def connect(self, bd_seq: int, server: int = 0) -> list[Sent]:
        """Open the next connection; hands back what was published on it."""
        connect = self.session.connecting(bd_seq, self._later(), server)
        self.connects.append(connect)
        self.log.append((len(self.connects) - 1, connect))
        return self.take(self.session.connected(self._later()))

    def take(self, actions: list[Action]) -> list[Sent]:
        """Keep what the session asked for."""
        session = len(self.connects) - 1
        self.log += [(session, action) for action in actions]
        sent = [
            Sent(session, self.now_ms, Topic.parse(action.topic), parse(action.payload), action)
            for action in actions
            if isinstance(action, Publish)
        ]
        self.sent += sent
        return sent

    def declare(self, device: str, metrics: tuple[MetricSpec, ...]) -> list[Sent]:
        """Add a device, or declare it again."""
        return self.take(self.session.declare_device(device, metrics, self._later()))

    def remove(self, device: str) -> list[Sent]:
        """Lose a device."""
        return self.take(self.session.remove_device(device, self._later()))

    def publish(self, device: str | None, *changes: Change) -> list[Sent]:
        """Publish changes."""
        return self.take(self.session.publish(device, changes, self._later()))

    def receive(self, topic: str, payload: bytes) -> list[Sent]:
        """A message reaches the edge node."""
        return self.take(self.session.message(topic, payload, self._later()))

    def command(self, *metrics: Metric, device: str | None = None) -> list[Sent]:
        """A command reaches the edge node."""
        topic = Topic(Verb.NCMD if device is None else Verb.DCMD, NODE, device)
        return self.receive(str(topic), encode(Payload(self.now_ms, metrics)))

    def rebirth(self) -> list[Sent]:
        """A host asks for a rebirth, long enough after the last one."""
        self.wait(10_000)
        return self.command(Metric(REBIRTH, True, DataType.BOOLEAN))

    def wait(self, milliseconds: int) -> list[Sent]:
        """Time passes."""
        self.now_ms += milliseconds
        return self.take(self.session.tick(self.now_ms))

    def lose(self) -> None:
        """The connection breaks."""
        self.session.lost()

    def close(self) -> list[Sent]:
        """The edge node ends by its own will."""
        return self.take(self.session.close(self._later()))

    def of(self, *verbs: Verb) -> list[Sent]:
        """All messages of these types, in order."""
        return [sent for sent in self.sent if sent.verb in verbs]

    def subscriptions(self, session: int) -> list[Subscribe]:
        """Return what was subscribed on a connection."""
        return [action for number, action in self.log if number == session and isinstance(action, Subscribe)]

    def deaths(self) -> list[Any]:
        """The payloads of all wills and of all NDEATHs that were published."""
        return [parse(c.will.payload) for c in self.connects] + [sent.payload for sent in self.of(Verb.NDEATH)]

    def endings(self) -> list[Action]:
        """The disconnections that the session asked for."""
        return [action for _, action in self.log if isinstance(action, Disconnect | WalkToNextServer)]

    def _later(self) -> int:
        self.now_ms += 100
        return self.now_ms


def change(name: str, value: Any, at_ms: int, **more: Any) -> Change:
    """A change of a metric."""
    return Change(name, value, at_ms, **more)


def whole_edge_life() -> EdgeLife:
    """Births, data with nulls and history, devices that come and go, a rebirth, commands, deaths of all kinds, a wrap of seq."""
    session = EdgeNodeSession(NODE, NODE_METRICS, now_ms=EPOCH_MS, templates={"Axis": AXIS})
    session.declare_device("okuma", OKUMA_METRICS, EPOCH_MS)
    life = EdgeLife(session)
    life.connect(bd_seq=0)
    life.publish(None, change("health/lag", 12, life.now_ms))
    life.publish("okuma", change("spindle_load", 37.5, life.now_ms), change("execution", "ACTIVE", life.now_ms - 50))
    bad = {"quality": Quality.BAD, "reason": "outside 0 to 200 %"}
    life.publish("okuma", change("spindle_load", None, life.now_ms, **bad), change("tool_number", -1, life.now_ms))
    life.publish("okuma", change("spindle_load", 40.0, life.now_ms))
    old_ms = life.now_ms - 60_000
    life.publish("okuma", change("tool_number", 7, old_ms, is_historical=True), change("tool_number", 8, life.now_ms))
    life.declare("probe", PROBE_METRICS)
    life.publish("probe", change("temperature", 21.25, life.now_ms))
    life.remove("probe")
    life.declare("probe", PROBE_METRICS)
    life.command(Metric("health/lag", 0, DataType.INT64))
    life.command(Metric("tool_number", 3, DataType.INT32), device="okuma")
    life.rebirth()
    life.publish(None, change("health/agent", "up", life.now_ms))
    life.close()
    life.connect(bd_seq=1)
    for value in range(300):
        owner, name = (None, "health/lag") if value % 3 else ("okuma", "tool_number")
        life.publish(owner, change(name, value, life.now_ms))
    life.remove("probe")
    life.lose()
    life.publish(None, change("health/lag", 99, life.now_ms))
    life.connect(bd_seq=2)
    life.publish("okuma", change("execution", "STOPPED", life.now_ms))
    life.close()
    return life


@dataclass
class HostLife:
    """Drives a HostSession with the messages of edge nodes; the time goes on only when told."""

    session: HostSession
    now_ms: int = EPOCH_MS
    connects: list[Connect] = field(default_factory=list)
    actions: list[Action] = field(default_factory=list)

    def connect(self) -> list[Action]:
        """Open the next connection; hands back what the host asked for on it."""
        self.connects.append(self.session.connecting(self.now_ms))
        self.now_ms += 25
        self.session.connected(self.now_ms)
        return self.take()

    def take(self) -> list[Action]:
        """Return what the host has asked for since the last time."""
        actions, self.session.actions = self.session.actions, []
        self.actions += actions
        return actions

    def receive(self, *messages: Sent) -> list[HostEvent]:
        """Messages of an edge node arrive."""
        events = []
        for sent in messages:
            events += self.session.message(sent.raw.topic, sent.raw.payload, self.now_ms)
        return events

    def own_state(self, payload: bytes) -> list[Action]:
        """A message on the host's own STATE topic arrives."""
        self.session.message(STATE_TOPIC, payload, self.now_ms)
        return self.take()

    def wait(self, milliseconds: int) -> list[HostEvent]:
        """Time passes."""
        self.now_ms += milliseconds
        return self.session.tick(self.now_ms)

    def close(self) -> list[Action]:
        """The host ends by its own will."""
        actions = self.session.close(self.now_ms)
        self.actions += actions
        return actions


def new_host_life(**options: Any) -> HostLife:
    """A host application that has not connected yet."""
    return HostLife(HostSession(HOST_ID, chance=Random(0), **options))
