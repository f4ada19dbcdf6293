"""Production with tool changes over a real connection to a real server that is killed, hung, slow, wrong and partial.

A slice here; the whole hour with CNCTWIN_FULL=1.
"""

import os
from bisect import bisect_left, bisect_right
from collections.abc import Iterator
from itertools import pairwise

import pytest

pytest.importorskip("asyncua")

from cnctwin.standins.simulated_control.state import ControlState
from edge.sample import EdgeSample
from tests.depth import IS_FULL
from tests.edge.controls.opcua.control_process import LOOK_S, SWITCHED_ON_S
from tests.edge.controls.opcua.hour import Hour

SECONDS = 3600.0 if IS_FULL else 160.0
SEED = int(os.environ.get("CNCTWIN_SEED", "4"))
TOLERANCE_S = 0.3  # a look of the server, and the block that commands a change just before the number goes
_EXEC = {"PROGRAM_COMPLETED": "READY", "FEED_HOLD": "STOPPED"}
_SHOWN = {
    "tool_number": lambda s: s.tool_number,
    "exec_state": lambda s: _EXEC.get(s.exec_state, s.exec_state),
    "nc_block": lambda s: s.block,
    "nc_line": lambda s: s.line,
    "spindle_rpm": lambda s: s.spindle_rpm,
    "axis_x_pos_mm": lambda s: s.axis_pos_mm[0],
    "feed_mm_min": lambda s: s.feed_mm_min,
}


@pytest.fixture(scope="module")
def hour(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Hour]:
    with Hour(tmp_path_factory.mktemp("hour"), seconds=SECONDS, seed=SEED) as run:
        run.drive()
        yield run


def shown_around(states: list[ControlState], times_s: list[float], at_s: float) -> list[ControlState]:
    """The states that the control can have shown at this time, to within a look."""
    first = max(0, bisect_right(times_s, at_s - 2 * LOOK_S) - 1)
    return states[first : bisect_right(times_s, at_s + 0.002)]


def machine_s(sample: EdgeSample) -> float:
    return sample.timestamp_ms / 1000 - SWITCHED_ON_S


def lies_in_hole(hour: Hour, from_s: float, to_s: float, margin_s: float = 0.0) -> bool:
    return any(from_s <= end_s + margin_s and to_s >= begin_s - margin_s for begin_s, end_s in hour.holes_s())


def test_the_run_had_faults_of_every_kind_and_holes(hour: Hour) -> None:
    kinds = {fault.partition(": ")[2] for fault in hour.faults}
    assert {"killed", "hung"} <= kinds
    assert "server restarted" in {gap.reason for gap in hour.seen.gaps}
    assert {"session lost", "the server was silent"} & {gap.reason for gap in hour.seen.gaps}
    assert hour.control.ask("clear") == {"writes": 0, "calls": 0}


def test_each_observation_is_accounted_for(hour: Hour) -> None:
    seen = hour.seen
    assert seen.unaccounted == 0
    assert seen.received == seen.emitted + seen.dropped + seen.held
    assert seen.received > 10 * SECONDS


def test_every_value_that_was_published_was_shown_at_that_time(hour: Hour) -> None:
    states, _ = hour.truth()
    times_s = [state.at_s for state in states]
    checked = 0
    for sample in hour.seen.published:
        if sample.signal in _SHOWN and sample.value is not None:
            value = _SHOWN[sample.signal]
            at_that_time = [value(state) for state in shown_around(states, times_s, machine_s(sample))]
            assert sample.value in at_that_time, (sample, at_that_time, hour.faults)
            checked += 1
    assert checked > 5 * SECONDS


@pytest.mark.parametrize("name", ["tool_number", "exec_state", "nc_line"])
def test_each_value_that_the_machine_showed_arrived_or_lies_in_a_stated_hole(hour: Hour, name: str) -> None:
    states, _ = hour.truth()
    got = sorted((machine_s(sample), sample.value) for sample in hour.seen.taken if sample.signal == name)
    times_s = [at_s for at_s, _ in got]
    missed, value = 0, _SHOWN[name]
    lasting = [(a, b) for a, b in pairwise(states) if value(a) != value(b)]
    until_s = {after.at_s: then.at_s for (_, after), (_, then) in pairwise(lasting)}
    for _, after in lasting:
        if after.at_s > hour.control.machine_s - 1.0 or until_s.get(after.at_s, 1e9) - after.at_s < 2 * LOOK_S:
            continue  # shorter than two looks: the server itself may not have seen it
        near = got[bisect_left(times_s, after.at_s - 0.002) : bisect_right(times_s, after.at_s + 2 * LOOK_S)]
        if value(after) not in [one for _, one in near]:
            missed += 1
            assert lies_in_hole(hour, after.at_s, after.at_s), (
                f"{name} at {after.at_s}: faults {hour.faults}, holes {hour.holes_s()}"
            )
    assert missed <= sum(gap.lost for gap in hour.seen.gaps)


def test_the_tool_change_is_right_at_each_change_and_at_no_other_time(hour: Hour) -> None:
    _, changes = hour.truth()
    told = [sample for sample in hour.seen.published if sample.signal == "tool_change_active" and sample.value is not None]
    begun = [machine_s(sample) for sample in told if sample.value is True]
    ended = [machine_s(sample) for sample in told if sample.value is False and not sample.is_baseline]
    whole = [change for change in changes if not lies_in_hole(hour, change.from_s, change.to_s, margin_s=2.5)]
    for change in whole:
        assert sum(abs(at_s - change.from_s) <= TOLERANCE_S for at_s in begun) == 1, (change, begun, hour.faults)
        assert sum(abs(at_s - change.to_s) <= TOLERANCE_S for at_s in ended) >= 1, (change, ended, hour.faults)
    for at_s in begun:
        is_true = any(abs(at_s - change.from_s) <= TOLERANCE_S for change in changes)
        assert is_true or lies_in_hole(hour, at_s, at_s, margin_s=5.0) or at_s > hour.control.machine_s - 12.0, (
            at_s,
            hour.faults,
        )
    assert len(whole) >= len(changes) // 3


def test_show_the_figures(hour: Hour) -> None:
    """Not a test of anything; `-s` shows what the run was like."""
    seen, (_, changes) = hour.seen, hour.truth()
    whole = [change for change in changes if not lies_in_hole(hour, change.from_s, change.to_s, margin_s=2.5)]
    lost_s = sum(end_s - begin_s for begin_s, end_s in hour.holes_s())
    print(f"\n{hour.control.machine_s:.0f} s of production, faults: {', '.join(hour.faults)}")
    print(f"{seen.received} observations = {seen.emitted} emitted + {seen.dropped} dropped + {seen.held} held")
    print(f"{len(seen.gaps)} holes of {lost_s:.0f} s, at most {sum(gap.lost for gap in seen.gaps)} lost: {seen.gaps}")
    print(f"{len(whole)} of {len(changes)} tool changes outside of holes; {hour.connection.reconnects} reconnects")
