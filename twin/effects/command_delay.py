"""The loop sees the reference late: interpolation, a bus, a filter of dead time.

ref_seen(t) = ref(t − delay)
"""

from twin.effects.effect import Effect, On, Parameter
from twin.sites import Site


def reference_time_s(reference_time_s: float, delay_s: float) -> float:
    """The time of the reference that is seen."""
    return reference_time_s - delay_s


def late_s(delay_s: float) -> float:
    """Return by how much the reference is late."""
    return delay_s


EFFECT = Effect(
    name="command_delay",
    says="{on} is commanded late",
    site=Site.REFERENCE,
    on=On.AXIS,
    parameters=(Parameter("delay_s", "s", 0.0, 0.0, 0.05, 0.002, "age of the reference in the loop"),),
    changes={"reference_time_s": reference_time_s},
    shows_in=("{a}_torque_a", "{a}_pos_mm"),
    late_s=late_s,
    equation="ref_seen(t) = ref(t − delay)",
    reference="FANUC AC servo parameter manual B-65270EN, interpolation period and position-loop delay",
)
