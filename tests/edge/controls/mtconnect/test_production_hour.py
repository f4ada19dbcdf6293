"""An hour of production with tool changes, read from a real agent over real HTTP, while the agent is killed, started again, hung,
slow and wrong. In the suite ten minutes; the whole hour, streaming and polled, with CNCTWIN_FULL=1.
"""

from collections.abc import Iterator

import pytest

from tests.depth import IS_FULL
from tests.edge.controls.mtconnect import agent_hour_judged as judged
from tests.edge.controls.mtconnect.agent_hour import Hour, run

SECONDS = 3600.0 if IS_FULL else 600.0
RUNS = [(1, False), (2, True), (3, False)] if IS_FULL else [(3, False)]
KINDS = {"killed", "restarted", "hung", "slow", "wrong", "partial", "changed", "overrun", "adapter lost"}


@pytest.fixture(scope="module", params=RUNS, ids=lambda given: f"seed {given[0]}, {'polled' if given[1] else 'streamed'}")
def hour(request: pytest.FixtureRequest) -> Iterator[Hour]:
    seed, is_polled = request.param
    yield run(SECONDS, seed, pause_s=25.0 if IS_FULL else 18.0, is_polled=is_polled)


def test_every_kind_of_fault_came_and_was_survived(hour: Hour) -> None:
    assert set(hour.kinds()) == KINDS
    assert hour.reconnects >= 5
    assert len(hour.taken) > 10 * SECONDS


def test_each_observation_is_emitted_dropped_with_a_reason_or_held(hour: Hour) -> None:
    assert hour.unaccounted == 0
    assert hour.differences == {0}, "after each document"
    assert hour.ledger["ledger/emitted"] > 10 * SECONDS


def test_each_observation_of_the_agent_is_taken_once_or_lies_in_a_stated_hole(hour: Hour) -> None:
    assert list(judged.observations_neither_taken_nor_in_a_hole(hour)) == []
    assert list(judged.observations_taken_twice(hour)) == []
    assert judged.holes_that_state_too_little(hour) == []
    assert len(hour.holes) >= 2


def test_each_value_is_what_the_machine_told_at_that_time(hour: Hour) -> None:
    assert list(judged.values_that_were_not_told(hour)) == []
    assert judged.values_published_that_were_not_taken(hour) == []
    assert {sample.signal for _, sample in hour.taken} == judged.KEYS.keys()


def test_each_tool_change_outside_of_holes_is_told_with_the_stamps_of_the_machine(hour: Hour) -> None:
    assert len(judged.changes_seen(hour)) > 0.4 * len(judged.true_changes(hour))
    assert judged.changes_told_wrongly(hour) == []
    assert judged.tools_told_wrongly(hour) == []


def test_no_tool_change_is_made_up(hour: Hour) -> None:
    assert judged.changes_made_up(hour) == []
