"""An hour of production with tool changes, over a real connection, while the server of the control is killed, hung, restarted,
slow, wrong and partial. In the suite eight minutes of it; the whole hour with CNCTWIN_FULL=1, and in `benchmarks/edges/focas.py`.
"""

import pytest

from cnctwin.standins.simulated_control.state import tool_changes
from tests.depth import IS_FULL
from tests.edge.controls.focas import hour_judged as judged
from tests.edge.controls.focas.machine_hour import CLOCK_OFFSET_S, Hour, run

SECONDS = 3600.0 if IS_FULL else 480.0


@pytest.fixture(scope="module")
def hour() -> Hour:
    return run(SECONDS, seed=1, pause_s=25.0 if IS_FULL else 18.0)


def test_every_kind_of_fault_came_and_was_survived(hour: Hour) -> None:
    assert {"killed", "hung", "slow", "wrong", "dropped", "refusing", "partial"} <= set(hour.kinds())
    assert hour.reconnects >= 5
    assert len(hour.sweep_s) > 0.5 * SECONDS / judged.INTERVAL_S
    assert hour.sweep_s[-1] > SECONDS - 1.0


def test_each_observation_is_emitted_dropped_with_a_reason_or_held(hour: Hour) -> None:
    assert hour.unaccounted == 0
    assert hour.differences == {0}, "after each frame"
    assert hour.ledger["ledger/received"] > 20 * len(hour.sweep_s)
    assert hour.server_balances


def test_each_look_that_was_not_made_lies_in_a_stated_hole_and_each_hole_is_one(hour: Hour) -> None:
    assert judged.looks_outside_of_holes(hour) == []
    assert judged.holes_that_are_none(hour) == []
    assert len(hour.gaps) >= 5


def test_each_value_published_was_shown_by_the_control_in_that_look(hour: Hour) -> None:
    assert judged.values_that_were_not_shown(hour) == []
    assert {sample.signal for sample in hour.samples} >= judged.SHOWN.keys()


def test_each_tool_change_outside_of_holes_is_told_to_within_a_look(hour: Hour) -> None:
    true, seen = tool_changes(hour.states), judged.changes_seen(hour)
    assert len(true) >= SECONDS / 25
    assert len(seen) > 0.5 * len(true)
    assert judged.changes_told_wrongly(hour) == []


def test_no_tool_change_is_made_up(hour: Hour) -> None:
    assert judged.changes_made_up(hour) == []


def test_the_tool_number_is_that_of_the_tool_in_the_spindle_or_is_not_told(hour: Hour) -> None:
    assert judged.tools_not_told(hour) == []
    assert list(judged.tool_numbers_that_are_not_in_the_spindle(hour)) == []


def test_where_the_builder_shows_the_tool_its_number_is_known_wherever_the_control_answers() -> None:
    part = run(120.0, seed=10, tool_number_pmc="D100", tool_change_pmc="R100.0")
    assert part.reconnects
    assert judged.changes_told_wrongly(part) == judged.changes_made_up(part) == judged.tools_not_told(part) == []
    assert list(judged.tool_numbers_that_are_not_in_the_spindle(part)) == []
    nulls = {sample.reason for sample in part.samples if sample.signal == "tool_number" and sample.value is None}
    assert nulls <= {"0: no tool in the spindle", "unavailable: EW_RESET (-2): a reset or stop came in between"}


def test_the_controls_clock_is_read_beside_the_edges_and_stamps_nothing(hour: Hour) -> None:
    assert len(hour.clock_offsets_s) > SECONDS / 20
    for offset_s in hour.clock_offsets_s:
        assert CLOCK_OFFSET_S - 2.1 <= offset_s <= CLOCK_OFFSET_S + 1.1, "whole seconds, and half the slowest round trip"


def test_nothing_was_written_to_the_control(hour: Hour) -> None:
    assert hour.server.get("refused/write", 0) == 0
