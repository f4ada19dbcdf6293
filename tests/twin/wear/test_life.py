"""Lives: a course keeps its levels whatever its length, and what lives say is their middle."""

import pytest
from hypothesis import given
from hypothesis import strategies as st

from twin.wear.life import BINS_MAX, Course, Life, ended, followed, known


def course_of(uses: int, end: float) -> Course:
    course = Course()
    for use in range(uses):
        course = followed(course, use, end * use / uses)
    return course


@given(st.integers(10, 2000), st.floats(0.1, 0.6))
def test_an_even_life_is_remembered_as_it_was(uses: int, end: float) -> None:
    course = course_of(uses, end)
    assert len(course.sums) <= BINS_MAX
    life = ended(course)
    assert life is not None
    assert life.uses == uses
    assert life.end == pytest.approx(end, rel=0.15)
    assert life.levels[4] == pytest.approx(end / 2.0, abs=0.1 * end)


@pytest.mark.parametrize("course", [Course(), course_of(4, 0.3), course_of(50, -0.3)], ids=["empty", "short", "falling"])
def test_what_did_not_wear_is_no_life(course: Course) -> None:
    assert ended(course) is None


def test_two_lives_say_what_the_next_is_like_and_one_does_not() -> None:
    levels = tuple(0.3 * knot / 8 for knot in range(9))
    one, other = Life(100, 0.3, levels), Life(120, 0.3, levels)
    assert known([one], None) is None
    found = known([one, other], None)
    assert found is not None
    assert 100 < found.uses < 120
    assert found.end == pytest.approx(0.3)


def test_a_configured_limit_holds_until_lives_have_told_it() -> None:
    levels = tuple(0.3 * knot / 8 for knot in range(9))
    first = known([], 0.2)
    assert first is not None and first.end == 0.2
    later = known([Life(100, 0.3, levels)] * 2, 0.2)
    assert later is not None and later.end == pytest.approx(0.3)


def test_one_life_of_two_that_was_not_split_counts_as_far_and_no_further() -> None:
    levels = tuple(0.3 * knot / 8 for knot in range(9))
    merged = known([Life(100, 0.3, levels)] * 4 + [Life(2000, 0.3, levels)], None)
    assert merged is not None
    assert merged.uses == pytest.approx(100)
    assert merged.uses_spread < 0.5
