"""An axis of the reference machine: a mass on a screw, with dry friction that truly sticks, twenty steps to a millisecond.

While it slides, the classical Runge-Kutta method; where a step would carry the velocity through zero, the mass comes to rest
there, and stays until what pushes it exceeds the breakaway force (Karnopp 1985, with a velocity band of no width). A contact with
bristles (LuGre, with damping) takes the exact solution of the bristle at a held velocity and a semi-implicit step of the mass.
"""

# ruff: noqa: PLR0917 - physics takes what its equation takes

from math import exp, pi, sin, sqrt
from typing import NamedTuple

import numpy as np
from numba import njit
from numpy.typing import NDArray

Floats = NDArray[np.float64]
STEPS = 20
"""Steps of the mechanics in a tick."""


class AxisPhysics(NamedTuple):
    """Constants of an axis; from `gravity_n` on, what a nominal axis does not have, at nothing.

    N, mm, s, A, kg. cable_n_per_mm is of the chain, spot_* of a place with more friction, wait_* of a breakaway force that grows
    at rest, fade of a drive that weakens as it is loaded, leak_per_s the rate at which the controller forgets its integral.
    compensation_a is fed forward against friction by the direction of the reference (over 1 mm/s), filter_s the time constant
    of a filter of the reference, outer_per_s the integral of the position loop by its proportional part.
    """

    mass_kg: float
    newton_per_a: float
    lead_mm: float
    position_gain: float
    velocity_gain: float
    integral_gain: float
    limit_a: float
    coulomb_n: float
    static_n: float
    stribeck_mm_s: float
    viscous: float
    gravity_n: float = 0.0
    asymmetry: float = 0.0
    warmup: float = 0.0
    warmup_s: float = 20.0
    warmup_w: float = 1.0
    bristle_n_per_mm: float = 0.0
    play_mm: float = 0.0
    wobble_mm: float = 0.0
    wobble_rad: float = 0.0
    screw_n_per_mm: float = 0.0
    ripple_a: float = 0.0
    ripple_order: float = 6.0
    ripple_rad: float = 0.0
    velocity_forward: float = 0.0
    acceleration_forward: float = 0.0
    delay_s: float = 0.0
    compensation_a: float = 0.0
    filter_s: float = 0.0
    outer_per_s: float = 0.0
    spot_n: float = 0.0
    spot_mm: float = 0.0
    spot_width_mm: float = 1.0
    cable_n_per_mm: float = 0.0
    cable_mm: float = 0.0
    drag_n_s2_per_mm2: float = 0.0
    wait_n: float = 0.0
    wait_s: float = 1.0
    fade: float = 0.0
    fade_s: float = 8.0
    fade_a: float = 1.0
    leak_per_s: float = 0.0
    brake_n: float = 0.0
    brake_until_s: float = 0.0
    scale_mm: float = 0.0
    scale_pitch_mm: float = 1.0
    growth_mm_per_k: float = 0.0


@njit(cache=True)
def _dry_n(p: AxisPhysics, x: float, speed: float, direction: float, extra_n: float) -> float:
    """Magnitude of the friction that does not grow with speed."""
    ratio = speed / p.stribeck_mm_s
    dry = p.coulomb_n + (p.static_n + extra_n - p.coulomb_n) * exp(-ratio * ratio)
    if p.spot_n != 0.0:
        away = (x - p.spot_mm) / p.spot_width_mm
        dry += p.spot_n * exp(-away * away)
    return dry * (1.0 + p.asymmetry * direction)


@njit(cache=True)
def _push_n(p: AxisPhysics, x: float, drive_n: float, held_n: float) -> float:
    """Everything that acts on the mass but friction."""
    push = drive_n + held_n - p.gravity_n
    if p.cable_n_per_mm != 0.0:
        push -= p.cable_n_per_mm * (x - p.cable_mm)
    if p.ripple_a != 0.0:
        angle = 2.0 * pi * p.ripple_order * x / p.lead_mm + p.ripple_rad
        push += p.newton_per_a * p.ripple_a * (sin(angle) + 0.1 * sin(2.0 * angle))
    return push


@njit(cache=True)
def _acceleration(
    p: AxisPhysics, x: float, v: float, direction: float, viscous: float, extra_n: float, drive_n: float, held_n: float
) -> float:
    """mm/s² while it slides in `direction`."""
    drag = viscous * v * (1.0 + 0.7 * p.asymmetry * direction) + p.drag_n_s2_per_mm2 * v * abs(v)
    dry = _dry_n(p, x, abs(v), direction, extra_n)
    return 1000.0 * (_push_n(p, x, drive_n, held_n) - direction * dry - drag) / p.mass_kg


@njit(cache=True)
def _slid(
    p: AxisPhysics, x: float, v: float, direction: float, viscous: float, extra_n: float, drive_n: float, held_n: float, h: float
) -> tuple[float, float]:
    """Position and velocity after a step of sliding; velocity 0 where it came to rest."""
    a1 = _acceleration(p, x, v, direction, viscous, extra_n, drive_n, held_n)
    v2 = v + 0.5 * h * a1
    a2 = _acceleration(p, x + 0.5 * h * v, v2, direction, viscous, extra_n, drive_n, held_n)
    v3 = v + 0.5 * h * a2
    a3 = _acceleration(p, x + 0.5 * h * v2, v3, direction, viscous, extra_n, drive_n, held_n)
    v4 = v + h * a3
    a4 = _acceleration(p, x + h * v3, v4, direction, viscous, extra_n, drive_n, held_n)
    after = v + h * (a1 + 2.0 * (a2 + a3) + a4) / 6.0
    if after * direction <= 0.0:
        until = h * v / (v - after) if v != after else 0.0
        return x + 0.5 * v * until, 0.0
    return x + h * (v + 2.0 * (v2 + v3) + v4) / 6.0, after


