"""The control as the effects of a machine change it."""

import numpy as np
import pytest

from twin.errors import EffectError
from twin.machine import AddedEffect, MachineFile, machine_from_toml
from twin.motion.control import LENGTH_OVER_FEED, Control, changed, control_of
from twin.motion.limits import Limits
from twin.motion.path import path_from_moves
from twin.motion.sampling import sampled
from twin.programs import interpret
from twin.simulator.simulation import IDEAL_TIMES, simulate

BARE = machine_from_toml("[machine]\nname = 'bare'\n")
STATED = machine_from_toml("[machine]\nname = 'stated'\n[program]\nrapid_mm_min = 20000.0\nacceleration_mm_s2 = 2000.0\n")
PROGRAM = "T1 M6\nS6000 M3\nG0 X200\nG1 X210 F600\nG1 X310 F3000\nM30\n"


def with_effects(machine: MachineFile, **effects: dict[str, float]) -> MachineFile:
    added = tuple(AddedEffect(effect=name, parameters=values) for name, values in effects.items())
    return machine.model_copy(update={"effects": added})


def seconds(control: Control) -> float:
    return control.plan(path_from_moves(interpret(PROGRAM))).total_s


def test_a_stated_control_without_effects_is_the_stated_one() -> None:
    assert STATED.program is not None
    assert seconds(control_of(STATED, IDEAL_TIMES)) == seconds(Control(Limits.of(STATED.program)))


def test_a_machine_of_which_nothing_is_known_is_a_middling_one_and_one_told_by_effects_is_length_over_feed() -> None:
    assert seconds(control_of(BARE, IDEAL_TIMES)) == seconds(Control(Limits.of(IDEAL_TIMES)))
    told = control_of(with_effects(BARE, tool_change_time={"change_s": 3.0}), IDEAL_TIMES)
    # 200 mm at 30 m/min, 10 mm at 600 and 100 mm at 3000 mm/min, and the tool change
    assert seconds(told) == pytest.approx(0.4 + 1.0 + 2.0 + 3.0, abs=1e-3)
    null = control_of(with_effects(BARE, tool_change_time={"change_s": 0.0}), IDEAL_TIMES)
    assert seconds(null) == seconds(Control(Limits.of(IDEAL_TIMES)))


def test_an_effect_adds_to_what_is_stated_and_never_makes_an_axis_faster() -> None:
    faster = changed(Limits.of(IDEAL_TIMES), {"corner_slowdown": {"acceleration_mm_s2": 1e5, "corner_mm_min": 1e5}})
    assert faster.limits.acceleration_mm_s2 == IDEAL_TIMES.acceleration_mm_s2
    assert faster.limits.corner_speed_difference_mm_min == IDEAL_TIMES.corner_speed_difference_mm_min
    each = changed(
        LENGTH_OVER_FEED.with_(acceleration_mm_s2=(100.0, 900.0, 400.0)), {"corner_slowdown": {"acceleration_mm_s2": 300.0}}
    )
    assert each.limits.acceleration_mm_s2 == (100.0, 300.0, 300.0)


def test_the_simulated_machine_honours_them() -> None:
    plain, slow = simulate(STATED, PROGRAM), simulate(with_effects(STATED, feed_override={"ratio": 0.5}), PROGRAM)
    assert slow.seconds - plain.seconds == pytest.approx(1.0 + 2.0, abs=0.05)
    said = simulate(with_effects(BARE, feed_override={"ratio": 0.5}), PROGRAM).notes
    assert any("length over feed" in note for note in said)
    with pytest.raises(EffectError, match=r"feed_override: ratio is 9 "):
        simulate(with_effects(STATED, feed_override={"ratio": 9.0}), PROGRAM)


def test_sampled_lines_last_as_long_as_the_plan_says_a_wait_for_the_spindle_included() -> None:
    control = changed(LENGTH_OVER_FEED, {"tool_change_time": {"change_s": 2.0, "up_rpm_s": 2000.0}})
    planned = control.plan(path_from_moves(interpret(PROGRAM)))
    motion = sampled(planned, 0.001)
    by_line = planned.seconds_by_line()
    assert by_line[2] > 2.0, "the rapid waits for the spindle"
    lasted = np.bincount(motion.line, minlength=len(by_line)) * 0.001
    np.testing.assert_allclose(lasted[: len(by_line) - 1], by_line[:-1], atol=0.003)
