"""A robot-like axis that is not the twin's: an elastic joint with an encoder on either side, and a state feedback for controller.

    m₁ a₁ = k u − spring − F₁(v₁),   m₂ a₂ = spring − F₂(v₂) − load,   spring = stiffness (x₁ − x₂) + damping (v₁ − v₂)
    u = (k_x (r − x₁) + k_v (r' − v₁) − k_s spring + m r'') / k

Friction, on the link or for a part on the motor, is larger in + than in −. It is sampled every 4 ms; the loops of the twin's file
tick every millisecond.
"""

import math
from dataclasses import dataclass
from functools import cache
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from twin.case import Case, RunAtHand, RunEntry, RunKind
from twin.machine import machine_from_toml
from twin.runlog import run_log

Floats = NDArray[np.float64]
MACHINE = machine_from_toml(
    """
[machine]
name = "robot"
servo_period_s = 0.001
[axes.b]
mass_kg = 200.0
force_per_command_n = 60.0
position_gain_per_s = 30.0
velocity_gain_a_s_per_mm = 0.20
velocity_integral_gain_a_per_mm = 4.0
torque_limit_a = 60.0
[axes.b.friction]
coulomb_n = 240.0
static_n = 250.0
stribeck_velocity_mm_s = 4.0
viscous_n_s_per_mm = 1.5
[uncertainty]
relative = 0.05
"""
)
MOVING_KG, NEWTON_PER_A = 205.0, 60.0
STIFFNESS_N_PER_MM, DAMPING_N_S_PER_MM = 20000.0, 40.0
ASYMMETRY = 0.15
STEP_S, EVERY = 0.0002, 20


@dataclass(frozen=True, slots=True)
class Joint:
    """The joint of such an axis.

    motor_kg: of the moving mass, before the spring; on_motor: part of the friction before it
    gear_mm: error of the gears, with the motor, once in `GEAR_TURN_MM`
    arm_n: weight of an arm, which goes with the sine of its angle; `ARM_TURN_MM` are a whole turn
    play_mm: of the gears, between motor and spring
    """

    motor_kg: float = 30.0
    on_motor: float = 0.0
    asymmetry: float = ASYMMETRY
    gear_mm: float = 0.0
    arm_n: float = 0.0
    play_mm: float = 0.0


GEAR_TURN_MM, ARM_TURN_MM = 9.0, 400.0


def reference(seed: int, seconds: float) -> Floats:
    """A smooth motion of several sines, at rest at both ends."""
    draw = np.random.default_rng(seed)
    t_s = np.arange(0.0, seconds, STEP_S)
    envelope = np.clip((t_s - 0.5) / 0.5, 0.0, 1.0) * np.clip((seconds - 0.7 - t_s) / 0.5, 0.0, 1.0)
    smooth = envelope**3 * (10.0 - 15.0 * envelope + 6.0 * envelope**2)
    frequencies, sizes = draw.uniform(0.15, 0.9, 4), draw.uniform(15.0, 40.0, 4)
    return np.asarray(smooth * sum(a * np.sin(2.0 * np.pi * f * t_s) for f, a in zip(frequencies, sizes, strict=True)))


def _sliding(velocity: float, push: float, part: float, asymmetry: float) -> float:
    """Friction with its sign; at rest, whatever holds against the push."""
    if velocity == 0.0 and abs(push) <= 250.0 * part:
        return push
    direction = math.copysign(1.0, velocity if velocity != 0.0 else push)
    return direction * part * (240.0 + 1.5 * abs(velocity)) * (1.0 + asymmetry * direction)


def _moved(velocity: float, push: float, friction: float, mass_kg: float) -> float:
    """The velocity after a step; it stops where it would turn round."""
    new = velocity + STEP_S * 1000.0 * (push - friction) / mass_kg
    return 0.0 if velocity * new < 0.0 else new


@cache
def moved(seed: int, seconds: float, joint: Joint) -> tuple[Floats, Floats]:
    """The axis without noise, (steps, 3): motor, link, command; and its reference, (steps,). It is the same in each recording."""
    r = reference(seed, seconds)
    rv = np.gradient(r, STEP_S)
    x1 = x2 = v1 = v2 = u = 0.0
    rows = []
    for i, (at, along, ahead) in enumerate(zip(r.tolist(), rv.tolist(), np.gradient(rv, STEP_S).tolist(), strict=True)):
        apart = x1 - x2 - joint.gear_mm * math.sin(2.0 * math.pi * x1 / GEAR_TURN_MM)
        apart -= min(max(apart, -0.5 * joint.play_mm), 0.5 * joint.play_mm)
        spring = STIFFNESS_N_PER_MM * apart + DAMPING_N_S_PER_MM * (v1 - v2)
        if i % 5 == 0:  # the loops of the robot tick every millisecond
            u = (900.0 * (at - x1) + 14.0 * (along - v1) - 0.2 * spring + 0.2 * ahead) / NEWTON_PER_A
        rows.append((x1, x2, u))
        push1, push2 = NEWTON_PER_A * u - spring, spring - joint.arm_n * math.sin(2.0 * math.pi * x2 / ARM_TURN_MM)
        friction1 = _sliding(v1, push1, joint.on_motor, joint.asymmetry)
        friction2 = _sliding(v2, push2, 1.0 - joint.on_motor, joint.asymmetry)
        v1 = _moved(v1, push1, friction1, joint.motor_kg)
        v2 = _moved(v2, push2, friction2, MOVING_KG - joint.motor_kg)
        x1, x2 = x1 + STEP_S * v1, x2 + STEP_S * v2
    return np.array(rows), r


def robot_log(
    seed: int, *, noise_seed: int, seconds: float = 16.0, with_reference: bool = True, joint: Joint = Joint()
) -> dict[str, Floats]:
    """A recording of the axis."""
    rows, r = moved(seed, seconds, joint)
    draw = np.random.default_rng(noise_seed)
    kept = rows[::EVERY] + draw.standard_normal((len(rows[::EVERY]), 3)) * [0.0005, 0.0005, 0.02]
    log = {
        "t_s": np.arange(len(kept)) * STEP_S * EVERY,
        "b_pos_mm": kept[:, 0],
        "b_table_mm": kept[:, 1],
        "b_torque_a": kept[:, 2],
    }
    return log | ({"b_ref_mm": r[::EVERY]} if with_reference else {})


def robot_case(*, with_reference: bool, joint: Joint = Joint()) -> Case:
    """Two runs of one motion to learn from, one of another motion to be judged on."""
    runs = []
    for name, seed, noise_seed, repeats in (("fit", 1, 1, None), ("fit again", 1, 2, "fit"), ("check", 2, 3, None)):
        role = "check" if name == "check" else "fit"
        entry = RunEntry(file=name, kind=RunKind.AIR, role=role, repeats=repeats)
        log = robot_log(seed, noise_seed=noise_seed, with_reference=with_reference, joint=joint)
        runs.append(RunAtHand(entry, Path(), run_log(log, name)))
    return Case("robot", MACHINE, tuple(runs))