@njit(cache=True)
def _bent(
    p: AxisPhysics, x: float, v: float, z: float, viscous: float, extra_n: float, drive_n: float, held_n: float, h: float
) -> tuple[float, float, float]:
    """Position, velocity and bristle after a step on bristles."""
    stiffness = p.bristle_n_per_mm
    direction = 1.0 if v > 0.0 else (-1.0 if v < 0.0 else 0.0)
    bent = z
    if v != 0.0:
        dry = _dry_n(p, x, abs(v), direction, extra_n)
        settled = direction * dry / stiffness
        bent = settled + (z - settled) * exp(-stiffness * abs(v) * h / dry)
    damping = 0.1 * sqrt(1000.0 * stiffness * p.mass_kg) / 1000.0
    friction = stiffness * bent + damping * (bent - z) / h + viscous * v + p.drag_n_s2_per_mm2 * v * abs(v)
    after = v + 1000.0 * h * (_push_n(p, x, drive_n, held_n) - friction) / p.mass_kg
    return x + 0.5 * h * (v + after), after, bent


@njit(cache=True)
def run(
    p: AxisPhysics,
    reference: Floats,
    forward_velocity: Floats,
    forward_acceleration: Floats,
    force_n: Floats,
    hold: int,
    out: Floats,
) -> None:
    """Runs an axis. reference and what is fed forward: (n,); force_n: (n · STEPS,) on the mass; hold: ticks before the first one,
    at its reference; out: (3, n) position of the motor, torque, position of the table, at the ticks."""
    period, h = 0.001, 0.001 / STEPS
    x, v, z, integral = reference[0], 0.0, 0.0, 0.0
    outer, wanted, follow = 0.0, reference[0], 1.0 - exp(-period / p.filter_s) if p.filter_s > 0.0 else 1.0
    rest_s, warmth, heat = 10.0, 0.0, 0.0
    engaged, wind, wind_speed = x, 0.0, 0.0
    screw_rate = sqrt(1000.0 * p.screw_n_per_mm / (0.7 * p.mass_kg)) if p.screw_n_per_mm > 0.0 else 0.0
    for tick in range(-hold, len(reference)):
        now = max(tick, 0)
        wanted = wanted + follow * (reference[now] - wanted) if p.filter_s > 0.0 else reference[now]
        outer += p.outer_per_s * (wanted - x) * period
        error = p.position_gain * (wanted - x + outer) + p.velocity_forward * forward_velocity[now] - v
        integral += (p.integral_gain * error - p.leak_per_s * integral) * period
        integral = min(max(integral, -p.limit_a), p.limit_a)
        torque = p.velocity_gain * error + integral
        if p.compensation_a != 0.0:
            torque += p.compensation_a * min(max(forward_velocity[now], -1.0), 1.0)
        torque += p.acceleration_forward * p.mass_kg * 0.001 * forward_acceleration[now] / p.newton_per_a
        torque = min(max(torque, -p.limit_a), p.limit_a)
        table = engaged - wind
        if p.wobble_mm != 0.0:
            angle = 2.0 * pi * x / p.lead_mm + p.wobble_rad
            table += p.wobble_mm * (sin(angle) + 0.1 * sin(2.0 * angle))
        if p.scale_mm != 0.0:
            table += p.scale_mm * sin(2.0 * pi * table / p.scale_pitch_mm)
        if tick >= 0:
            out[0, tick], out[1, tick], out[2, tick] = x, torque, table
        heat += period / p.fade_s * ((torque / p.fade_a) ** 2 - heat)
        drive_n = p.newton_per_a * torque * (1.0 - p.fade * heat)
        viscous = p.viscous / (1.0 + p.warmup * warmth)
        if tick >= 0:
            warmth += period / p.warmup_s * (abs(v) * (p.coulomb_n + viscous * abs(v)) / p.warmup_w - warmth)
        for step in range(STEPS):
            held_n = force_n[now * STEPS + step]
            before = v
            extra_n = p.wait_n * (1.0 - exp(-rest_s / p.wait_s)) if p.wait_n != 0.0 else 0.0
            if tick * 0.001 < p.brake_until_s:
                extra_n += p.brake_n
                held_n -= p.brake_n * (1.0 if v > 0.0 else (-1.0 if v < 0.0 else 0.0))
            if p.bristle_n_per_mm > 0.0:
                x, v, z = _bent(p, x, v, z, viscous, extra_n, drive_n, held_n, h)
            elif v != 0.0:
                x, v = _slid(p, x, v, 1.0 if v > 0.0 else -1.0, viscous, extra_n, drive_n, held_n, h)
            else:
                push = _push_n(p, x, drive_n, held_n)
                direction = 1.0 if push > 0.0 else -1.0
                if abs(push) > _dry_n(p, x, 0.0, direction, extra_n):
                    x, v = _slid(p, x, 0.0, direction, viscous, extra_n, drive_n, held_n, h)
            rest_s = rest_s + h if v == 0.0 else max(0.0, rest_s - abs(v) * h / 0.02 * p.wait_s)
            engaged = min(max(engaged, x - 0.5 * p.play_mm), x + 0.5 * p.play_mm)
            if p.screw_n_per_mm > 0.0:
                through_n = drive_n - 0.0003 * p.mass_kg * (v - before) / h
                wind_speed += h * (
                    screw_rate * screw_rate * (through_n / p.screw_n_per_mm - wind) - 0.3 * screw_rate * wind_speed
                )
                wind += h * wind_speed
