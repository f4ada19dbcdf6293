"""The control as the effects of a machine change it: how long a program takes (site `program`).

Each quantity is a limit of the planner or a ratio of its speeds. An effect changes it by a plain function of numbers, as
everywhere (`twin.effects.effect`); a limit that there is not is infinite. Nothing is changed, bit for bit, at null values.
"""

from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from twin.effects.catalogue import effect_named
from twin.effects.effect import Effect
from twin.machine import MachineFile, Program
from twin.motion.limits import Limits, PerAxis
from twin.motion.path import Path
from twin.motion.plan import Override, Plan, plan
from twin.motion.quantity import change_of
from twin.sites import Site

Added = Mapping[str, Mapping[str, float]]
"""Name of an effect → its parameters."""
RAPID_MM_MIN = 30000.0
"""Rapid rate where nobody states one."""
LENGTH_OVER_FEED = Limits(rapid_mm_min=RAPID_MM_MIN, acceleration_mm_s2=np.inf)
"""No limit but the rapid rate: the time of a block is its length over its feed."""


@dataclass(frozen=True, slots=True)
class Control:
    """limits of the planner; feed_ratio, rapid_ratio: of the programmed feed and the rapid rate (1 = 100 %)."""

    limits: Limits
    feed_ratio: float = 1.0
    rapid_ratio: float = 1.0

    def plan(self, path: Path, feed_override: Override = 1.0, rapid_override: Override = 1.0) -> Plan:
        """The plan of `path` with the overrides of a run on top. Raises as `twin.motion.plan.plan` does."""
        return plan(path, self.limits, self.feed_ratio * feed_override, self.rapid_ratio * rapid_override)

    def plan_with(self, path: Path, feed_mm_min: NDArray[np.float64]) -> Plan:
        """The plan of `path` with other feeds, (segments,)."""
        return self.plan(replace(path, feed_mm_min=feed_mm_min))


def control_of(machine: MachineFile, unstated: Program) -> Control:
    """The control of a machine: [program] as stated and as its effects change it.

    A machine without [program] is planned with `unstated` where nothing is known of its control, and by length over feed where
    its effects tell.

    Raises EffectError where an effect is unknown or out of its bounds.
    """
    added = program_effects(machine)
    if machine.program is not None:
        return changed(Limits.of(machine.program), added)
    return changed(LENGTH_OVER_FEED if effects_tell(machine) else Limits.of(unstated), added)


def effects_tell(machine: MachineFile) -> bool:
    """Return True where an effect of the machine changes its control."""
    return any(not effect_named(name).is_null(values) for name, values in program_effects(machine).items())


def program_effects(machine: MachineFile) -> dict[str, Mapping[str, float]]:
    """The effects of a machine that act on the time of a program."""
    return {e.effect: e.parameters for e in machine.effects if effect_named(e.effect).site is Site.PROGRAM}


def changed(limits: Limits, added: Added) -> Control:
    """The control of these limits with these effects. Raises EffectError where a parameter is out of its bounds.

    >>> changed(LENGTH_OVER_FEED, {"tool_change_time": {"change_s": 4.0}, "feed_override": {"ratio": 0.5}}).limits.tool_change_s
    4.0
    """
    values: dict[str, PerAxis] = _stated(limits)
    stated = dict(values)
    for name, own in added.items():
        effect = effect_named(name)
        given = effect.checked(own)
        for quantity in effect.changes:
            values[quantity] = _change(effect, quantity, values[quantity], given)
    fields = {
        "acceleration_mm_s2": values["feed_acceleration_mm_s2"],
        "rapid_acceleration_mm_s2": values["rapid_acceleration_mm_s2"],
        "centripetal_mm_s2": _unless_same(values, stated, "across_acceleration_mm_s2", limits.centripetal_mm_s2),
        "corner_speed_difference_mm_min": values["corner_speed_difference_mm_min"],
        "in_position_s": values["in_position_s"],
        "block_time_s": values["block_time_s"],
        "tool_change_s": values["tool_change_s"],
        "spindle_acceleration_rpm_s": values["spindle_acceleration_rpm_s"],
        "spindle_deceleration_rpm_s": values["spindle_deceleration_rpm_s"],
        "spindle_base_rpm": values["spindle_base_rpm"],
        "rapid_waits_for_spindle": values["axes_wait"] == 1.0,
    }
    return Control(limits.with_(**fields), _number(values["feed_ratio"]), _number(values["rapid_ratio"]))


def _stated(limits: Limits) -> dict[str, PerAxis]:
    """Every quantity as the limits have it, what they leave open resolved as the planner does."""
    along = limits.acceleration_mm_s2
    least = min(along) if isinstance(along, tuple) else along
    down = limits.spindle_deceleration_rpm_s
    return {
        "feed_acceleration_mm_s2": along,
        "rapid_acceleration_mm_s2": along if limits.rapid_acceleration_mm_s2 is None else limits.rapid_acceleration_mm_s2,
        "across_acceleration_mm_s2": least if limits.centripetal_mm_s2 is None else limits.centripetal_mm_s2,
        "corner_speed_difference_mm_min": limits.corner_speed_difference_mm_min,
        "in_position_s": limits.in_position_s,
        "block_time_s": limits.block_time_s,
        "tool_change_s": limits.tool_change_s,
        "spindle_acceleration_rpm_s": limits.spindle_acceleration_rpm_s,
        "spindle_deceleration_rpm_s": limits.spindle_acceleration_rpm_s if down is None else down,
        "spindle_base_rpm": limits.spindle_base_rpm,
        "axes_wait": float(limits.rapid_waits_for_spindle),
        "feed_ratio": 1.0,
        "rapid_ratio": 1.0,
    }


def _change(effect: Effect, quantity: str, value: PerAxis, given: Mapping[str, float]) -> PerAxis:
    if isinstance(value, tuple):
        return tuple(change_of(effect, quantity, one, given) for one in value)
    return change_of(effect, quantity, value, given)


def _number(value: object) -> float:
    assert isinstance(value, float | int), "a quantity of the control is one number"
    return float(value)


def _unless_same(
    values: Mapping[str, PerAxis], stated: Mapping[str, PerAxis], quantity: str, otherwise: float | None
) -> PerAxis | None:
    """Return a quantity as an effect left it; untouched, it stays as the planner resolves it."""
    return otherwise if values[quantity] == stated[quantity] else values[quantity]


QUANTITIES = tuple(_stated(LENGTH_OVER_FEED))
"""The quantities that an effect at the site `program` can change."""
