"""Streams of host events for the tests of processors, in one line each."""

from typing import Any

from hypothesis import strategies as st

from processors.config import Configuration
from processors.discovery import AnyProcessor
from processors.effects import Effect, Publish, PublishPlain
from processors.engine import Engine
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
    return HostEvent(kind, node, device, T0_MS + round(at_s * 1000), readings)


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
    return Engine(processor, Configuration(processor.config, table, name=processor.name))


def fed(engine: Engine, *events: HostEvent, wall_s: float = 0.0) -> list[Effect]:
    """Feed events one after the other; all effects."""
    return [effect for one in events for effect in engine.feed(one, wall_s)]


def published(effects: list[Effect]) -> list[tuple[int, str, Any, bool]]:
    """What was published: (ms after the start, name, value, is_historical)."""
    return [
        (change.timestamp_ms - T0_MS, change.name, change.value, change.is_historical)
        for effect in effects
        if isinstance(effect, Publish)
        for change in effect.changes
    ]


def plain(effects: list[Effect]) -> dict[str, bytes]:
    """The last plain message on each topic."""
    return {effect.topic: effect.payload for effect in effects if isinstance(effect, PublishPlain)}


SIGNALS = ("spindle_rpm", "spindle_load_pct", "ambient_temp_c", "spindle_temp_c", "tool_number", "program", "twin/raw_score")
_values = st.one_of(
    st.none(),
    st.booleans(),
    st.integers(-(2**63), 2**64 - 1),
    st.floats(allow_nan=True, allow_infinity=True),
    st.floats(0, 200),
    st.text(max_size=5),
    st.binary(max_size=3),
    st.tuples(st.floats(), st.floats()),
)
# Mostly forward in small steps, with standstills, back-steps, leaps of hours, and the ends of what 64 bits can say.
_steps_ms = st.one_of(
    st.integers(0, 3000),
    st.sampled_from([0, 0, -80, -4_000, -900_000, 700_000, 13_320_000, -13_320_000, 10**13, -(10**13)]),
)
_nodes = st.sampled_from(
    [EDGE, EDGE, EDGE, NodeId("cnc", "edge-vibration"), NodeId("cnc", "twin-thermal"), NodeId("cnc", "twin-x")]
)


@st.composite
def _readings(draw: st.DrawFn, at_ms: int) -> tuple[Reading, ...]:
    names = draw(st.lists(st.sampled_from(SIGNALS), max_size=4))
    return tuple(
        Reading(
            name,
            draw(_values),
            min(max(at_ms + draw(st.sampled_from([0, 0, 0, -80, 10**14])), 0), 2**64 - 1),
            draw(st.sampled_from([Quality.GOOD, Quality.GOOD, Quality.GOOD, Quality.BAD, Quality.STALE])),
            "unit",
            draw(st.sampled_from([None, "because"])),
            draw(st.sampled_from([False, False, False, True])),
        )
        for name in names
    )


@st.composite
def wild_streams(draw: st.DrawFn, length_max: int = 25) -> list[HostEvent]:
    """Anything that a broker could ever bring: late, duplicate, null, NaN, out of order, of several sources, dead and born."""
    at_ms = T0_MS
    stream = [birth(0.0, spindle_rpm=0.0, spindle_load_pct=0.0, tool_number=1, program="A")]
    for _ in range(draw(st.integers(0, length_max))):
        if len(stream) > 1 and draw(st.integers(0, 9)) == 0:
            stream.append(stream[-1])
            continue
        at_ms = min(max(at_ms + draw(_steps_ms), 0), 2**63)
        kinds = [EventKind.DATA] * 6 + [EventKind.BIRTH, EventKind.DEATH, EventKind.HOLE]
        kind = draw(st.sampled_from(kinds))
        device = None if kind is EventKind.HOLE else draw(st.sampled_from(["okuma", "okuma", "mazak", None]))
        readings = () if kind in (EventKind.DEATH, EventKind.HOLE) else draw(_readings(at_ms))
        stream.append(HostEvent(kind, draw(_nodes), device, at_ms, readings, "detail"))
    return stream
