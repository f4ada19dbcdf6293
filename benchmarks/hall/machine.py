"""A simulated machine of the load as its edge says it: births of 14 metrics, and data messages made beforehand.

Of the metrics 11 change in each message; `exec_state`, `tool_change_active` and `tool_number` are sent when they change. A data
message is a piece of bytes with room for the time stamp, which is all that has to be put in when it is sent, and for the sequence
number behind it.
"""

import math
import random
import struct
from dataclasses import dataclass
from typing import Any

from benchmarks.hall.packets import PUBLISH, connect, publish, subscribe, text
from cnctwin.planning.calibration import SIGNALS as CHANGING
from sparkplug.actions import Publish, Subscribe
from sparkplug.datatype import DataType
from sparkplug.edge_session import EdgeNodeSession
from sparkplug.layouts.varint import written
from sparkplug.metric import Change, MetricSpec, NodeId
from sparkplug.schema import PayloadMessage
from twin.vocabulary.nodes import edge_node
from twin.vocabulary.signals import SIGNALS, canonical

GROUP = "cnc"
KEEP_ALIVE_S = 60
FLAGS = ("exec_state", "tool_change_active", "tool_number")
ALIAS = {name: number for number, name in enumerate((*CHANGING, *FLAGS), start=1)}
ROOM_MS = 0x155_5AA5_5AA5  # a stamp of six bytes on the wire, as all from 2005 to 2109 are
ROOM = written(ROOM_MS)
POOL = 256
"""Data messages that differ; each machine begins at another one."""


def name_of(number: int) -> str:
    """Return the name of a machine.

    >>> name_of(7)
    'm0007'
    """
    return f"m{number:04d}"


def body(values: dict[str, Any]) -> bytes:
    """Return the metrics of a data message, with room for the stamp, without the sequence number."""
    message = PayloadMessage(timestamp=ROOM_MS)
    for name, value in values.items():
        metric = message.metrics.add(alias=ALIAS[name], timestamp=ROOM_MS)
        if isinstance(value, bool):
            metric.boolean_value = value
        elif isinstance(value, int):
            metric.long_value = value
        elif isinstance(value, str):
            metric.string_value = value
        else:
            metric.double_value = value
    made: bytes = message.SerializeToString()
    assert made.count(ROOM) == 1 + len(values), "a value looks like the room for the stamp"
    return made


def cutting(number: int, chance: random.Random, *, is_changing_tool: bool = False) -> dict[str, float]:
    """Return the values of a machine that cuts, or changes its tool, as a control rounds them."""
    turn = 2.0 * math.pi * number / POOL
    turning = not is_changing_tool
    noise = chance.gauss
    return {
        "spindle_rpm": round(8_000.0 + noise(0, 4), 1) if turning else 0.0,
        "spindle_load_pct": round(45.0 + 10.0 * math.sin(7 * turn) + noise(0, 1), 1) if turning else 0.0,
        "spindle_power_kw": round(6.0 + 1.5 * math.sin(7 * turn) + noise(0, 0.1), 3) if turning else 0.0,
        "feed_mm_min": round(1_200.0 + noise(0, 5), 1) if turning else 15_000.0,
        "axis_x_pos_mm": round(200.0 + 180.0 * math.sin(turn), 3),
        "axis_y_pos_mm": round(150.0 + 120.0 * math.cos(turn), 3),
        "axis_z_pos_mm": round(-40.0 - 4.0 * math.sin(3 * turn), 3),
        "axis_x_load_pct": round(12.0 + 5.0 * math.cos(turn) + noise(0, 0.5), 1),
        "vibration_velocity_mm_s": round(1.1 + abs(noise(0, 0.1)), 3),
        "spindle_temp_c": round(36.0 + 0.1 * math.sin(turn), 2),
        "ambient_temp_c": round(21.0 + 0.05 * math.cos(turn), 2),
    }


