"""Streams of host events for the tests of processors, in one line each."""

import math
from random import Random
from typing import Any

from hypothesis import strategies as st

from processors.actions import Action, PlainOutput, Publish
from processors.discovery import AnyProcessor
from processors.running.engine import Engine
from sparkplug.host_session import EventKind, HostEvent
from sparkplug.metric import NodeId, Reading
from sparkplug.quality import Quality

EDGE = NodeId("cnc", "edge-okuma")
T0_MS = 1_644_501_060_000  # 2022-02-10T13:51:00Z, a multiple of a second
UNITS = {"spindle_rpm": "rev/min", "spindle_load_pct": "%", "ambient_temp_c": "°C", "spindle_temp_c": "°C"}


def reading(
    name: str, value: Any, at_s: float = 0.0, *, quality: Quality = Quality.GOOD, reason: str | None = None, history: bool = False
) -> Reading:
    """A reading `at_s` seconds after the start of the stream."""
    return Reading(name, value, T0_MS + round(at_s * 1000), quality, UNITS.get(name), reason, history)


def event(kind: EventKind, at_s: float, *readings: Reading, node: NodeId = EDGE, device: str | None = "okuma") -> HostEvent:
    """An event of a machine."""
    return named(HostEvent(kind, node, device, T0_MS + round(at_s * 1000), readings))


def named(event: HostEvent) -> HostEvent:
    """The event as a host session hands it out: with the names and stamps of its readings, where they are live data."""
    if event.kind is not EventKind.DATA or not event.readings or any(reading.is_historical for reading in event.readings):
        return event
    stamps_ms = [reading.timestamp_ms for reading in event.readings]
    names = tuple(reading.name for reading in event.readings)
    return event._replace(names=names, oldest_ms=min(stamps_ms), newest_ms=max(stamps_ms))


def unnamed(event: HostEvent) -> HostEvent:
    """The event without names and stamps: whoever takes it has to look at each reading."""
    return event._replace(names=(), oldest_ms=0, newest_ms=0)


def birth(at_s: float, node: NodeId = EDGE, device: str = "okuma", **values: Any) -> HostEvent:
    """A birth with all values as of `at_s`."""
    return event(EventKind.BIRTH, at_s, *(reading(n, v, at_s) for n, v in values.items()), node=node, device=device)


def data(at_s: float, node: NodeId = EDGE, device: str = "okuma", history: bool = False, **values: Any) -> HostEvent:
    """Changes as of `at_s`."""
    changes = (reading(n, v, at_s, history=history) for n, v in values.items())
    return event(EventKind.DATA, at_s, *changes, node=node, device=device)


def death(at_s: float, node: NodeId = EDGE, device: str = "okuma") -> HostEvent:
    """The death of a device."""
    return HostEvent(EventKind.DEATH, node, device, T0_MS + round(at_s * 1000), (), "device offline")


def hole(at_s: float, node: NodeId = EDGE) -> HostEvent:
    """Messages of a node are lost."""
    return HostEvent(EventKind.HOLE, node, None, T0_MS + round(at_s * 1000), (), "3 messages are lost")


def engine_of(processor: AnyProcessor, **table: Any) -> Engine:
    """An engine with a configuration of its own."""
    return Engine(processor, processor.configured(table))


def fed(engine: Engine, *events: HostEvent, wall_s: float = 0.0) -> list[Action]:
    """Feed events one after the other; all actions."""
    return [action for one in events for action in engine.feed(one, wall_s)]


def published(actions: list[Action]) -> list[tuple[int, str, Any, bool]]:
    """Return what was published: (ms after the start, name, value, is_historical)."""
    return [
        (change.timestamp_ms - T0_MS, change.name, change.value, change.is_historical)
        for action in actions
        if isinstance(action, Publish)
        for change in action.changes
    ]


def plain(actions: list[Action]) -> dict[str, bytes]:
    """The last plain message on each topic."""
    return {action.topic: action.payload for action in actions if isinstance(action, PlainOutput)}


SIGNALS = ("spindle_rpm", "spindle_load_pct", "ambient_temp_c", "spindle_temp_c", "tool_number", "program", "twin/raw_score")
_VALUES = (
    *(None, True, False, 0, 1, -1, 2**53 + 1, -(2**63), 2**64 - 1),
    *(0.0, -0.0, 1e-300, 5e-324, 1.7976931348623157e308, -1e17, math.nan, math.inf, -math.inf),
    *("", "A", "\x00", "Ω\n", "\U0010ffff", b"", b"\x00\xff", (0.0, math.nan), (1.0, -math.inf)),
)
# Mostly forward in small steps, with standstills, back-steps, leaps of hours, and the ends of what 64 bits can say.
_LEAPS_MS = (0, 0, -80, -4_000, -900_000, 700_000, 13_320_000, -13_320_000, 10**13, -(10**13))
_NODES = (EDGE, EDGE, EDGE, NodeId("cnc", "edge-vibration"), NodeId("cnc", "twin-thermal"), NodeId("cnc", "twin-x"))
_KINDS = (*[EventKind.DATA] * 6, EventKind.BIRTH, EventKind.DEATH, EventKind.HOLE)


def _value(chance: Random) -> Any:
    drawn = (chance.choice(_VALUES), chance.uniform(0.0, 200.0), chance.randint(0, 8), 10.0 ** chance.uniform(-30, 30))
    return chance.choice(drawn)


def _readings(chance: Random, at_ms: int) -> tuple[Reading, ...]:
    return tuple(
        Reading(
            name,
            _value(chance),
            min(max(at_ms + chance.choice((0, 0, 0, -80, 10**14)), 0), 2**64 - 1),
            chance.choice((Quality.GOOD, Quality.GOOD, Quality.GOOD, Quality.BAD, Quality.STALE)),
            "unit",
            chance.choice((None, "because")),
            chance.random() < 0.25,
        )
        for name in chance.choices(SIGNALS, k=chance.randrange(5))
    )


def wild_stream(length: int, seed: int) -> list[HostEvent]:
    """Anything that a broker could ever bring: late, duplicate, null, NaN, out of order, of several sources, dead and born."""
    chance, at_ms = Random(seed), T0_MS
    stream = [birth(0.0, spindle_rpm=0.0, spindle_load_pct=0.0, tool_number=1, program="A")]
    for _ in range(length):
        if len(stream) > 1 and chance.randrange(10) == 0:
            stream.append(stream[-1])
            continue
        step_ms = chance.randint(0, 3000) if chance.random() < 0.5 else chance.choice(_LEAPS_MS)
        at_ms = min(max(at_ms + step_ms, 0), 2**63)
        kind = chance.choice(_KINDS)
        device = None if kind is EventKind.HOLE else chance.choice(("okuma", "okuma", "mazak", None))
        readings = () if kind in (EventKind.DEATH, EventKind.HOLE) else _readings(chance, at_ms)
        stream.append(named(HostEvent(kind, chance.choice(_NODES), device, at_ms, readings, "detail")))
    return stream


def wild_streams(length_max: int = 25) -> st.SearchStrategy[list[HostEvent]]:
    """Wild streams by their length and a seed: drawing each value by itself takes longer than what is tested."""
    return st.builds(wild_stream, st.integers(0, length_max), st.integers(0, 2**32))
