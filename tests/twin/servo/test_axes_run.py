"""Axes: the same bits in Python, in one lane and in many; the nominal model of formats, section 4; true sticking."""

import numpy as np
import pytest

from tests.twin.axes import MACHINE, constants, reference, with_effect
from twin.effects.catalogue import effect_named
from twin.errors import EffectError
from twin.servo.run import AxisInput, run_axes

REFERENCE = reference()
OUTPUTS = ("position_mm", "torque_a", "velocity_mm_s", "table_mm")
THREE = np.arange(3)


def fine_steps(letter: str, column: int, steps: int) -> tuple[np.ndarray, np.ndarray]:
    """The nominal model as formats, section 4, words it, by plain Euler steps between the ticks; no code of ours."""
    axis = MACHINE.axes[letter]
    friction = axis.friction
    assert axis.torque_constant_nm_per_a and axis.screw_lead_mm
    per_a = axis.torque_constant_nm_per_a * 2 * np.pi / axis.screw_lead_mm * 1000
    x, v, integral, period = 0.0, 0.0, 0.0, 0.001
    dt, positions, torques = period / steps, [], []
    for ref in REFERENCE[column]:
        error = axis.position_gain_per_s * (ref - x) - v
        integral += axis.velocity_integral_gain_a_per_mm * error * period
        torque = axis.velocity_gain_a_s_per_mm * error + integral
        positions.append(x)
        torques.append(torque)
        force = per_a * torque
        for _ in range(steps):
            curve = friction.coulomb_n + (friction.static_n - friction.coulomb_n) * np.exp(-((v / 6.0) ** 2))
            free = v + dt * 1000 * (force - 2.4 * v) / axis.mass_kg
            hold = dt * 1000 * curve / axis.mass_kg
            v = 0.0 if abs(free) <= hold else free - np.sign(free) * hold
            x += dt * v
    return np.array(positions), np.array(torques)


def test_the_nominal_axis_is_that_of_the_formats() -> None:
    run = run_axes(constants(), AxisInput(REFERENCE, THREE))
    for column, letter in ((0, "x"), (2, "z")):
        off = [np.abs(run.outputs["position_mm"][column] - fine_steps(letter, column, steps)[0]).max() for steps in (20, 80)]
        assert off[1] < 0.3 * off[0], "Euler's own error of first order is all there is between the two"
        assert off[1] < 4e-4


def test_halving_the_step_moves_no_position_by_a_tenth_of_a_micrometre() -> None:
    one, two, many = (
        run_axes(constants(), AxisInput(REFERENCE, THREE), steps=steps).outputs["position_mm"] for steps in (1, 2, 64)
    )
    assert np.abs(one - two).max() < 1e-4
    assert np.abs(one - many).max() < 1e-4


@pytest.mark.parametrize("effects", [(), ("backlash", "presliding", "torque_ripple", "viscous_warmup")])
def test_python_one_lane_and_many_lanes_give_the_same_bits(effects: tuple[str, ...]) -> None:
    three, many = constants(), constants(lanes=33)
    for name in effects:
        three = with_effect(three, name, effect_named(name).typical_values())
        many = with_effect(many, name, effect_named(name).typical_values())
    short = REFERENCE[:, :600]
    python = run_axes(three, AxisInput(short, THREE), effects=effects, outputs=OUTPUTS, reference_run=True)
    single = run_axes(three, AxisInput(short, THREE), effects=effects, outputs=OUTPUTS)
    batch = run_axes(many, AxisInput(short, np.repeat(THREE, 33)), effects=effects, outputs=OUTPUTS)
    for name in OUTPUTS:
        np.testing.assert_array_equal(python.outputs[name], single.outputs[name])
        for lane in (0, 32):
            np.testing.assert_array_equal(single.outputs[name], batch.outputs[name][lane::33])


