"""Viscous friction that falls as the axis warms up: the grease and oil of nut and guideway.

    μ(t) = μ (1 − decay · (1 − exp(−t / τ)))

Time runs from the start of the recording, at which the axis is taken to be cold.
"""

from twin.effects.effect import BuildsUp, Effect, On, Parameter
from twin.kernels.elementary import exp_of_minus
from twin.sites import Site


def viscous_n_s_per_mm(viscous_n_s_per_mm: float, time_s: float, decay: float, time_constant_s: float) -> float:
    """The viscous coefficient at the time."""
    return viscous_n_s_per_mm * (1.0 - decay * (1.0 - exp_of_minus(time_s / time_constant_s)))


EFFECT = Effect(
    name="viscous_warmup",
    says="friction of {on} falls as it warms",
    site=Site.FRICTION,
    on=On.AXIS,
    parameters=(
        Parameter("decay", "", 0.0, -0.9, 0.9, 0.3, "part of the viscous friction that is gone when warm"),
        Parameter("time_constant_s", "s", None, 0.5, 36000.0, 20.0, "time after which 63 % of that is gone"),
    ),
    changes={"viscous_n_s_per_mm": viscous_n_s_per_mm},
    shows_in=("{a}_torque_a", "{a}_pos_mm"),
    far_from_linear=True,
    likely_in={"constant speed": 4, "rapid": 3},
    builds_up=BuildsUp.MOTION,
    equation="mu(t) = mu (1 − decay (1 − exp(−t/tau)))",
    reference="Altintas, Verl, Brecher, Uriarte, Pritschow 2011, CIRP Annals 60(2), section on friction",
)
