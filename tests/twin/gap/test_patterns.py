"""What the gap goes with, on made up gaps and on those of the shared cases."""

import numpy as np
import pytest

from tests.twin.gap.traces import MACHINE, noise, shared_case, strokes, trace, traces_of
from twin.gap.diagnosis import Pattern
from twin.gap.patterns import patterns
from twin.runlog import RunLog, run_log

LOG = strokes((1200.0, 3000.0, 1800.0, 2400.0))
X = LOG["x_ref_mm"]
V = np.gradient(X, LOG.t_s)


def found(gap, signal: str = "x_torque_a", log: RunLog = LOG, floor: float = 0.01) -> tuple[Pattern, ...]:  # type: ignore[no-untyped-def]
    return patterns([trace(log, gap + noise(log, 1, floor), signal, floor)], {"run": log}, MACHINE)


def overs(of: tuple[Pattern, ...]) -> list[str]:
    return [pattern.over for pattern in of]


def test_nothing_is_said_of_what_repeats() -> None:
    assert sum(len(patterns([trace(LOG, noise(LOG, seed))], {"run": LOG}, MACHINE)) for seed in range(10)) <= 1


def test_a_ripple_is_found_in_the_phase_of_the_screw_at_its_order() -> None:
    first = found(0.03 * np.sin(6 * 2 * np.pi * X / 12.0 + 1.0))[0]
    assert first.over == "lead phase"
    assert "repeats 6 times a turn of the screw (amplitude 0.030 A)" in first.sentence
    assert first.effect_size == pytest.approx(3.0, rel=0.05)


def test_a_gap_that_grows_along_the_axis_is_found_over_position() -> None:
    first = found(0.004 * (X - 20.0))[0]
    assert first.over == "position"
    assert np.polyfit(first.at, first.mean, 1)[0] == pytest.approx(0.004, rel=0.1)


def test_direction_friction_is_even_in_v_and_not_there_at_rest() -> None:
    said = overs(found(0.08 * (np.abs(V) > 0.0)))
    assert {"even in v", "rest against motion"} <= set(said)
    assert "+v against −v" not in said
    assert "odd in v" not in said


def test_an_offset_is_the_same_in_both_directions_and_at_rest() -> None:
    assert overs(found(np.full(len(X), 0.08))) == ["even in v"]


def test_what_opposes_the_motion_is_odd_in_v() -> None:
    said = found(0.0015 * V)
    assert {"odd in v", "+v against −v", "fast against slow"} <= set(overs(said))
    assert "even in v" not in overs(said)
    odd = next(pattern for pattern in said if pattern.over == "odd in v")
    assert np.allclose(odd.mean, 0.0015 * np.array(odd.at), rtol=0.2)


def test_a_drift_is_found_over_time() -> None:
    said = overs(found(0.02 * (LOG.t_s - LOG.t_s.mean())))
    assert {"time", "early against late"} <= set(said)


def test_a_gap_of_one_stroke_is_found_in_its_program_section() -> None:
    said = {pattern.over: pattern for pattern in found(0.05 * ((LOG["line"] == 5.0) & (V != 0.0)))}
    assert "at line 5" in said["section"].sentence


def test_runout_is_found_in_the_phase_of_the_spindle() -> None:
    t_s = np.arange(4000) * 0.001
    angle = np.mod(2.0 * np.pi * 50.0 * t_s, 2.0 * np.pi)
    cut = {"axial_depth_mm": np.full(4000, 2.0), "spindle_rpm": np.full(4000, 3000.0), "spindle_angle_rad": angle}
    log = run_log({"t_s": t_s, **cut})
    first = found(12.0 * np.cos(angle + 0.4), "force_x_n", log, 2.0)[0]
    assert first.over == "spindle phase"
    assert "repeats once a turn of the spindle (amplitude 12 N)" in first.sentence


def test_coolant_that_cools_is_found_in_the_contrast_of_coolant() -> None:
    t_s = np.arange(4000.0)
    on = (np.floor(t_s / 500.0) % 2 == 1).astype(float)
    log = run_log({"t_s": t_s, "spindle_rpm": np.full(4000, 8000.0), "coolant_on": on})
    assert found(0.5 * on, "spindle_temp_c", log, 0.08)[0].over == "coolant on against off"


def test_missing_samples_and_columns_are_no_obstacle() -> None:
    gap = np.full(len(X), 0.08)
    gap[::5] = np.nan
    assert "even in v" in overs(found(gap))
    bare = run_log({"t_s": LOG.t_s})
    assert patterns([trace(bare, np.full(len(X), 0.08))], {"run": bare}, MACHINE) == ()
    assert patterns([], {}, MACHINE) == ()


def test_gaps_of_the_shared_cases_go_with_what_they_should() -> None:
    friction, play = shared_case("case_02"), shared_case("case_03")
    said = [p for p in patterns(*traces_of(friction, friction.machine), friction.machine) if p.signal == "z_torque_a"]
    assert said[0].over == "even in v"
    said = [p for p in patterns(*traces_of(play, play.machine), play.machine) if p.signal == "x_table_mm"]
    assert said[0].over == "+v against −v"
