"""Feedback is stamped by another clock than the reference, one that is off and runs at another rate.

t_feedback = t − offset − ppm · 10⁻⁶ · t
"""

from twin.effects.effect import BuildsUp, Effect, On, Parameter
from twin.sites import Site


def feedback_time_s(feedback_time_s: float, time_s: float, ppm: float, offset_s: float) -> float:
    """The true time of the feedback that is stamped with the time of the reference."""
    return feedback_time_s - offset_s - 1e-6 * ppm * time_s


def late_s(time_s: float, ppm: float, offset_s: float) -> float:
    """Return by how much what is stamped is late."""
    return offset_s + 1e-6 * ppm * time_s


EFFECT = Effect(
    name="clock_drift",
    says="the feedback is stamped by another clock",
    site=Site.CLOCK,
    on=On.MACHINE,
    parameters=(
        Parameter("ppm", "ppm", 0.0, -2000.0, 2000.0, 100.0, "by which the clock of the feedback runs fast"),
        Parameter("offset_s", "s", 0.0, -5.0, 5.0, 0.01, "by which it is ahead at the start"),
    ),
    changes={"feedback_time_s": feedback_time_s},
    shows_in=("x_pos_mm", "y_pos_mm", "z_pos_mm", "x_torque_a", "y_torque_a", "z_torque_a"),
    late_s=late_s,
    builds_up=BuildsUp.WAITING,
    equation="t_feedback = t − offset − ppm 1e-6 t",
    reference="IEEE 1588-2019, syntonization and offset of clocks",
)
