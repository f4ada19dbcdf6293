"""Tool changes and sections of a program, timed as they end; whatever was held, overridden or not seen whole is left out."""

from typing import Any

import pytest

from processors.gap.processor import PROCESSOR
from processors.gap.signals import GAP
from processors.gap.timing import Timed
from processors.running.engine import Engine
from sparkplug.host_session import HostEvent
from tests.processors.streams import birth, data, engine_of, fed, hole

CHANGE, SECTION = f"{GAP}tool_change_s", f"{GAP}program_time_s"
IDLE = {
    "exec_state": "READY",
    "program": "O1",
    "tool_change_active": False,
    "spindle_rpm": 0.0,
    "feed_override_pct": 100.0,
    "tool_number": 1,
}


def ended(*events: HostEvent) -> list[Timed]:
    """Return the lengths that were timed, without any tick in between."""
    engine = engine_of(PROCESSOR, tick_s=600.0, gap_s_max=3600.0)
    fed(engine, birth(1.0, **IDLE), *events)
    return list(state_of(engine).timing.done)


def state_of(engine: Engine) -> Any:
    return engine._machines["okuma"].live.state


CYCLE = (
    data(10.0, exec_state="ACTIVE"),
    data(30.0, tool_change_active=True),
    data(33.5, tool_change_active=False),
    data(63.5, exec_state="PROGRAM_COMPLETED"),
)
WHOLE = [
    Timed("program_time_s", "section 0 of O1", 20.0, 20.0, program="O1", section=0),
    Timed("tool_change_s", "spindle_stopped", 3.5, 30.0, True),
    Timed("program_time_s", "section 1 of O1", 30.0, 30.0, program="O1", section=1),
]


def test_a_cycle_has_its_sections_and_its_tool_changes() -> None:
    assert ended(*CYCLE) == WHOLE


def test_a_message_that_is_late_takes_nothing_longer() -> None:
    on_its_way = data(45.0, spindle_rpm=0.0)
    assert ended(*CYCLE[:2], on_its_way, *CYCLE[2:]) == WHOLE


def test_a_cycle_that_starts_with_a_tool_change_has_no_section_before_it() -> None:
    start = data(10.0, exec_state="ACTIVE", tool_change_active=True)
    assert [one.regime for one in ended(start, *CYCLE[2:])] == ["spindle_stopped", "section 1 of O1"]


def test_a_spindle_that_still_turns_makes_it_another_change() -> None:
    assert ended(data(5.0, spindle_rpm=900.0), *CYCLE)[1].regime == "spindle_turning"


@pytest.mark.parametrize(
    ("between", "left"),
    [
        ((data(20.0, exec_state="FEED_HOLD"), data(22.0, exec_state="ACTIVE")), ["spindle_stopped"]),
        ((data(20.0, feed_override_pct=80.0),), ["spindle_stopped"]),
        ((data(20.0, program="O2"),), ["spindle_stopped"]),
        ((hole(20.0),), ["spindle_stopped"]),
    ],
    ids=["held", "overridden", "another program", "a hole"],
)
def test_what_was_not_seen_whole_is_no_section(between: tuple[HostEvent, ...], left: list[str]) -> None:
    found = ended(CYCLE[0], *between, *CYCLE[1:])
    assert [one.regime for one in found if one.signal == "tool_change_s"] == left
    assert "section 0 of O1" not in [one.regime for one in found]


def test_an_override_that_is_back_leaves_the_next_section_whole() -> None:
    found = ended(CYCLE[0], data(20.0, feed_override_pct=80.0), data(25.0, feed_override_pct=100.0), *CYCLE[1:])
    assert [one.regime for one in found] == ["spindle_stopped", "section 1 of O1"]


def test_a_program_that_ran_already_when_it_was_first_seen_is_not_timed() -> None:
    engine = engine_of(PROCESSOR, tick_s=600.0, gap_s_max=3600.0)
    fed(engine, birth(1.0, **IDLE | {"exec_state": "ACTIVE"}), *CYCLE[1:])
    assert [one.signal for one in state_of(engine).timing.done] == ["tool_change_s"]


def test_times_are_compared_at_the_next_tick_and_count_once() -> None:
    engine = engine_of(PROCESSOR)
    fed(engine, birth(1.0, **IDLE), *CYCLE, data(70.0, spindle_rpm=0.0), data(140.0, spindle_rpm=0.0))
    cells = state_of(engine).cells
    assert state_of(engine).timing.done == ()
    assert cells["tool_change_s/spindle_stopped"].standing.mean == pytest.approx(-3.5)
    assert cells["tool_change_s/spindle_stopped"].standing.seconds == 30.0
    assert cells["program_time_s/section 1 of O1"].standing.mean == pytest.approx(-30.0)


def test_without_a_program_or_a_tool_change_signal_the_reason_is_said() -> None:
    engine = engine_of(PROCESSOR)
    fed(engine, birth(1.0, spindle_rpm=0.0), data(70.0, spindle_rpm=0.0))
    last = engine._machines["okuma"].live.emission.latest
    assert last[SECTION].reason == "exec_state is not offered"
    assert last[CHANGE].reason == "tool_change_active is not offered"
