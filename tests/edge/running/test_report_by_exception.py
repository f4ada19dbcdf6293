"""What is worth a message."""

import pytest
from hypothesis import given
from hypothesis import strategies as st

from edge.running.report_by_exception import verdict
from edge.sample import Drop, EdgeSample
from sparkplug.quality import Quality


def decisions(*samples: EdgeSample, deadband: float = 0.0, interval_ms_max: int = 0) -> list[Drop | None]:
    last: EdgeSample | None = None
    found = list[Drop | None]()
    for sample in samples:
        drop = verdict(last, sample, deadband=deadband, interval_ms_max=interval_ms_max)
        last = sample if drop is None else last
        found.append(drop)
    return found


def load(value: float | None, at_ms: int = 0, quality: Quality = Quality.GOOD, reason: str | None = None) -> EdgeSample:
    return EdgeSample("spindle_load_pct", value, at_ms, quality, reason)


def test_the_first_value_and_each_other_one_is_published() -> None:
    assert decisions(load(1), load(2), load(2), load(1)) == [None, None, Drop.UNCHANGED, None]


def test_the_deadband_is_measured_from_what_was_published() -> None:
    assert decisions(load(10), load(11), load(12), load(12.5), load(14), deadband=2) == [
        None,
        Drop.DEADBAND,
        Drop.DEADBAND,
        None,
        Drop.DEADBAND,
    ]


def test_another_quality_or_reason_is_news() -> None:
    bad = load(None, quality=Quality.BAD, reason="unavailable")
    assert decisions(load(1), bad, bad, load(None, quality=Quality.BAD, reason="empty"), load(1), deadband=5) == [
        None,
        None,
        Drop.UNCHANGED,
        None,
        None,
    ]


def test_an_unchanged_value_is_sent_again_after_the_longest_interval() -> None:
    assert decisions(load(1), load(1, 900), load(1, 1000), load(1, 1900), interval_ms_max=1000) == [
        None,
        Drop.UNCHANGED,
        None,
        Drop.UNCHANGED,
    ]


@pytest.mark.parametrize(("one", "other"), [(True, 1), (0, False), (1, 1.0), ("1", 1)])
def test_values_of_another_type_are_other_values(one: str | float, other: str | float) -> None:
    assert decisions(EdgeSample("x", one, 0), EdgeSample("x", other, 0)) == [None, None]


@given(st.lists(st.floats(-1000, 1000), min_size=1), st.floats(0, 100))
def test_what_a_reader_holds_is_never_off_by_more_than_the_deadband(values: list[float], deadband: float) -> None:
    held: EdgeSample | None = None
    for value in values:
        sample = load(value)
        held = sample if verdict(held, sample, deadband=deadband) is None else held
        assert held is not None
        assert isinstance(held.value, float)
        assert abs(held.value - value) <= deadband
