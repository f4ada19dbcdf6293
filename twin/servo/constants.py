"""The constants of an axis as its physics takes them, from `machine.toml`."""

from collections.abc import Mapping

from twin.effects.effect import Effect
from twin.errors import EffectError
from twin.machine import Axis, by_side


def axis_constants(axis: Axis) -> dict[str, float]:
    """Name → value, for the physics of `twin.servo`; the lead is NaN where the machine does not state it.

    Friction is split by direction, and the Stribeck velocity comes as its inverse:

    >>> from twin.machine import Friction
    >>> friction = Friction(coulomb_n=(20.0, 24.0), static_n=30.0, stribeck_velocity_mm_s=5.0)
    >>> axis = Axis(mass_kg=95.0, force_per_command_n=35.0, position_gain_per_s=160.0, velocity_gain_a_s_per_mm=0.24,
    ...             torque_limit_a=10.0, friction=friction)
    >>> constants = axis_constants(axis)
    >>> constants["coulomb_minus_n"], constants["coulomb_plus_n"], constants["stribeck_plus_s_per_mm"]
    (20.0, 24.0, 0.2)
    """
    friction = axis.friction
    return {
        "mass_kg": axis.mass_kg,
        "newton_per_command": axis.newton_per_command,
        "screw_lead_mm": axis.screw_lead_mm or float("nan"),
        "position_gain_per_s": axis.position_gain_per_s,
        "velocity_gain_a_s_per_mm": axis.velocity_gain_a_s_per_mm,
        "velocity_integral_gain_a_per_mm": axis.velocity_integral_gain_a_per_mm,
        "torque_limit_a": axis.torque_limit_a,
        "coulomb_minus_n": by_side(friction.coulomb_n, 0),
        "coulomb_plus_n": by_side(friction.coulomb_n, 1),
        "static_minus_n": by_side(friction.static_n, 0),
        "static_plus_n": by_side(friction.static_n, 1),
        "stribeck_minus_s_per_mm": 1.0 / by_side(friction.stribeck_velocity_mm_s, 0),
        "stribeck_plus_s_per_mm": 1.0 / by_side(friction.stribeck_velocity_mm_s, 1),
        "viscous_minus_n_s_per_mm": by_side(friction.viscous_n_s_per_mm, 0),
        "viscous_plus_n_s_per_mm": by_side(friction.viscous_n_s_per_mm, 1),
    }


def effect_constants(effect: Effect, values: Mapping[str, float], axis: Mapping[str, float], on: str) -> dict[str, float]:
    """The parameters of an effect under the names that its woven text takes, `effect__parameter`.

    Raises EffectError where a parameter is out of bounds, or the axis does not state what the effect needs.
    """
    for name in effect.needs:
        if name in axis and axis[name] != axis[name]:
            raise EffectError(f"{effect.name} on {on} needs {name}, which the machine does not state")
    return {f"{effect.name}__{name}": value for name, value in effect.checked(values).items()}
