"""Stretches of a history: none overlap, none goes over a hole, a rest of the spindle divides, and fit comes before check."""

from itertools import pairwise

import pytest
from hypothesis import given
from hypothesis import strategies as st

from cnctwin.composing.executions import Execution
from cnctwin.composing.history import RPM, TEMPERATURE, Course, History
from cnctwin.composing.roles import cut_at, divided
from cnctwin.composing.stretches import LEAD_S, REST_S, SILENCE_S, STRETCH_S_MAX, Stretch, stretches_of

HOUR_MS, DAY_MS = 3_600_000, 86_400_000
WINDOW_MS = 10_000
TURNS, STANDS, SILENT, UNKNOWN = "turns", "stands", "silent", "unknown"
phases = st.lists(
    st.tuples(st.sampled_from([TURNS, STANDS, SILENT, UNKNOWN]), st.integers(min_value=1, max_value=3 * 360)),
    min_size=1,
    max_size=12,
)


def history_of(*parts: tuple[str, int]) -> History:
    """Return a history of phases, each so many windows long."""
    told: list[int] = []
    changes: list[tuple[int, float | None]] = []
    t = 0
    for phase, windows in parts:
        if phase != SILENT:
            told += [t + n * WINDOW_MS for n in range(windows)]
            changes.append((t, {TURNS: 3000.0, STANDS: 0.0, UNKNOWN: None}[phase]))
        t += windows * WINDOW_MS
    rpm = Course(tuple(at for at, _ in changes), tuple(v for _, v in changes))
    return History("vmc", 0, t, WINDOW_MS, {RPM: rpm, TEMPERATURE: Course((0,), (25.0,))}, tuple(told) or (0,))


def windows(seconds: float) -> int:
    return round(1000 * seconds / WINDOW_MS)


@given(phases)
def test_stretches_are_in_order_and_none_overlap_or_are_too_long(parts: list[tuple[str, int]]) -> None:
    history = history_of(*parts)
    found = stretches_of(history)
    assert all(a.to_ms <= b.from_ms for a, b in pairwise(found))
    assert all(history.from_ms <= s.from_ms < s.to_ms <= history.to_ms and s.seconds <= STRETCH_S_MAX + 1.0 for s in found)


@given(phases)
def test_no_stretch_goes_over_a_hole(parts: list[tuple[str, int]]) -> None:
    history = history_of(*parts)
    for before, after in pairwise(history.told_ms):
        if after - before > 1000 * SILENCE_S:
            assert not any(s.from_ms <= before and after < s.to_ms for s in stretches_of(history))


@given(phases)
def test_what_is_fitted_ends_before_what_is_judged_on_begins(parts: list[tuple[str, int]]) -> None:
    stretches = stretches_of(history_of(*parts))
    division = divided(stretches, ())
    pieces = cut_at(stretches, division.at_ms)
    fitted = [s for s in pieces if division.is_fitted(s.span_ms)]
    judged = [s for s in pieces if division.is_fitted(s.span_ms) is False]
    assert len(fitted) + len(judged) == len(pieces)
    assert sum(s.seconds for s in pieces) == pytest.approx(sum(s.seconds for s in stretches))
    if judged:
        assert fitted and max(s.to_ms for s in fitted) <= min(s.from_ms for s in judged)


def test_a_long_rest_divides_and_the_next_stretch_begins_shortly_before_the_spindle_turns() -> None:
    found = stretches_of(history_of((TURNS, 360), (STANDS, windows(REST_S) + 60), (TURNS, 360)))
    assert [s.what for s in found] == ["production", "warm-up"]
    assert found[1].from_ms == 1000 * (3600 + REST_S + 600 - LEAD_S) and found[0].to_ms == found[1].from_ms


def test_a_short_rest_divides_nothing() -> None:
    assert len(stretches_of(history_of((TURNS, 360), (STANDS, windows(REST_S) - 1), (TURNS, 360)))) == 1


def test_a_spindle_that_only_stands_cools_down() -> None:
    assert [s.what for s in stretches_of(history_of((STANDS, 1000)))] == ["cool-down"]


def test_a_spindle_that_stood_through_a_hole_begins_with_a_warm_up() -> None:
    found = stretches_of(history_of((TURNS, 100), (STANDS, 30), (SILENT, 1000), (STANDS, 20), (TURNS, 100)))
    assert [s.what for s in found] == ["production", "warm-up"]


def test_jogging_is_rest() -> None:
    history = history_of((TURNS, 100), (STANDS, 100), (STANDS, 100), (TURNS, 100))
    jogged = Course((0, 1_000_000, 2_000_000, 2_010_000, 3_000_000), (3000.0, 0.0, 40.0, 0.0, 3000.0))
    found = stretches_of(History("vmc", 0, history.to_ms, WINDOW_MS, {RPM: jogged}, history.told_ms))
    assert [s.what for s in found] == ["production", "warm-up"]


def test_days_divide_where_there_are_days() -> None:
    stretches = [Stretch(n * DAY_MS, n * DAY_MS + 8 * HOUR_MS, True, 0.5) for n in range(3)]
    division = divided(stretches, ())
    assert division.at_ms == 2 * DAY_MS and "between two days" in division.note


def test_a_single_stretch_is_divided_at_the_end_of_a_program() -> None:
    stretch = Stretch(0, HOUR_MS, False, 0.5)
    runs = [Execution(n * 500_000, n * 500_000 + 480_000, "O1", True, False, False) for n in range(7)]
    assert divided([stretch], runs).at_ms == 2_480_000
    assert divided([stretch], ()).at_ms == 2_400_000


def test_a_spindle_that_stands_at_the_end_is_divided_by_the_time_that_it_turned() -> None:
    stretch = Stretch(0, HOUR_MS, False, 0.3)
    assert divided([stretch], (), [(0, 600_000), (900_000, 1_200_000)]).at_ms == 600_000
    assert divided([stretch], (), [(0, 600_000), (2_700_000, 3_000_000)]).at_ms == 2_400_000, "the judge turns"


def test_programs_alone_are_divided_between_two_of_them() -> None:
    runs = [Execution(n * 500_000, n * 500_000 + 480_000, "O1", True, False, False) for n in range(3)]
    division = divided([], runs)
    assert [division.is_fitted(e.span_ms) for e in runs] == [True, True, False]
