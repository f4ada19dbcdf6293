"""A machine in production: a day is a function of its seed and its start, and an effect shows where it acts."""

from dataclasses import replace

import numpy as np
import pytest

from cnctwin.standins.production.day import Day, Production, production_day, production_days
from cnctwin.standins.production.schedule import ROUND_THE_CLOCK, USUAL_SHIFTS
from cnctwin.standins.production.shown import Shown
from cnctwin.standins.production.variation import NONE
from cnctwin.standins.simulated_machine.as_built import machine_as_built
from twin.machine import AddedEffect, MachineFile

MONDAY_S = 1_780_272_000.0  # 2026-06-01T00:00:00Z
HOUR_S, DAY_S = 3600.0, 86_400.0
FINE = Shown(0.0, 0.0, 0.0, 0.0)


@pytest.fixture(scope="module")
def machine() -> MachineFile:
    return machine_as_built()


@pytest.fixture(scope="module")
def monday(machine: MachineFile) -> Day:
    return production_day(machine, seed=1, start_s=MONDAY_S)


def with_effect(machine: MachineFile, name: str, on: str = "", **parameters: float) -> MachineFile:
    """The machine with one effect more."""
    added = AddedEffect(effect=name, on=on, parameters=parameters)
    return machine.model_copy(update={"effects": (*machine.effects, added)})


def afternoon(machine: MachineFile) -> Day:
    """Four hours without anything that varies, as fine as it is."""
    shifts = replace(ROUND_THE_CLOCK, stop_chance=0.0)
    return Production(machine, 3, shifts=shifts, variation=NONE, shown=FINE).day(MONDAY_S + 12 * HOUR_S, 4.0)


def changes_s(day: Day) -> np.ndarray:
    """The lengths of the tool changes, s."""
    active = np.diff(day.columns["tool_change_active"])
    begin, end = np.flatnonzero(active > 0.0) + 1, np.flatnonzero(active < 0.0) + 1
    return day.at_s[end[: len(begin)]] - day.at_s[begin[: len(end)]]


def test_the_same_seed_and_start_are_the_same_day_and_others_are_not(machine: MachineFile, monday: Day) -> None:
    again, other = production_day(machine, 1, MONDAY_S), production_day(machine, 2, MONDAY_S)
    assert all(np.array_equal(again.columns[name], values, equal_nan=True) for name, values in monday.columns.items())
    assert len(other) != len(monday) or not np.array_equal(other.columns["spindle_load_pct"], monday.columns["spindle_load_pct"])


def test_a_day_has_shifts_breaks_parts_and_stops(machine: MachineFile, monday: Day) -> None:
    hours = (monday.at_s - MONDAY_S) / HOUR_S
    assert hours[0] == pytest.approx(USUAL_SHIFTS.start_h, abs=0.01)
    assert hours[-1] == pytest.approx(USUAL_SHIFTS.end_h, abs=0.05), "a part that has begun is finished"
    assert np.all(np.diff(monday.at_s) > 0.0)
    assert {"READY", "ACTIVE", "FEED_HOLD", "PROGRAM_COMPLETED"} == set(monday.exec_state)
    assert set(monday.program) == {"O9000", "O1701", "O1802"}
    assert len(production_day(machine, 1, MONDAY_S + 5 * DAY_S)) == 0, "on Saturdays it is off"


def test_what_is_shown_is_rounded_as_a_control_rounds(monday: Day) -> None:
    assert np.all(monday.columns["spindle_load_pct"] % 1.0 == 0.0)
    tenths = monday.columns["spindle_temp_c"] * 10.0
    assert np.allclose(tenths, np.round(tenths))
    assert np.isnan(monday.columns["tool_number"]).any(), "no tool while it is changed"


def test_rows_are_canonical_signals_and_the_run_log_holds_the_same(monday: Day) -> None:
    at_s, row = next(monday.rows())
    assert at_s == monday.at_s[0]
    assert {"spindle_rpm", "spindle_load_pct", "program", "exec_state", "tool_change_active", "ambient_temp_c"} <= set(row)
    assert isinstance(row["tool_change_active"], bool)
    run = monday.run_log()
    assert len(run) == len(monday)
    assert run.ignored == ()


def test_thinned_rows_keep_every_change_of_a_state(monday: Day) -> None:
    few = monday.thinned(20.0)
    assert 3 * len(few) < len(monday) < 40 * len(few)
    assert np.array_equal(changes_s(few), changes_s(monday))
    assert set(few.program) == set(monday.program)


@pytest.mark.parametrize(
    ("name", "on", "parameters", "signal", "change"),
    [
        ("idle_speed_power", "", {"power_kw": 0.3}, "spindle_load_pct", 1.0),
        ("rated_power", "", {"scale": 0.8}, "spindle_load_pct", 0.5),
        ("coolant_cooling", "", {"gain": 0.5}, "spindle_temp_c", -0.5),
        ("speed_convection", "", {"gain": 0.5}, "spindle_temp_c", -0.5),
        ("sensor_bias", "spindle_temp_c", {"bias": 1.5}, "spindle_temp_c", 1.4),
        ("sensor_scale", "spindle_load_pct", {"scale": 1.3}, "spindle_load_pct", 0.5),
        ("cutting_coefficient", "", {"scale": 1.4}, "spindle_load_pct", 0.5),
    ],
)
def test_an_effect_shows_in_the_signal_that_it_acts_on(
    machine: MachineFile, name: str, on: str, parameters: dict[str, float], signal: str, change: float
) -> None:
    plain, changed = afternoon(machine), afternoon(with_effect(machine, name, on, **parameters))
    turning = plain.columns["spindle_rpm"] > 0.0
    by = float(np.mean(changed.columns[signal][turning] - plain.columns[signal][turning]))
    assert by > change if change > 0.0 else by < change


def test_a_longer_tool_change_shows_in_its_length(machine: MachineFile) -> None:
    plain, longer = afternoon(machine), afternoon(with_effect(machine, "tool_change_time", change_s=1.5))
    assert changes_s(longer).mean() - changes_s(plain).mean() == pytest.approx(1.5, abs=0.3)


def test_days_follow_each_other_and_a_machine_becomes_another_one_at_its_hour(machine: MachineFile) -> None:
    before = Production(machine, 4)
    after = Production(with_effect(machine, "sensor_bias", "spindle_temp_c", bias=5.0), 4)
    at_s = MONDAY_S + DAY_S + 12 * HOUR_S
    days = list(production_days([(at_s, before), (MONDAY_S + 2 * DAY_S, after)], MONDAY_S))
    assert [len(day) > 0 for day in days] == [True, True, True]
    assert days[1].at_s[-1] < at_s <= days[2].at_s[0]
    step_k = days[2].columns["spindle_temp_c"][0] - days[1].columns["spindle_temp_c"][-1]
    assert step_k == pytest.approx(5.0, abs=0.3), "the spindle itself goes on at its temperature"
