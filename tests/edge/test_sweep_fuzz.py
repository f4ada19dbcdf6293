"""Frames of sweeps that are torn, foreign or ill meant: a whole frame or DocumentError, and never a value from a torn one."""

import json
from contextlib import suppress
from random import Random

import pytest
from hypothesis import given
from hypothesis import strategies as st

from edge.errors import DocumentError
from edge.sample import ClockReading
from edge.sweep import FACTS_MAX, FRAME_BYTES_MAX, Fact, Hole, Sweep, SweepPosition, take
from tests.fuzz_depth import FUZZ, within

PLAIN = st.one_of(st.none(), st.booleans(), st.integers(-(2**62), 2**62), st.floats(allow_nan=False), st.text(max_size=20))
FACTS = st.lists(st.builds(Fact, st.text(max_size=8), PLAIN, st.text(max_size=8), st.none() | st.integers(0, 2**61)), max_size=5)
TIMES = st.integers(0, 2**61)
CLOCKS = st.builds(ClockReading, TIMES, TIMES, TIMES, TIMES, stamps_samples=st.booleans())
SWEEPS = st.builds(
    Sweep,
    st.text(max_size=5),
    st.integers(0, 100),
    TIMES,
    FACTS.map(tuple),
    st.lists(st.builds(Hole, st.text(max_size=5), TIMES, TIMES, TIMES), max_size=2).map(tuple),
    st.integers(0, 10_000),
    st.none() | CLOCKS,
    st.sampled_from([None, True, False]),
    st.none() | st.text(max_size=5),
)
JSON = st.recursive(
    PLAIN, lambda inner: st.lists(inner, max_size=4) | st.dictionaries(st.text(max_size=8), inner, max_size=4), max_leaves=20
)


@FUZZ
@given(SWEEPS)
def test_a_whole_frame_comes_back_the_same(sweep: Sweep) -> None:
    assert Sweep.decode(sweep.encode()) == sweep


@FUZZ
@given(SWEEPS, st.integers(0, 2**32))
def test_a_torn_frame_is_none(sweep: Sweep, seed: int) -> None:
    raw = sweep.encode()
    with pytest.raises(DocumentError):
        Sweep.decode(raw[: Random(seed).randrange(len(raw))])


@FUZZ
@given(SWEEPS, JSON, st.sampled_from(["life", "number", "t_ms", "facts", "holes", "interval_ms", "clock", "available", "error"]))
def test_a_frame_with_something_else_in_a_field_is_read_or_refused(sweep: Sweep, wrong: object, field: str) -> None:
    document = json.loads(sweep.encode())
    document[field] = wrong
    with suppress(DocumentError):
        read = Sweep.decode(json.dumps(document).encode())
        assert read.encode(), "what is read can be written"


@FUZZ
@given(st.binary(max_size=200))
def test_any_bytes_are_refused_and_change_nothing(raw: bytes) -> None:
    position = SweepPosition("life", 7, 1000)
    taken = take(position, raw)
    assert (taken.position, taken.sweep) == (position, None)
    assert taken.about.error


@pytest.mark.parametrize(
    "raw",
    [
        b"[" * 1_000_000,
        b'{"facts":' * 400_000,
        b'{"number":' + b"9" * 1_000_000 + b"}",
        b'{"life":"' + b"x" * (FRAME_BYTES_MAX + 1),
        Sweep("a", 0, 1, tuple(Fact("k") for _ in range(FACTS_MAX + 1))).encode(),
        b'{"life":"\\ud800","number":0,"t_ms":0,"facts":[],"holes":[],"interval_ms":0,"clock":null,"available":null,"error":7}',
    ],
    ids=["lists in lists", "objects in objects", "digits", "too long", "too many facts", "half a character"],
)
def test_what_is_too_deep_too_long_or_too_much_is_refused(raw: bytes) -> None:
    with within(5.0, 64.0), pytest.raises(DocumentError):
        Sweep.decode(raw)


def test_half_a_character_from_a_control_does_not_stop_its_edge() -> None:
    assert Sweep.decode(Sweep("a", 0, 1, (Fact("program", "O10\ud800"),)).encode()).facts[0].value == "O10?"
