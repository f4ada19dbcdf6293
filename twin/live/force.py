"""The cutting force that the shown load of a spindle stands for.

    F = P_cut / (π D n),   P_cut = the power at which the machine's meter shows this load        (twin/live/spindle.py)

It is the mean tangential force that would need this power at this speed. Known limits: 10 to 20 % off for a known material, 30 to
50 % in a job shop (then only the trend counts).
"""

import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import NamedTuple, Self

from twin.live.spindle import LiveSpindle, mean_tangential_n
from twin.machine import MachineFile

SPINDLE_RPM_MIN = 50.0
FORCE_N_MAX = 1e12
TELLS_NOTHING = "spindle load says nothing of the cut: no power of a cut shows it on this meter"


class CuttingForce(NamedTuple):
    """A force, or None with the reason why there is none. Reasons hold no live figures: each new one is published."""

    force_n: float | None
    reason: str | None


class ToolUsed(NamedTuple):
    """The tool that a force is on. number: empty for one that stands for any; diameter_mm None: `reason` says why"""

    number: str
    diameter_mm: float | None
    reason: str | None = None


@dataclass(frozen=True, slots=True, eq=False)
class LiveForce:
    """The force by spindle power of a machine.

    diameters_mm: by tool number; other_mm: of any tool that is not listed, None = not known
    spindle_rpm_min: below this speed, power over speed means nothing
    """

    spindle: LiveSpindle
    diameters_mm: Mapping[str, float]
    other_mm: float | None
    spindle_rpm_min: float = SPINDLE_RPM_MIN

    @classmethod
    def of(cls, machine: MachineFile, spindle_rpm_min: float = SPINDLE_RPM_MIN) -> Self:
        """Return the force of a described machine. Raises MachineError where it has no [spindle]."""
        diameters = {number: tool.diameter_mm for number, tool in machine.tools.items()}
        other = None if machine.tool is None else machine.tool.diameter_mm
        return cls(LiveSpindle.of(machine), diameters, other, spindle_rpm_min)

    def tool(self, number: float | None) -> ToolUsed:
        """Return the tool of this number, None = the control tells none."""
        named = "" if number is None else f"{number:.0f}"
        if named in self.diameters_mm:
            return tuple.__new__(ToolUsed, (named, self.diameters_mm[named], None))
        if self.other_mm is not None:
            return tuple.__new__(ToolUsed, ("", self.other_mm, None))
        if not self.diameters_mm:
            return ToolUsed("", None, "tool diameter is not known")
        if number is not None:
            return ToolUsed("", None, f"tool {named} is not described: it has no [tools.{named}]")
        if len(self.diameters_mm) == 1:
            return ToolUsed(*next(iter(self.diameters_mm.items())))
        return ToolUsed("", None, "the machine has several tools, and no tool_number says which one it is")

    def force(self, load_pct: float | None, rpm: float | None, diameter_mm: float | None) -> CuttingForce:
        """Return the mean tangential force, N; None with a reason where the inputs mean nothing.

        50 % of the 15 kW that are assumed, at an efficiency of 0.85, are 6.375 kW; at 3.1416 m/s that makes 2029 N:

        >>> from twin.live.assumed import completed
        >>> from twin.machine import Machine
        >>> force = LiveForce.of(completed(MachineFile(machine=Machine(name="vmc")), "spindle"))
        >>> round(force.force(50.0, 3000.0, 20.0).force_n)
        2029
        >>> force.force(50.0, 0.0, 20.0)
        CuttingForce(force_n=None, reason='spindle below 50 rev/min: power over speed means nothing')

        A load of air, or less, is no negative cut: the force is 0.
        """
        if load_pct is None or not math.isfinite(load_pct):
            return CuttingForce(None, "spindle load is missing")
        if load_pct < 0:
            return CuttingForce(None, "spindle load is negative: the spindle brakes")
        if rpm is None or not math.isfinite(rpm):
            return CuttingForce(None, "spindle speed is missing")
        if abs(rpm) < self.spindle_rpm_min:
            return CuttingForce(None, f"spindle below {self.spindle_rpm_min:g} rev/min: power over speed means nothing")
        if diameter_mm is None or not math.isfinite(diameter_mm) or diameter_mm <= 0:
            return CuttingForce(None, "tool diameter is not known")
        power_kw = self.spindle.cutting_power_kw(load_pct, rpm)
        if power_kw is None:
            return CuttingForce(None, TELLS_NOTHING)
        force_n = mean_tangential_n(power_kw, diameter_mm, rpm)
        if not force_n <= FORCE_N_MAX:
            return CuttingForce(None, "spindle load is beyond any drive")
        return tuple.__new__(CuttingForce, (force_n, None))
