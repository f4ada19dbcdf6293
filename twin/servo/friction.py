"""Set-valued friction with a Stribeck curve (formats, section 4).

    F_friction = sgn(v) [F_c + (F_s − F_c) exp(−(v/v_s)²)] + μ v,   and at rest whatever keeps it there, up to F_s

Each constant has a figure for either direction of motion.
"""

from math import copysign
from typing import NamedTuple

from twin.kernels.elementary import exp_of_minus
from twin.sites import Site, at


class Breakaway(NamedTuple):
    """The breakaway from rest: the direction in which the axis is pushed (+1, −1), and the force that it takes, N."""

    push: float
    breakaway_n: float


def breakaway(force_n: float, static_minus_n: float, static_plus_n: float) -> Breakaway:
    """Static friction in the direction of the push.

    >>> breakaway(-30.0, 520.0, 500.0)
    Breakaway(push=-1.0, breakaway_n=520.0)
    """
    direction = copysign(1.0, force_n)
    breakaway_n = at(Site.FRICTION, static_plus_n if direction > 0.0 else static_minus_n)
    push = direction
    return Breakaway(push, breakaway_n)


class Sliding(NamedTuple):
    """Friction of a moving axis: direction (+1, −1), speed, viscous part, whole magnitude, and its slope over the speed."""

    direction: float
    speed_mm_s: float
    viscous_n: float
    friction_n: float
    slope_n_s_per_mm: float


def sliding(
    push: float,
    velocity_mm_s: float,
    coulomb_minus_n: float,
    coulomb_plus_n: float,
    static_minus_n: float,
    static_plus_n: float,
    stribeck_minus_s_per_mm: float,
    stribeck_plus_s_per_mm: float,
    viscous_minus_n_s_per_mm: float,
    viscous_plus_n_s_per_mm: float,
) -> Sliding:
    """Friction at the velocity; from rest, that of a motion that starts in the direction of the push.

    The Stribeck velocity comes as its inverse, 1 / v_s, which spares a division at each step.

    Far above the Stribeck velocity, 380 N and 2.4 N·s/mm · 100 mm/s = 620 N:

    >>> round(sliding(1.0, 100.0, 380.0, 380.0, 520.0, 520.0, 0.2, 0.2, 2.4, 2.4).friction_n, 9)
    620.0
    """
    direction = copysign(1.0, push if velocity_mm_s == 0.0 else velocity_mm_s)
    speed_mm_s = velocity_mm_s * direction
    coulomb_n = coulomb_plus_n if direction > 0.0 else coulomb_minus_n
    static_n = static_plus_n if direction > 0.0 else static_minus_n
    stribeck_s_per_mm = stribeck_plus_s_per_mm if direction > 0.0 else stribeck_minus_s_per_mm
    speed_ratio = speed_mm_s * stribeck_s_per_mm
    stribeck_n = (static_n - coulomb_n) * exp_of_minus(speed_ratio * speed_ratio)
    viscous_n_s_per_mm = at(Site.FRICTION, viscous_plus_n_s_per_mm if direction > 0.0 else viscous_minus_n_s_per_mm)
    viscous_n = viscous_n_s_per_mm * speed_mm_s
    friction_n = at(Site.FRICTION, coulomb_n + stribeck_n + viscous_n)
    slope_n_s_per_mm = viscous_n_s_per_mm - 2.0 * speed_ratio * stribeck_s_per_mm * stribeck_n
    return Sliding(direction, speed_mm_s, viscous_n, friction_n, slope_n_s_per_mm)
