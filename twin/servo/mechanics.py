"""The moving mass between two ticks: drive force, friction, and whatever else pulls at it (formats, section 4).

    M dv/dt = F_drive + F_external − F_friction(v)

A step is linearly implicit and of second order (Rosenbrock's form of the midpoint rule: the slope of the friction law enters the
mass). A stop within the step is taken at its own time, so that sticking is true sticking: v is 0, not small. On the recorded
cases one step a tick of 1 ms stays within 0.05 µm of sixty-four steps; a plain Euler step is off by 2 µm.

With a compliance, the contact is a bristle before it slides (Dahl 1968; the form of Canudas de Wit et al. 1995 without damping):

    dz/dt = v (1 − z sgn(v) / (c F)),   F_friction = z / c

z and v are solved together by the implicit midpoint rule, F_friction = (z + h v̄ / 2) / (c + h |v̄| / 2F), with F and |v̄| at the
mean speed v̄ by two fixed-point steps. The nominal contact is rigid.
"""

from typing import NamedTuple

from twin.sites import Site, at


class Forces(NamedTuple):
    """The forces on the mass before friction, and the mass."""

    moving_mass_kg: float
    midpoint_mm: float
    drive_force_n: float
    force_n: float


def forces(
    torque_a: float,
    disturbance_n: float,
    position_mm: float,
    velocity_mm_s: float,
    step_s: float,
    mass_kg: float,
    newton_per_command: float,
) -> Forces:
    """Forces of a step under a held torque and a held disturbance (N, positive resists motion in +).

    2 A at 628 N/A against 100 N: 1156 N:

    >>> forces(2.0, 100.0, 0.0, 0.0, 0.001, 320.0, 628.0).force_n
    1156.0
    """
    moving_mass_kg = at(Site.MECHANICS, mass_kg)
    midpoint_mm = position_mm + 0.5 * step_s * velocity_mm_s
    drive_force_n = at(Site.DRIVE_FORCE, newton_per_command * torque_a)
    external_force_n = at(Site.MECHANICS, -disturbance_n)
    force_n = drive_force_n + external_force_n
    return Forces(moving_mass_kg, midpoint_mm, drive_force_n, force_n)


class Motion(NamedTuple):
    """The position and speed of the mass at the end of a step."""

    position_next_mm: float
    velocity_next_mm_s: float


def slide(
    position_mm: float,
    velocity_mm_s: float,
    step_s: float,
    moving_mass_kg: float,
    force_n: float,
    push: float,
    breakaway_n: float,
    direction: float,
    friction_n: float,
    slope_n_s_per_mm: float,
) -> Motion:
    """One step on a rigid contact.

    100 N of 1,100 N are left over on 100 kg for 1 ms: 1 mm/s and 0.5 µm. A push below the breakaway force moves nothing.

    >>> slide(0.0, 0.0, 0.001, 100.0, 1100.0, 1.0, 1000.0, 1.0, 1000.0, 0.0)
    Motion(position_next_mm=0.0005, velocity_next_mm_s=1.0)
    >>> slide(7.0, 0.0, 0.001, 100.0, 999.0, 1.0, 1000.0, 1.0, 1000.0, 0.0)
    Motion(position_next_mm=7.0, velocity_next_mm_s=0.0)
    """
    inertia_kg = moving_mass_kg + 500.0 * step_s * slope_n_s_per_mm
    inertia_kg = inertia_kg if inertia_kg > 0.5 * moving_mass_kg else 0.5 * moving_mass_kg
    mobility_mm_s2_per_n = 1000.0 / inertia_kg
    acceleration_mm_s2 = (force_n - direction * friction_n) * mobility_mm_s2_per_n
    velocity_next_mm_s = velocity_mm_s + step_s * acceleration_mm_s2
    travel_mm = 0.5 * step_s * (velocity_mm_s + velocity_next_mm_s)

    stops = velocity_next_mm_s * direction < 0.0
    stop_s = velocity_mm_s / (-acceleration_mm_s2 if stops else 1.0)
    rest_s = step_s - stop_s
    excess_n = force_n * push - breakaway_n
    push_mm_s2 = push * (excess_n if excess_n > 0.0 else 0.0) * mobility_mm_s2_per_n
    velocity_next_mm_s = push_mm_s2 * rest_s if stops else velocity_next_mm_s
    travel_mm = 0.5 * (velocity_mm_s * stop_s + push_mm_s2 * rest_s * rest_s) if stops else travel_mm

    sticks = (velocity_mm_s == 0.0) & (excess_n <= 0.0)
    velocity_next_mm_s = 0.0 if sticks else velocity_next_mm_s
    travel_mm = 0.0 if sticks else travel_mm
    position_next_mm = position_mm + travel_mm
    return Motion(position_next_mm, velocity_next_mm_s)


