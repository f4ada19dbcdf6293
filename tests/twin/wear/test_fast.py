"""A tool wears fast beside the spread of its own earlier lives: never before three of them, never while it is run in."""

import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.special import stdtrit

from twin.wear.curve import LINE
from twin.wear.fast import FAST_LIVES, WORN, is_faster, t_limit, uses_to
from twin.wear.life import Life
from twin.wear.machine import Wear
from twin.wear.status import status_of
from twin.wear.terms import Terms
from twin.wear.tool import new_tool

END = 0.3
ALIKE = (95, 100, 105, 100, 98, 102, 100, 100)
UNLIKE = (40, 150, 60, 200, 80, 120, 50, 170)


def lives(*uses: int) -> list[Life]:
    return [Life(one, END, tuple(END * share for share in LINE)) for one in uses]


def soonest(earlier: list[Life], wear: float = 0.7 * END, error: float = 0.0) -> int:
    """Return the parts up to which a tool so worn is told to wear fast; 0 = never."""
    return max((uses for uses in range(1, 200) if is_faster(earlier, END, wear, uses, error, 2.0)), default=0)


@pytest.mark.parametrize("count", range(FAST_LIVES))
def test_nothing_is_said_before_three_lives(count: int) -> None:
    assert soonest(lives(*ALIKE[:count])) == 0


def test_three_lives_are_enough_for_a_tool_that_wears_many_times_as_fast() -> None:
    assert 7 < soonest(lives(*ALIKE[:FAST_LIVES])) < 35


def test_the_more_lives_are_known_the_sooner_a_tool_is_fast() -> None:
    limits = [soonest(lives(*ALIKE[:count])) for count in (3, 5, 8)]
    assert limits == sorted(set(limits))


def test_lives_that_differ_and_wear_that_is_uncertain_ask_for_more() -> None:
    assert soonest(lives(*UNLIKE)) < soonest(lives(*ALIKE))
    assert soonest(lives(*ALIKE), error=0.2) < soonest(lives(*ALIKE))


def test_less_than_so_many_times_as_fast_is_no_alarm_however_alike_lives_were() -> None:
    assert not is_faster(lives(*ALIKE), END, 0.7 * END, 20, 0.0, 4.0)
    assert is_faster(lives(*ALIKE), END, 0.7 * END, 15, 0.0, 4.0)


@given(st.floats(0.0, WORN - 0.01), st.integers(1, 100))
def test_a_tool_that_is_run_in_is_never_fast(share: float, uses: int) -> None:
    assert not is_faster(lives(*ALIKE), END, share * END, uses, 0.0, 2.0)


@given(st.floats(0.01, 0.6), st.floats(0.01, 0.3))
def test_more_wear_takes_more_parts(wear: float, more: float) -> None:
    (life,) = lives(100)
    assert uses_to(life, wear) < uses_to(life, wear + more)
    assert uses_to(life, END / 2.0) == pytest.approx(50.0)


@pytest.mark.parametrize("share", [0.6, 0.8, 1.0, 1.2])
def test_its_usual_pace_is_fast_at_no_wear_and_five_times_that_is(share: float) -> None:
    assert not is_faster(lives(*ALIKE), END, share * END, round(100 * share), 0.0, 2.0)
    assert is_faster(lives(*ALIKE), END, share * END, round(20 * share), 0.0, 2.0)


@pytest.mark.parametrize(
    ("count", "is_whole", "has_stepped", "reason"),
    [
        (2, True, False, "not known yet: 2 of 3 lives of tool 7"),
        (3, False, False, "not seen from its beginning"),
        (3, True, True, "stepped up in this life"),
        (3, True, False, ""),
    ],
)
def test_what_is_not_known_has_a_reason(count: int, is_whole: bool, has_stepped: bool, reason: str) -> None:
    known = tuple(lives(*ALIKE[:count]))
    tool = new_tool(Terms())._replace(lives=known, is_whole=is_whole, has_stepped=has_stepped, sharp_lives=2, uses=20)
    found = status_of("7", tool, Wear(), Terms())
    assert reason in found.why_not_fast
    assert found.is_fast is (None if reason else False)


def test_the_limit_is_that_of_students_t() -> None:
    for degrees in range(2, 40):
        assert t_limit(degrees, 1e-3) == pytest.approx(float(stdtrit(degrees, 0.999)), rel=1e-6)
