"""Calibration: how fast this computer runs the code that a fleet runs, in some seconds, without a broker.

Messages of a simulated machine are decoded by a host session and folded by all processors, in one thread. Compared with what the
same run took on the computer that the figures are of, it says by how much they have to be scaled.
"""

import statistics
import time
from collections.abc import Sequence
from random import Random

from processors.discovery import discover
from processors.running.engine import Engine
from sparkplug.actions import Action, Publish
from sparkplug.datatype import DataType
from sparkplug.edge_session import EdgeNodeSession
from sparkplug.host_session import HostSession
from sparkplug.metric import Change, MetricSpec, NodeId
from twin.vocabulary.nodes import edge_node
from twin.vocabulary.signals import canonical

SIGNALS = (
    "spindle_rpm",
    "spindle_load_pct",
    "spindle_power_kw",
    "feed_mm_min",
    "axis_x_pos_mm",
    "axis_y_pos_mm",
    "axis_z_pos_mm",
    "axis_x_load_pct",
    "vibration_velocity_mm_s",
    "spindle_temp_c",
    "ambient_temp_c",
)
MESSAGES, STEP_MS, START_MS = 500, 100, 1_790_000_000_000
LEFT_OUT = ("historian",)
"""Processors whose work is elsewhere: in the store."""


def calibrated_us(seconds: float = 20.0) -> float:
    """Return the CPU time to decode a message and to fold it in all processors, µs: the median of the rounds in that time."""
    births, data = _messages()
    rounds: list[float] = []
    until_s = time.monotonic() + seconds
    while not rounds or time.monotonic() < until_s:
        rounds.append(_round_us(births, data))
    return statistics.median(rounds)


def _round_us(births: Sequence[Publish], data: Sequence[Publish]) -> float:
    session = HostSession("calibration", chance=Random(0))  # noqa: S311
    session.connected(START_MS)
    engines = [Engine(one, one.configured(None)) for name, one in discover().items() if name not in LEFT_OUT]
    for message in births:
        for event in session.message(message.topic, message.payload, START_MS):
            for engine in engines:
                engine.feed(event, 0.0)
    began_s = time.process_time()
    for message in data:
        for event in session.message(message.topic, message.payload, START_MS):
            for engine in engines:
                engine.feed(event, 0.0)
    return (time.process_time() - began_s) / len(data) * 1e6


def _messages() -> tuple[list[Publish], list[Publish]]:
    """Return the births and the data messages of a machine that cuts."""
    chance = Random(1)  # noqa: S311  the same values each time
    session = EdgeNodeSession(NodeId("cnc", edge_node("m1")), now_ms=START_MS)
    units = [(name, canonical(name)) for name in SIGNALS]
    specs = [MetricSpec(name, DataType.DOUBLE, None if signal is None else signal.unit) for name, signal in units]
    session.declare_device("m1", specs, START_MS)
    session.connecting(0, START_MS)
    births = _published(session.connected(START_MS))
    data: list[Publish] = []
    for number in range(1, MESSAGES + 1):
        now_ms = START_MS + number * STEP_MS
        changes = [Change(name, round(20.0 + 10.0 * chance.random(), 3), now_ms) for name in SIGNALS]
        data += _published(session.publish("m1", changes, now_ms))
    return births, data


def _published(actions: Sequence[Action]) -> list[Publish]:
    return [action for action in actions if isinstance(action, Publish)]
