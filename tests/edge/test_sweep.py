"""Frames of sweeps: each is taken once, and what is missing between them is a hole."""

from dataclasses import replace

from hypothesis import given
from hypothesis import strategies as st

from edge.errors import DocumentError
from edge.sample import ClockReading, Gap
from edge.sweep import Fact, Hole, Sweep, SweepPosition, take

SWEEP = Sweep("life", 0, 1_000, (Fact("acts", 3500.5), Fact("prog", "O1", "", 990)), interval_ms=100)
_PLAIN = st.none() | st.booleans() | st.integers() | st.floats(allow_nan=False) | st.text()
_MS = st.integers(0, 2**60)
_FACTS = st.builds(Fact, st.text(), _PLAIN, st.text(), st.none() | _MS)


@given(
    st.builds(
        Sweep,
        life=st.text(),
        number=_MS,
        t_ms=_MS,
        facts=st.lists(_FACTS, max_size=5).map(tuple),
        holes=st.lists(st.builds(Hole, st.text(), _MS, _MS, _MS), max_size=3).map(tuple),
        interval_ms=_MS,
        clock=st.none() | st.builds(ClockReading, _MS, _MS, _MS, _MS, st.booleans()),
        available=st.none() | st.booleans(),
        error=st.none() | st.text(),
    )
)
def test_a_frame_reads_back_as_it_was(sweep: Sweep) -> None:
    assert Sweep.decode(sweep.encode()) == sweep


@given(st.binary(max_size=200) | st.recursive(st.integers() | st.text(), st.lists).map(lambda x: str(x).encode()))
def test_bytes_that_are_no_frame_are_refused_in_one_line(raw: bytes) -> None:
    try:
        Sweep.decode(raw)
    except DocumentError as error:
        assert "\n" not in str(error)[:200].splitlines()[0]


def test_a_frame_that_comes_twice_is_taken_once() -> None:
    position, sweep, about, is_baseline = take(SweepPosition(), SWEEP.encode())
    assert (sweep, about.received, is_baseline) == (SWEEP, 2, True)
    again = take(position, SWEEP.encode())
    assert (again.sweep, dict(again.about.dropped), again.about.accounted()) == (None, {"duplicate": 2}, True)


def test_numbers_that_are_left_out_are_a_hole_and_so_is_the_time_before_a_new_life() -> None:
    position = take(SweepPosition(), SWEEP.encode()).position
    later = take(position, replace(SWEEP, number=3, t_ms=1_300).encode())
    assert later.about.gaps == (Gap("frames missing", 1_000, 1_300, 4),)
    place = position.place()
    assert place is not None
    restarted = take(SweepPosition.resumed(place), replace(SWEEP, life="other", t_ms=6_000).encode())
    assert restarted.about.gaps == (Gap("edge restarted", 1_000, 6_000, 100),)
    assert restarted.is_baseline


def test_a_hole_that_the_connection_states_is_passed_on() -> None:
    stated = replace(SWEEP, holes=(Hole("the control did not answer", 100, 900, 16),))
    assert take(SweepPosition(), stated.encode()).about.gaps == (Gap("the control did not answer", 100, 900, 16),)