@dataclass(frozen=True, slots=True)
class Bodies:
    """The data messages that all machines share: they have the same metrics under the same aliases."""

    cut: tuple[bytes, ...]
    change: tuple[bytes, ...]
    stand: tuple[bytes, ...]

    @classmethod
    def made(cls, seed: int = 1) -> "Bodies":
        """Return the pool."""
        chance = random.Random(seed)
        cut = tuple(body(cutting(number, chance)) for number in range(POOL))
        change = tuple(body(cutting(number, chance, is_changing_tool=True)) for number in range(POOL))
        stand = tuple(body({"ambient_temp_c": round(21.0 + 0.01 * (number % 7), 2)}) for number in range(POOL))
        return cls(cut, change, stand)


def flags(**values: bool | int | str) -> bytes:
    """Return metrics to be put behind those of a data message: a flag that changed."""
    return body(values)[1 + len(ROOM) :]


def specs() -> list[MetricSpec]:
    """Return the metrics of the birth, with unit, range and meaning, as the project's own edges declare them."""
    types = {"exec_state": DataType.STRING, "tool_change_active": DataType.BOOLEAN, "tool_number": DataType.INT64}
    first = {"exec_state": "ACTIVE", "tool_change_active": False, "tool_number": 1} | cutting(0, random.Random(0))
    made = []
    for name in ALIAS:
        signal = canonical(name) or SIGNALS[name]
        properties = {"meaning": signal.meaning}
        value: Any = first[name]
        made.append(
            MetricSpec(name, types.get(name, DataType.DOUBLE), signal.unit or None, signal.low, signal.high, properties, value)
        )
    return made


class Machine:
    """One machine: its session (births, will, rebirths), and the heads of its data messages."""

    __slots__ = ("_bd_seq", "_heads", "_session", "_topic", "name", "seq", "tool")

    def __init__(self, number: int, now_ms: int) -> None:
        self.name = name_of(number)
        self._session = EdgeNodeSession(NodeId(GROUP, edge_node(self.name)), now_ms=now_ms)
        self._session.declare_device(self.name, specs(), now_ms)
        assert all(self._session.aliases[self.name, name] == alias for name, alias in ALIAS.items())
        self._topic = f"spBv1.0/{GROUP}/DDATA/{edge_node(self.name)}/{self.name}"
        self._heads: dict[int, bytes] = {}
        self._bd_seq = -1
        self.seq, self.tool = 0, 1

    def hello(self, now_ms: int) -> bytes:
        """Return the CONNECT, whose will is the death of the node."""
        self._session.lost()
        self._bd_seq = (self._bd_seq + 1) % 256
        will = self._session.connecting(self._bd_seq, now_ms).will
        assert will is not None
        return connect(f"load-{self.name}", KEEP_ALIVE_S, (will.topic, will.payload))

    def births(self, now_ms: int) -> bytes:
        """Return the subscription to commands and the birth certificates, which follow the CONNECT."""
        made = self._session.connected(now_ms)
        asked = subscribe([action.topic_filter for action in made if isinstance(action, Subscribe)])
        return asked + self._sent(made)

    def answer(self, topic: str, payload: bytes, now_ms: int) -> bytes:
        """Return what the node answers a command: births, if they are asked for."""
        return self._sent(self._session.message(topic, payload, now_ms))

    def tick(self, now_ms: int) -> bytes:
        """Return a rebirth that had to wait, or nothing."""
        return self._sent(self._session.tick(now_ms))

    def note(self, now_ms: int, **values: bool | int | str) -> None:
        """Keep what changed for the next birth."""
        self._session.note(self.name, [Change(name, value, now_ms) for name, value in values.items()])

    def data(self, made: bytes, stamp: bytes) -> bytes:
        """Return a data message as a packet: topic, metrics with their stamp, sequence number."""
        tail = SEQUENCE[self.seq]
        self.seq = (self.seq + 1) & 0xFF
        size = len(made) + len(tail)
        head = self._heads.get(size)
        if head is None:
            topic = text(self._topic)
            head = self._heads[size] = struct.pack("B", PUBLISH) + written(len(topic) + size) + topic
        return head + made.replace(ROOM, stamp) + tail

    def _sent(self, actions: Any) -> bytes:
        births = [action for action in actions if isinstance(action, Publish)]
        if births:
            self.seq = len(births)
        return b"".join(publish(action.topic, action.payload) for action in births)


SEQUENCE = tuple(b"\x18" + written(number) for number in range(256))
"""The field `seq` of a payload, for each number."""
