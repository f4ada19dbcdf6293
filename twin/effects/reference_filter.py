"""The control smooths its reference by a first-order lag, so that the loop follows a rounder motion than was commanded.

    ref_seen(k) = ref(k) − τ / (τ + T) · (ref(k) − ref_seen(k − 1))

On an even motion it is late by τ, like a delay; where the motion changes it rounds, which a delay does not.
"""

from twin.effects.effect import Effect, On, Parameter
from twin.sites import Site


def reference_mm(reference_mm: float, previous_reference_mm: float, period_s: float, time_constant_s: float) -> float:
    """The reference after the lag; the one before is the lagged one too."""
    return reference_mm - time_constant_s / (time_constant_s + period_s) * (reference_mm - previous_reference_mm)


EFFECT = Effect(
    name="reference_filter",
    says="the control smooths the reference of {on}",
    site=Site.REFERENCE,
    on=On.AXIS,
    parameters=(Parameter("time_constant_s", "s", 0.0, 0.0, 0.1, 0.005, "of the lag"),),
    changes={"reference_mm": reference_mm},
    shows_in=("{a}_torque_a", "{a}_pos_mm"),
    shows_only_fast=True,
    equation="ref_seen = ref − τ/(τ + T) (ref − ref_seen_previous)",
    reference="Altintas 2012, Manufacturing Automation, 2nd ed., section 5.4: filters of the commanded trajectory",
)
