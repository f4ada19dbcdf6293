"""The servo loops at a tick: P position loop around a PI velocity loop (formats, section 4).

    v_cmd = K_p (ref − pos),  e = v_cmd − v,  integral += K_i e T,  torque = K_v e + integral

Integral and torque are clamped to the torque limit, and the torque is held until the next tick.
"""

from typing import NamedTuple

from twin.sites import Site, at


class ReferenceMotion(NamedTuple):
    """The motion of the reference, by backward differences, as a control that feeds it forward sees it."""

    reference_velocity_mm_s: float
    reference_acceleration_mm_s2: float


def reference_motion(
    reference_mm: float, previous_reference_mm: float, previous_reference_velocity_mm_s: float, period_s: float
) -> ReferenceMotion:
    """Velocity and acceleration of the reference. From 0 to 0.1 mm in 1 ms: 100 mm/s, 100,000 mm/s².

    >>> reference_motion(0.1, 0.0, 0.0, 0.001)
    ReferenceMotion(reference_velocity_mm_s=100.0, reference_acceleration_mm_s2=100000.0)
    """
    reference_mm = at(Site.REFERENCE, reference_mm)
    reference_velocity_mm_s = (reference_mm - previous_reference_mm) / period_s
    reference_acceleration_mm_s2 = (reference_velocity_mm_s - previous_reference_velocity_mm_s) / period_s
    return ReferenceMotion(reference_velocity_mm_s, reference_acceleration_mm_s2)


class ControllerState(NamedTuple):
    """The output and the memory of the control."""

    following_error_mm: float
    integral_a: float
    torque_a: float


def control(
    reference_mm: float,
    position_mm: float,
    velocity_mm_s: float,
    integral_a: float,
    position_gain_per_s: float,
    velocity_gain_a_s_per_mm: float,
    velocity_integral_gain_a_per_mm: float,
    torque_limit_a: float,
    period_s: float,
) -> ControllerState:
    """One tick; torque in A, or in the drive's own unit.

    1 mm behind at standstill, K_p = 40 /s, K_v = 0.3 A·s/mm, K_i = 9 A/mm, T = 1 ms: v_cmd = 40 mm/s, integral = 0.36 A,
    torque = 12.36 A:

    >>> control(1.0, 0.0, 0.0, 0.0, 40.0, 0.3, 9.0, 60.0, 0.001).torque_a
    12.36
    """
    velocity_feedback_mm_s = at(Site.CONTROLLER, velocity_mm_s)
    following_error_mm = reference_mm - position_mm
    position_gain_per_s = at(Site.CONTROLLER, position_gain_per_s)
    velocity_gain_a_s_per_mm = at(Site.CONTROLLER, velocity_gain_a_s_per_mm)
    velocity_integral_gain_a_per_mm = at(Site.CONTROLLER, velocity_integral_gain_a_per_mm)
    torque_limit_a = at(Site.CONTROLLER, torque_limit_a)
    velocity_command_mm_s = at(Site.CONTROLLER, position_gain_per_s * following_error_mm)
    velocity_error_mm_s = velocity_command_mm_s - velocity_feedback_mm_s
    integral_a = integral_a + velocity_integral_gain_a_per_mm * velocity_error_mm_s * period_s
    integral_a = torque_limit_a if integral_a > torque_limit_a else integral_a
    integral_a = -torque_limit_a if integral_a < -torque_limit_a else integral_a
    torque_command_a = at(Site.CONTROLLER, velocity_gain_a_s_per_mm * velocity_error_mm_s + integral_a)
    torque_command_a = torque_limit_a if torque_command_a > torque_limit_a else torque_command_a
    torque_command_a = -torque_limit_a if torque_command_a < -torque_limit_a else torque_command_a
    torque_a = at(Site.DRIVE_FORCE, torque_command_a)
    return ControllerState(following_error_mm, integral_a, torque_a)


class Remembered(NamedTuple):
    """The values that the next tick takes differences against."""

    previous_reference_mm: float
    previous_reference_velocity_mm_s: float


def remember(reference_mm: float, reference_velocity_mm_s: float) -> Remembered:
    """Ends a tick."""
    previous_reference_mm = reference_mm
    previous_reference_velocity_mm_s = reference_velocity_mm_s
    return Remembered(previous_reference_mm, previous_reference_velocity_mm_s)
