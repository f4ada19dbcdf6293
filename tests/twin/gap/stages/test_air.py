"""The spindle's load in air, from what a control says once a second."""

from dataclasses import replace

import numpy as np
import pytest

from tests.twin.gap.stages.produced import MACHINE, case_with, produced, without
from twin.case import RunKind
from twin.effects.catalogue import effect_named
from twin.gap.diagnose import diagnose
from twin.gap.diagnosis import Effected
from twin.gap.floors import Floors
from twin.gap.stages.air import AirStage, air_runs, in_air
from twin.gap.stages.shown import shown
from twin.machine import AddedEffect
from twin.runlog import run_log

LOAD = "spindle_load_pct"
CLASS = {"rated_power", "sensor_scale", "sensor_bias"}


def test_only_a_steady_spindle_in_air_counts() -> None:
    run = produced(1)
    (found,) = air_runs(MACHINE, (run,))
    log = run.log
    assert len(found.rows) == 20 * 9, "ten seconds in air, without the first"
    assert (log["feed_mm_min"][found.rows] == 0.0).all()
    assert (log["spindle_rpm"][found.rows] > 0.0).all()


def test_a_rapid_motion_is_in_air_and_a_feed_is_not() -> None:
    run = produced(1)
    log = run.log
    log.columns["feed_mm_min"][log["feed_mm_min"] > 0.0] = 24000.0
    assert in_air(log, MACHINE).all()
    log.columns["feed_mm_min"][:] = 20.0
    assert not in_air(without(run, "tool_change_active").log, MACHINE).any()


def test_a_run_that_says_no_feed_does_not_say_when_nothing_is_cut() -> None:
    assert air_runs(MACHINE, (without(produced(1), "feed_mm_min", "tool_change_active"),)) == ()


def test_a_machine_as_told_is_healthy() -> None:
    assert diagnose(case_with()).diagnosis.verdict.value == "healthy"


def test_an_idle_power_within_what_is_not_known_of_it_is_healthy() -> None:
    assert diagnose(case_with(factor=1.08)).diagnosis.verdict.value == "healthy"


def test_whole_percents_are_no_gap() -> None:
    assert diagnose(case_with(factor=1.08, step_pct=1.0)).diagnosis.verdict.value == "healthy"


def test_steps_of_the_reading_do_not_hide_how_sure_a_size_is() -> None:
    (cause,) = diagnose(case_with(factor=1.6, step_pct=1.0)).diagnosis.causes
    (size,) = cause.parameters.values()
    assert cause.effect in CLASS
    assert size.low < 1.0 / 1.6 < size.high < 1.0
    assert size.high - size.low < 0.3


@pytest.mark.parametrize("step_pct", [0.1, 1.0])
def test_idle_power_that_grows_with_the_speed_is_named(step_pct: float) -> None:
    told = diagnose(case_with(slope_pct=6.0, step_pct=step_pct)).diagnosis
    assert [c.effect for c in told.causes] == ["idle_speed_power"]
    power = told.causes[0].parameters["power_kw"]
    assert power.low <= 0.6 <= power.high
    assert told.gap.after < 1.3


def test_a_load_that_is_off_by_a_factor_is_a_class() -> None:
    told = diagnose(case_with(factor=1.8)).diagnosis
    (cause,) = told.causes
    assert {cause.effect, *(e.effect for e in cause.indistinguishable_from)} == CLASS


def test_an_effect_that_the_twin_has_is_no_gap_and_no_candidate() -> None:
    known = AddedEffect(effect="sensor_scale", on=LOAD, parameters={"scale": 1.8})
    machine = MACHINE.model_copy(update={"effects": (known,)})
    assert diagnose(case_with(machine, factor=1.8)).diagnosis.verdict.value == "healthy"
    stage = AirStage(machine, air_runs(machine, (produced(1),)), Floors(machine, {}))
    assert Effected("sensor_scale", LOAD) not in stage.candidates


def test_what_changes_no_load_in_air_is_no_candidate() -> None:
    stage = AirStage(MACHINE, air_runs(MACHINE, (produced(1),)), Floors(MACHINE, {}))
    names = {e.effect for e in stage.candidates}
    assert names == {"idle_speed_power", *CLASS}
    assert not any(effect_named(name).shows_only_fast for name in names)


def test_where_something_may_be_cut_nothing_is_shown() -> None:
    run = produced(1)
    column = shown(MACHINE, run, Floors(MACHINE, {}))[LOAD]
    assert np.isfinite(column).sum() == 20 * 9
    assert np.isnan(column[run.log["feed_mm_min"] > 0.0]).all()


def test_a_program_that_stands_in_a_stretch_as_well_counts_once() -> None:
    stretch, program = produced(1), produced(2)
    cut = replace(program, entry=program.entry.model_copy(update={"kind": RunKind.CUT, "file": "cut"}))
    assert [run.name for run in air_runs(MACHINE, (stretch, cut))] == [stretch.name]
    assert [run.name for run in air_runs(MACHINE, (cut,))] == ["cut"]
    engaged = run_log({"t_s": cut.log.t_s, **cut.log.columns, "axial_depth_mm": np.zeros(len(cut.log))})
    assert len(air_runs(MACHINE, (stretch, replace(cut, recording=engaged)))) == 2
