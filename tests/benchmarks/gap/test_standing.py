"""A slice of the trials of the standing gap: a healthy machine is left in peace, and an effect is reported as what it is."""

import pytest

from benchmarks.gap.standing import Folded, before_effect, growths, healthy_quarter, noticed

SEED = 7


@pytest.fixture(scope="module")
def before() -> tuple[Folded, float | None]:
    """The machine after its first two weeks; each trial goes on from there."""
    return before_effect(SEED)


def test_two_healthy_weeks_after_the_first_two_are_silent_though_growth_was_judged(before: tuple[Folded, float | None]) -> None:
    """The trial itself refuses a machine of which next to nothing was judged."""
    assert healthy_quarter(SEED, weeks=2.0, before=before) == []


def test_a_longer_tool_change_is_noticed_as_such(before: tuple[Folded, float | None]) -> None:
    assert growths(before[0]) == []
    change = noticed("tool_change_time", "", SEED, 4.0, before)
    assert change.why.startswith("tool_change_s in ")
    assert change.hours is not None
    assert change.hours < 24.0
