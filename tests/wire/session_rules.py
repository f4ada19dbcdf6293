"""The rules of Sparkplug 3.0.0 that a recording of the wire must keep, whatever the faults on it.

`violations(proxy.recorded)` is empty for edge nodes and host applications that keep them; otherwise each entry names the
connection, the packet and the rule. What is published outside the namespace is not looked at.
"""

from __future__ import annotations

import json
from collections.abc import Iterable, Iterator
from dataclasses import dataclass, field
from typing import Any

from sparkplug.codec import parse
from sparkplug.datatype import DataType
from sparkplug.errors import PayloadError
from sparkplug.topics import Topic, Verb
from tests.wire.mqtt_packets import MQTT_5, Connect, Disconnect, Packet, Publish, Subscribe
from tests.wire.recording import Recorded

WITH_WILL = 0x04
CONTROL = {"bdSeq", "Node Control/Rebirth"}


def violations(recorded: Iterable[Recorded], *, first_bd_seq: int | None = 0) -> list[str]:
    """All broken rules, in order. `first_bd_seq` None accepts any number for the first CONNECT of a node."""
    last_bd_seq: dict[str, int] = {}
    sessions: dict[int, _Edge | _Host | None] = {}
    found = []
    for number, packet in ((seen.connection, seen.packet) for seen in recorded if seen.direction == "up"):
        if isinstance(packet, Connect):
            sessions[number] = _session(packet)
            rules = _connect_rules(packet, last_bd_seq, first_bd_seq)
        else:
            session = sessions.get(number)
            rules = iter(()) if session is None else session.packet(packet)
        found += [f"connection {number}, {_name(packet)}: {rule}" for rule in rules]
    return found


def _name(packet: Packet) -> str:
    return f"{type(packet).__name__} {packet.topic}" if isinstance(packet, Publish) else type(packet).__name__


def _session(connect: Connect) -> _Edge | _Host | None:
    if connect.will is None:
        return None
    if connect.will.topic.startswith("spBv1.0/STATE/"):
        return _Host(connect)
    return _Edge(connect) if "/NDEATH/" in connect.will.topic else None


def _connect_rules(connect: Connect, last_bd_seq: dict[str, int], first_bd_seq: int | None) -> Iterator[str]:
    if not connect.clean:
        yield "the session is not clean"
    if connect.version >= MQTT_5 and dict(connect.properties).get("session_expiry_interval", 0) != 0:
        yield "the session outlives the connection"
    will = connect.will
    if will is None:
        return
    if will.topic.startswith("spBv1.0/STATE/"):
        if (will.qos, will.retain) != (1, True):
            yield f"the will of a host has QoS {will.qos}, retain {will.retain}; it needs 1 and true"
        yield from _state_rules(will.payload, online=False)
    elif "/NDEATH/" in will.topic:
        if (will.qos, will.retain) != (1, False):
            yield f"the will of a node has QoS {will.qos}, retain {will.retain}; it needs 1 and false"
        yield from _death_rules(will.payload, None)
        number = _bd_seq(parse(will.payload))
        expected = (last_bd_seq[will.topic] + 1) % 256 if will.topic in last_bd_seq else first_bd_seq
        if number is not None and expected not in (None, number):
            yield f"bdSeq {number} where {expected} is due"
        if number is not None:
            last_bd_seq[will.topic] = number


def _death_rules(payload: bytes, bd_seq: int | None) -> Iterator[str]:
    message = parse(payload)
    if [metric.name for metric in message.metrics] != ["bdSeq"] or message.metrics[0].datatype != DataType.INT64:
        yield "an NDEATH carries one metric, bdSeq of type Int64"
    if message.HasField("seq"):
        yield "an NDEATH carries no sequence number"
    if bd_seq is not None and _bd_seq(message) != bd_seq:
        yield f"the NDEATH has bdSeq {_bd_seq(message)}, the CONNECT had {bd_seq}"


