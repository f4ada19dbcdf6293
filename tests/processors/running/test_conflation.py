"""Two messages as one: values may be left out, states may not."""

from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from processors.running.conflation import conflated
from sparkplug.host_session import HostEvent
from sparkplug.quality import Quality
from tests.processors.streams import birth, data, death, event, reading, unnamed


def values(one: HostEvent | None) -> dict[str, Any]:
    assert one is not None
    return {reading.name: reading.value for reading in one.readings}


def test_the_newest_value_of_each_signal_wins() -> None:
    both = conflated(data(1.0, spindle_rpm=1.0, feed=2.0), data(2.0, spindle_rpm=3.0, spindle_load_pct=4.0))
    assert values(both) == {"spindle_rpm": 3.0, "feed": 2.0, "spindle_load_pct": 4.0}
    assert both is not None
    assert both.timestamp_ms == both.newest_ms == data(2.0).timestamp_ms
    assert both.oldest_ms == data(1.0).timestamp_ms
    assert both.names == ("spindle_rpm", "feed", "spindle_load_pct")


def test_a_value_that_is_older_than_what_waits_is_not_the_newest() -> None:
    both = conflated(data(2.0, spindle_rpm=1.0), data(1.0, spindle_rpm=3.0))
    assert values(both) == {"spindle_rpm": 1.0}


@pytest.mark.parametrize(
    ("before", "after"),
    [
        ({"exec_state": "ACTIVE"}, {"exec_state": "STOPPED"}),
        ({"twin/anomaly_alarm": True}, {"twin/anomaly_alarm": False}),
        ({"alarm": "E1"}, {"alarm": None}),
        ({"tool_number": 3}, {"tool_number": 4}),
        ({"spindle_rpm": 1.0, "program": "A"}, {"program": "B", "spindle_rpm": 2.0}),
    ],
)
def test_no_change_of_a_state_is_lost(before: dict[str, Any], after: dict[str, Any]) -> None:
    assert conflated(data(1.0, **before), data(2.0, **after)) is None
    assert values(conflated(data(1.0, **before), data(2.0, **before))) == before


def test_a_state_whose_quality_changes_is_kept_too() -> None:
    before = data(1.0, exec_state="ACTIVE")
    after = before._replace(readings=(before.readings[0]._replace(quality=Quality.STALE),))
    assert conflated(before, after) is None


@pytest.mark.parametrize(
    ("old", "new"),
    [
        (birth(0.0, a=1.0), data(1.0, a=2.0)),
        (data(0.0, a=1.0), death(1.0)),
        (data(0.0, a=1.0), birth(1.0, a=1.0)),
        (data(0.0, history=True, a=1.0), data(1.0, a=2.0)),
        (data(0.0, a=1.0), data(1.0, history=True, a=2.0)),
        (unnamed(data(0.0, a=1.0)), data(1.0, a=2.0)),
        (event(data(0.0).kind, 0.0, reading("a", 1.0), reading("a", 2.0)), data(1.0, b=2.0)),
    ],
)
def test_births_deaths_history_and_doubles_are_let_be(old: HostEvent, new: HostEvent) -> None:
    assert conflated(old, new) is None


def test_the_same_two_layouts_have_the_same_names() -> None:
    one = conflated(data(0.0, a=1.0), data(1.0, b=1.0))
    two = conflated(data(2.0, a=1.0), data(3.0, b=1.0))
    assert one is not None
    assert two is not None
    assert one.names is two.names


@given(st.lists(st.tuples(st.sampled_from("abc"), st.floats(allow_nan=False)), min_size=1, max_size=30))
def test_however_many_are_put_together_the_last_row_is_the_same(changes: list[tuple[str, float]]) -> None:
    row: dict[str, float] = {}
    both: HostEvent | None = None
    for second, (name, value) in enumerate(changes):
        row[name] = value
        new = data(float(second), **{name: value})
        both = new if both is None else conflated(both, new)
        assert values(both) == row
