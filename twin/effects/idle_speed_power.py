"""Idle power that grows with the speed: bearings, seals, belts, windage.

P_idle(n) = P_idle + power · (n / 5,000 rev/min)^exponent

The power is stated amid the range of machining spindles, so that the exponent is only the slope.
"""

from twin.effects.effect import Effect, On, Parameter
from twin.sites import Site


def idle_power_kw(idle_power_kw: float, spindle_rpm: float, exponent: float, power_kw: float) -> float:
    """The idle power at this speed, of either sense."""
    speed_rpm = spindle_rpm if spindle_rpm > 0.0 else -spindle_rpm
    return idle_power_kw + power_kw * (speed_rpm / 5000.0) ** exponent if speed_rpm > 0.0 else idle_power_kw


EFFECT = Effect(
    name="idle_speed_power",
    says="idle power grows with the speed",
    site=Site.SPINDLE,
    on=On.MACHINE,
    parameters=(
        Parameter("exponent", "", None, 0.3, 4.0, 2.0, "1 = a constant torque, 2 = viscous, 3 = windage"),
        Parameter("power_kw", "kW", 0.0, 0.0, 20.0, 0.3, "what turning at 5,000 rev/min takes beyond the stated idle power"),
    ),
    changes={"idle_power_kw": idle_power_kw},
    shows_in=("spindle_load_pct",),
    equation="P_idle(n) = P_idle + power (n / 5,000 rev/min)^exponent",
    reference="Palmgren's bearing friction torque: constant and growing with a power of the speed",
)
