"""A tool change takes time, from chip to chip: the spindle stops, the tool is changed, the spindle runs up before axes go on.

t = |Δτ| / α_down + (t_stated + t_change) + |Δτ| / α_up,   τ(ω) = ω up to ω_b, ω_b + (ω² − ω_b²) / (2 ω_b) above (constant power)
"""

from math import inf, isinf

from twin.effects.effect import Effect, Excitation, On, Parameter
from twin.sites import Site


def tool_change_s(stated_s: float, change_s: float) -> float:
    """From the stopped spindle to the tool in it."""
    return stated_s + change_s


def spindle_acceleration_rpm_s(stated_rpm_s: float, up_rpm_s: float) -> float:
    """The lower one."""
    return min(stated_rpm_s, up_rpm_s)


def spindle_deceleration_rpm_s(stated_rpm_s: float, down_rpm_s: float) -> float:
    """The lower one."""
    return min(stated_rpm_s, down_rpm_s)


def spindle_base_rpm(stated_rpm: float, up_rpm_s: float, down_rpm_s: float, base_rpm: float) -> float:
    """Return the speed at which a spindle that takes its time comes to constant power."""
    return stated_rpm if isinf(up_rpm_s) and isinf(down_rpm_s) else min(stated_rpm, base_rpm)


def axes_wait(stated: float, up_rpm_s: float) -> float:
    """1 = axes wait until the spindle has its speed, in rapid too: only then is there a chip again."""
    return stated if isinf(up_rpm_s) else 1.0


EFFECT = Effect(
    name="tool_change_time",
    says="a tool change takes longer",
    site=Site.PROGRAM,
    on=On.MACHINE,
    parameters=(
        Parameter("change_s", "s", 0.0, 0.0, 300.0, 5.0, "from the stopped spindle to the tool in it, beyond what is stated"),
        Parameter("up_rpm_s", "rev/min/s", inf, 50.0, 1e6, 4000.0, "acceleration of the spindle"),
        Parameter("down_rpm_s", "rev/min/s", inf, 50.0, 1e6, 4000.0, "deceleration of the spindle"),
        Parameter("base_rpm", "rev/min", None, 100.0, 30000.0, 3000.0, "above it the spindle has constant power"),
    ),
    changes={
        "tool_change_s": tool_change_s,
        "spindle_acceleration_rpm_s": spindle_acceleration_rpm_s,
        "spindle_deceleration_rpm_s": spindle_deceleration_rpm_s,
        "spindle_base_rpm": spindle_base_rpm,
        "axes_wait": axes_wait,
    },
    shows_in=("line", "tool_number", "tool_change_active"),
    excited_by=Excitation.TOOL_CHANGES,
    equation="t = Δτ/α_down + t_stated + t_change + Δτ/α_up; τ = ω up to ω_b, ω_b + (ω² − ω_b²)/(2 ω_b) above",
    reference="chip-to-chip time, VDI 2852-1; ISO 10791-9:2001, operating times of tool change",
)
