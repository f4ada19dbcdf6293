"""Structures of controllers other than the nominal cascade: position by P, velocity by PI, no feed-forward.

A machine describes the nominal one whichever it has, so another one is a gap. Each is drawn as large as controls have it, which
may be hundreds of floors, and not scaled.
"""

from cnctwin.standins.reference_machine.effect import AXES, Chance, Effect, between

MOTION = ("air", "cut")


def _ticks(chance: Chance) -> dict[str, float]:
    return {"delay_s": 0.001 * float(chance.integers(1, 3))}


STRUCTURES = (
    Effect(
        "velocity_feedforward", AXES, MOTION, between(gain=(0.5, 0.95)), lambda _, t: t,
        lambda x, on, p: x.with_axis(on, velocity_forward=p["gain"]), in_controller=True,
    ),
    Effect(
        "acceleration_feedforward", AXES, MOTION, between(gain=(0.4, 1.0)), lambda _, t: t,
        lambda x, on, p: x.with_axis(on, acceleration_forward=p["gain"]), in_controller=True,
    ),
    Effect(
        "command_delay", AXES, MOTION, _ticks, lambda _, t: t,
        lambda x, on, p: x.with_axis(on, delay_s=p["delay_s"]), in_controller=True,
    ),
    Effect(
        "friction_compensation", AXES, MOTION, between(torque_a=(0.15, 0.5)), lambda _, t: t,
        lambda x, on, p: x.with_axis(on, compensation_a=p["torque_a"]), in_controller=True,
    ),
    Effect(
        "reference_filter", AXES, MOTION, between(time_constant_s=(0.003, 0.02)), lambda _, t: t,
        lambda x, on, p: x.with_axis(on, filter_s=p["time_constant_s"]), in_controller=True,
    ),
    Effect(
        "position_integral", AXES, MOTION, between(gain_per_s=(1.0, 6.0)), lambda _, t: t,
        lambda x, on, p: x.with_axis(on, outer_per_s=p["gain_per_s"]), in_controller=True,
    ),
)  # fmt: skip