def _state_rules(payload: bytes, *, online: bool, timestamp_ms: int | None = None) -> Iterator[str]:
    try:
        state = json.loads(payload)
    except ValueError:
        state = None
    if not isinstance(state, dict) or set(state) != {"online", "timestamp"} or type(state["timestamp"]) is not int:
        yield f"STATE {payload[:60]!r} is not {{'online': …, 'timestamp': …}}"
    elif state["online"] is not online:
        yield f"STATE says online {state['online']!r}; {online} is due"
    elif timestamp_ms is not None and state["timestamp"] != timestamp_ms:
        yield f"STATE has the time stamp {state['timestamp']}, the will has {timestamp_ms}"


def _bd_seq(message: Any) -> int | None:
    return next((int(metric.long_value) for metric in message.metrics if metric.name == "bdSeq"), None)


@dataclass
class _Edge:
    """One connection of an edge node."""

    connect: Connect
    born: bool = False
    dead: bool = False
    seq: int = 0
    devices: set[str] = field(default_factory=set)
    owners: dict[int, tuple[str | None, str]] = field(default_factory=dict)
    has_data: bool = False

    def packet(self, packet: Packet) -> Iterator[str]:
        """The rules that a packet breaks."""
        if isinstance(packet, Disconnect):
            if self.connect.version >= MQTT_5 and packet.reason != WITH_WILL:
                yield f"the DISCONNECT has the reason 0x{packet.reason:02x}; 0x04 is due"
            if self.connect.version < MQTT_5 and not self.dead:
                yield "no NDEATH before the DISCONNECT"
        elif isinstance(packet, Subscribe):
            if self.born and any("/NCMD/" in topic for topic, _ in packet.filters):
                yield "commands are subscribed after the birth"
            if any(qos != 1 for topic, qos in packet.filters if "CMD/" in topic):
                yield "commands are not subscribed with QoS 1"
        elif isinstance(packet, Publish) and packet.topic.startswith("spBv1.0/"):
            try:
                topic, message = Topic.parse(packet.topic), parse(packet.payload)
            except PayloadError as error:
                yield str(error)
                return
            yield from self._publish(packet, topic, message)

    def _publish(self, packet: Publish, topic: Topic, message: Any) -> Iterator[str]:
        if self.dead:
            yield "something is published after the NDEATH"
        if packet.retain:
            yield "it is retained"
        if not message.HasField("timestamp"):
            yield "it does not say when it was sent"
        if topic.verb is Verb.NDEATH:
            self.dead = True
            yield from _death_rules(packet.payload, self._bd_seq)
            return
        if packet.qos != 0:
            yield f"it has QoS {packet.qos}; 0 is due"
        yield from self._counting(topic.verb, message)
        if not all(metric.HasField("timestamp") for metric in message.metrics):
            yield "a metric has no time stamp"
        match topic.verb:
            case Verb.NBIRTH:
                yield from self._node_birth(message)
            case Verb.DBIRTH:
                self.devices.add(topic.device or "")
                yield from self._birth(topic.device, message)
            case Verb.DDEATH:
                if topic.device not in self.devices:
                    yield "a device dies that was not born"
                self.devices.discard(topic.device or "")
            case Verb.NDATA | Verb.DDATA:
                yield from self._data(topic, message)
            case _:
                yield "an edge node publishes no commands"

    @property
    def _bd_seq(self) -> int | None:
        assert self.connect.will is not None
        return _bd_seq(parse(self.connect.will.payload))

    def _counting(self, verb: Verb, message: Any) -> Iterator[str]:
        if not message.HasField("seq"):
            yield "it has no sequence number"
        elif verb is Verb.NBIRTH and message.seq != 0:
            yield f"the sequence number of an NBIRTH is {message.seq}"
        elif verb is not Verb.NBIRTH and not self.born:
            yield "it goes before the NBIRTH"
        elif verb is not Verb.NBIRTH and message.seq != (self.seq + 1) % 256:
            yield f"the sequence number is {message.seq} where {(self.seq + 1) % 256} is due"
        self.seq = message.seq

    def _node_birth(self, message: Any) -> Iterator[str]:
        self.born = True
        self.devices.clear()
        self.owners.clear()
        if _bd_seq(message) != self._bd_seq:
            yield f"the NBIRTH has bdSeq {_bd_seq(message)}, the CONNECT had {self._bd_seq}"
        rebirths = [metric for metric in message.metrics if metric.name == "Node Control/Rebirth"]
        if [(m.datatype, m.boolean_value, m.HasField("alias")) for m in rebirths] != [(DataType.BOOLEAN, False, False)]:
            yield "Node Control/Rebirth is not one Boolean that is false and has no alias"
        yield from self._birth(None, message)

    def _birth(self, device: str | None, message: Any) -> Iterator[str]:
        for metric in message.metrics:
            if not metric.name or not DataType.INT8 <= metric.datatype <= DataType.DATETIME_ARRAY:
                yield f"metric {metric.name!r} lacks a name or a datatype"
            if (metric.WhichOneof("value") is None) != metric.is_null:
                yield f"metric {metric.name!r} is neither a value nor a null"
            if metric.HasField("template_value") and metric.template_value.is_definition and device is not None:
                yield f"the template {metric.name!r} is defined in a DBIRTH"
            if metric.HasField("alias") and self.owners.setdefault(metric.alias, (device, metric.name)) != (device, metric.name):
                yield f"the alias {metric.alias} stands for two metrics"

    def _data(self, topic: Topic, message: Any) -> Iterator[str]:
        if topic.device is not None and topic.device not in self.devices:
            yield "a device sends that was not born"
        times_ms = [metric.timestamp for metric in message.metrics if not metric.is_historical]
        if times_ms != sorted(times_ms):
            yield "its values do not stand in the order of their times"
        for metric in message.metrics:
            if metric.HasField("name") or metric.HasField("datatype"):
                yield "a metric carries its name or its datatype although it has an alias"
            elif self.owners.get(metric.alias, (None, ""))[0] != topic.device or metric.alias not in self.owners:
                yield f"the alias {metric.alias} was not born"