class Arrival(NamedTuple):
    """The end of a step on a rigid contact."""

    position_mm: float
    velocity_mm_s: float


def arrive(position_next_mm: float, velocity_next_mm_s: float) -> Arrival:
    """Ends a step on a rigid contact, the nominal one."""
    position_mm = position_next_mm
    velocity_mm_s = velocity_next_mm_s
    return Arrival(position_mm, velocity_mm_s)


class BristleMotion(NamedTuple):
    """As Motion, with the bending of the bristles."""

    position_mm: float
    velocity_mm_s: float
    bristle_mm: float


def bend(
    position_mm: float,
    velocity_mm_s: float,
    bristle_mm: float,
    position_next_mm: float,
    velocity_next_mm_s: float,
    step_s: float,
    moving_mass_kg: float,
    force_n: float,
    direction: float,
    speed_mm_s: float,
    friction_n: float,
    viscous_n: float,
    viscous_n_s_per_mm: float,
    slope_n_s_per_mm: float,
) -> BristleMotion:
    """Ends a step, bent where the contact has a compliance, and else on the rigid contact, unchanged.

    >>> bend(0.0, 0.0, 0.0, 0.0005, 1.0, 0.001, 100.0, 1100.0, 1.0, 0.0, 1000.0, 0.0, 0.0, 0.0)
    BristleMotion(position_mm=0.0005, velocity_mm_s=1.0, bristle_mm=0.0)
    """
    bristle_compliance_mm_per_n = at(Site.FRICTION, 0.0)
    compliant = bristle_compliance_mm_per_n > 0.0
    dry_n = friction_n - viscous_n if compliant else 1.0
    dry_slope_n_s_per_mm = slope_n_s_per_mm - viscous_n_s_per_mm
    half_impulse = 500.0 * step_s / moving_mass_kg
    wear = 0.5 * half_impulse * step_s

    push_n = force_n - direction * viscous_n
    give = bristle_compliance_mm_per_n + 0.5 * step_s * speed_mm_s / dry_n if compliant else 1.0
    mean_mm_s = (velocity_mm_s * give + half_impulse * (push_n * give - bristle_mm)) / (give + wear)

    push_n = force_n - viscous_n_s_per_mm * mean_mm_s
    mean_dry_n = dry_n + dry_slope_n_s_per_mm * (abs(mean_mm_s) - speed_mm_s)
    give = bristle_compliance_mm_per_n + 0.5 * step_s * abs(mean_mm_s) / mean_dry_n if compliant else 1.0
    mean_mm_s = (velocity_mm_s * give + half_impulse * (push_n * give - bristle_mm)) / (give + wear)

    push_n = force_n - viscous_n_s_per_mm * mean_mm_s
    mean_dry_n = dry_n + dry_slope_n_s_per_mm * (abs(mean_mm_s) - speed_mm_s)
    give = bristle_compliance_mm_per_n + 0.5 * step_s * abs(mean_mm_s) / mean_dry_n if compliant else 1.0
    mean_mm_s = (velocity_mm_s * give + half_impulse * (push_n * give - bristle_mm)) / (give + wear)
    give = bristle_compliance_mm_per_n + 0.5 * step_s * abs(mean_mm_s) / mean_dry_n if compliant else 1.0
    bristle_mm = bristle_compliance_mm_per_n * (2.0 * bristle_mm + step_s * mean_mm_s) / give - bristle_mm

    position_mm = position_mm + step_s * mean_mm_s if compliant else position_next_mm
    velocity_mm_s = 2.0 * mean_mm_s - velocity_mm_s if compliant else velocity_next_mm_s
    return BristleMotion(position_mm, velocity_mm_s, bristle_mm)
