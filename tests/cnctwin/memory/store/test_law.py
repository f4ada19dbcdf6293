"""The law of the store: whatever comes, in whatever batches, sealed and reopened when it may, each sample is there once."""

import math
import shutil
import struct
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from cnctwin.memory.store.contract import Message, Query
from cnctwin.memory.store.embedded import EmbeddedStore
from sparkplug.host_session import EventKind
from sparkplug.metric import Reading
from sparkplug.quality import Quality
from tests.cnctwin.memory.store.told import EDGE, GOOD, HOUR_MS, STALE, T0_MS, TWIN, Law, told
from tests.depth import IS_FULL

ODD_NAN = struct.unpack("<d", b"\x01\x00\x00\x00\x00\x00\xf8\xff")[0]
VALUES: dict[str, Any] = {
    "x_mm": st.one_of(st.sampled_from([0.0, -0.0, 0.1, 1e300, 5e-324, math.inf, math.nan, ODD_NAN, 12.345]), st.floats()),
    "line": st.one_of(st.integers(-3, 3), st.sampled_from([2**63, -(2**63), 2**64 - 1])),
    "exec_state": st.sampled_from(["ACTIVE", "READY", "", "a\0b", "Ω ü"]),
    "coolant_on": st.booleans(),
    "wave": st.one_of(
        st.lists(st.floats(width=32), max_size=3).map(tuple),
        st.lists(st.integers(-200, 200), min_size=1, max_size=3).map(tuple),
        st.just((True, False)),
        st.just(("a", "b")),
        st.just(b"\x00\xff"),
        st.just((2**63, 1)),
    ),
    "mixed": st.sampled_from([1, 1.0, True, "1"]),
    "twin/gap": st.floats(-1, 1),
}
TIMES = st.one_of(
    st.integers(0, 3), st.sampled_from([HOUR_MS - 1, HOUR_MS, HOUR_MS + 1, 2 * HOUR_MS]), st.integers(0, 3 * HOUR_MS)
)
MARK = st.sampled_from([(GOOD, None), (GOOD, None), (GOOD, None), (Quality.BAD, "outside"), (STALE, "edge node offline")])


@st.composite
def readings(draw: st.DrawFn) -> Reading:
    name = draw(st.sampled_from(sorted(VALUES)))
    value = draw(st.one_of(VALUES[name], VALUES[name], st.none()))
    quality, reason = draw(MARK)
    unit = "mm" if name == "x_mm" else None
    return Reading(name, value, T0_MS + draw(TIMES), quality, unit, reason, draw(st.booleans()))


@st.composite
def messages(draw: st.DrawFn) -> Message:
    kind = draw(st.sampled_from([EventKind.DATA] * 4 + [EventKind.BIRTH, EventKind.DEATH, EventKind.HOLE]))
    node = draw(st.sampled_from([EDGE, EDGE, TWIN]))
    if kind is EventKind.HOLE:
        hole = told([], draw(TIMES), kind=kind, node=node)
        return Message(hole.received_ms, hole.event._replace(device=None, detail="3 messages are lost"))
    said = draw(st.lists(readings(), max_size=6))
    return told(said, draw(TIMES), kind=kind, node=node, lag_ms=draw(st.integers(0, 2)))


STEPS = st.lists(st.one_of(st.lists(messages(), min_size=1, max_size=8), st.sampled_from(["seal", "reopen"])), max_size=8)


@contextmanager
def folder() -> Iterator[Path]:
    place = Path(tempfile.mkdtemp())
    try:
        yield place
    finally:
        shutil.rmtree(place)


@settings(max_examples=150 if IS_FULL else 8, deadline=None, suppress_health_check=list(HealthCheck))
@given(steps=STEPS)
def test_each_sample_is_there_once_and_each_message_in_order(steps: list[Any]) -> None:
    law = Law()
    now_ms = T0_MS + 100 * HOUR_MS
    with folder() as place:
        store = EmbeddedStore(place, writable=True)
        for step in [*steps, "reopen"]:
            if step == "reopen":
                store.close()
                store = EmbeddedStore(place, writable=True)
            elif step == "seal":
                now_ms += HOUR_MS
                store.tidy(now_ms)
            else:
                before = len(law.messages)
                done = store.append(step)
                law.append(step)
                of_devices = [m for m in step if m.event.device is not None]
                assert sum(done) == sum(len(m.event.readings) for m in of_devices) and done.refused == 0
                assert len(law.messages) - before <= len(step)
            holds(store, law)
        store.close()


def holds(store: EmbeddedStore, law: Law) -> None:
    names = tuple(VALUES)
    for column in store.query(Query("vmc", names, T0_MS - 1, T0_MS + 100 * HOUR_MS)):
        found = list(zip(column.t_us, column.value, column.quality, column.reason, strict=True))
        assert repr(sorted(found, key=repr)) == repr(sorted(law.column(column.signal), key=repr)), column.signal
        assert column.t_us == sorted(column.t_us)
    heard = {m.event.node for m in law.messages if m.event.device is not None and m.event.readings}
    wanted = [m for m in law.messages if m.event.device is not None or m.event.node in heard]
    assert bits(store.messages("vmc", 0, T0_MS + 10**9)) == bits(wanted)


def bits(every: Any) -> list[str]:
    """Messages so that two differ where a bit of a value does."""
    return [f"{m.received_ms} {m.event._replace(readings=())} {[(r, packed(r.value)) for r in m.event.readings]}" for m in every]


def packed(value: Any) -> Any:
    if isinstance(value, float):
        return struct.pack("<d", value)
    return tuple(map(packed, value)) if isinstance(value, tuple) else value