@dataclass
class _Host:
    """One connection of a host application."""

    connect: Connect
    subscribed: set[str] = field(default_factory=set)
    born: bool = False
    dead: bool = False

    def packet(self, packet: Packet) -> Iterator[str]:
        """The rules that a packet breaks."""
        will = self.connect.will
        assert will is not None
        if isinstance(packet, Subscribe):
            self.subscribed.update(topic for topic, _ in packet.filters)
        elif isinstance(packet, Disconnect):
            if self.born and not self.dead:
                yield "no death before the DISCONNECT"
        elif isinstance(packet, Publish) and self.dead:
            yield "something is published after the death"
        elif isinstance(packet, Publish) and packet.topic == will.topic:
            yield from self._state(packet, json.loads(will.payload)["timestamp"])
        elif isinstance(packet, Publish) and not self.born:
            yield "it goes before the birth"
        elif isinstance(packet, Publish) and packet.topic.startswith("spBv1.0/"):
            yield from _command_rules(packet)

    def _state(self, packet: Publish, will_ms: int) -> Iterator[str]:
        if (packet.qos, packet.retain) != (1, True):
            yield f"STATE has QoS {packet.qos}, retain {packet.retain}; it needs 1 and true"
        if b"true" in packet.payload:
            if packet.topic not in self.subscribed or len(self.subscribed) < 2:
                yield "the birth goes before the subscriptions"
            self.born = True
            yield from _state_rules(packet.payload, online=True, timestamp_ms=will_ms)
        else:
            self.dead = True
            yield from _state_rules(packet.payload, online=False)


def _command_rules(packet: Publish) -> Iterator[str]:
    topic, message = Topic.parse(packet.topic), parse(packet.payload)
    if topic.verb not in (Verb.NCMD, Verb.DCMD):
        yield "a host publishes nothing but commands in the namespace"
    if packet.qos != 0 or packet.retain:
        yield f"a command has QoS {packet.qos}, retain {packet.retain}; it needs 0 and false"
    if message.HasField("seq") or not message.HasField("timestamp"):
        yield "a command has a time stamp and no sequence number"