def test_lanes_of_a_batch_do_not_touch_each_other() -> None:
    given = constants(lanes=40)
    given["mass_kg"] = given["mass_kg"] * np.linspace(0.8, 1.2, 120)
    batch = run_axes(given, AxisInput(REFERENCE, np.repeat(THREE, 40)))
    for lane in (0, 39, 77, 119):
        alone = run_axes(
            {name: values[lane : lane + 1] for name, values in given.items()}, AxisInput(REFERENCE, np.array([lane // 40]))
        )
        np.testing.assert_array_equal(alone.outputs["position_mm"][0], batch.outputs["position_mm"][lane])


def test_a_run_in_two_parts_is_the_run_in_one() -> None:
    whole = run_axes(constants(), AxisInput(REFERENCE, THREE))
    first = run_axes(constants(), AxisInput(REFERENCE[:, :1234], THREE))
    second = run_axes(constants(), AxisInput(REFERENCE[:, 1234:], THREE), start=first.state, first_tick=first.ticks)
    parts = np.concatenate([first.outputs["position_mm"], second.outputs["position_mm"]], axis=1)
    np.testing.assert_array_equal(whole.outputs["position_mm"], parts)


def test_an_axis_below_its_breakaway_force_does_not_move_at_all() -> None:
    still = np.zeros((1, 500))
    push = np.full((1, 500), 519.0)
    loose = {name: values[:1] for name, values in constants().items()}
    loose = loose | {"velocity_integral_gain_a_per_mm": np.zeros(1)}
    held = run_axes(loose, AxisInput(still, np.array([0]), push))
    assert not held.outputs["position_mm"].any()
    gone = run_axes(loose, AxisInput(still, np.array([0]), push + 2.0))
    assert gone.outputs["position_mm"][0, -1] < 0.0  # a disturbance that resists + pushes towards -


def test_sums_and_peaks_are_those_of_the_traces() -> None:
    run = run_axes(constants(), AxisInput(REFERENCE, THREE), outputs=("position_mm", "torque_a"), measured=True)
    error = REFERENCE - run.outputs["position_mm"]
    np.testing.assert_allclose(run.following_error_rms_mm(), np.sqrt(np.mean(error**2, axis=1)), rtol=1e-12)
    np.testing.assert_allclose(run.state["following_error_peak_mm"], np.abs(error).max(axis=1), rtol=1e-12)
    np.testing.assert_allclose(run.torque_rms_a(), np.sqrt(np.mean(run.outputs["torque_a"] ** 2, axis=1)), rtol=1e-12)
    np.testing.assert_allclose(run.state["torque_peak_a"], np.abs(run.outputs["torque_a"]).max(axis=1), rtol=1e-12)


def test_a_recorded_torque_takes_the_place_of_the_controller() -> None:
    closed = run_axes(constants(), AxisInput(REFERENCE, THREE))
    fed = AxisInput(REFERENCE, THREE, recorded={"torque_a": closed.outputs["torque_a"]})
    opened = run_axes(constants(), fed, outputs=("position_mm", "torque_a"))
    np.testing.assert_allclose(opened.outputs["position_mm"], closed.outputs["position_mm"], atol=1e-9)
    np.testing.assert_array_equal(opened.outputs["torque_a"], closed.outputs["torque_a"])


def test_recorded_motion_leaves_the_controller_alone() -> None:
    closed = run_axes(constants(), AxisInput(REFERENCE, THREE), outputs=OUTPUTS)
    recorded = {"position_mm": closed.outputs["position_mm"], "velocity_mm_s": closed.outputs["velocity_mm_s"]}
    heavy = constants() | {"mass_kg": 3.0 * constants()["mass_kg"]}
    control = run_axes(heavy, AxisInput(REFERENCE, THREE, recorded=recorded))
    np.testing.assert_array_equal(control.outputs["torque_a"], closed.outputs["torque_a"])


def test_what_cannot_be_replaced_is_named() -> None:
    with pytest.raises(EffectError, match="'nothing' is not a quantity that can be replaced"):
        run_axes(constants(), AxisInput(REFERENCE, THREE, recorded={"nothing": REFERENCE}))


def test_a_missing_constant_is_named() -> None:
    given = constants()
    del given["mass_kg"]
    with pytest.raises(EffectError, match="mass_kg"):
        run_axes(given, AxisInput(REFERENCE, THREE))
