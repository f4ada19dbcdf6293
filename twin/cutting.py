"""Cutting force from what the control says about its spindle.

    F = P_cut / v_c,   P_cut = η · (load/100 · P_rated − P_idle),   v_c = π · D · n

It is the mean tangential force that would need this power at this speed. Known limits: 10 to 20 % off for a known material,
30 to 50 % in a job shop (then only the trend counts); while the spindle accelerates, the load is its inertia, not the cut.
"""

import math
from dataclasses import dataclass
from typing import NamedTuple


@dataclass(frozen=True, slots=True)
class SpindleDrive:
    """The drive: what 100 % load means, which part reaches the tool, and what it takes to turn in air.

    rated_power_kw: electrical power at 100 % load
    efficiency: mechanical over electrical power, 0 to 1
    idle_power_kw: electrical power without a cut
    spindle_rpm_min: below this speed, power over speed means nothing

    Raises ValueError where a figure is outside its range.
    """

    rated_power_kw: float
    efficiency: float
    idle_power_kw: float = 0.0
    spindle_rpm_min: float = 50.0

    def __post_init__(self) -> None:
        if not (math.isfinite(self.rated_power_kw) and self.rated_power_kw > 0):
            raise ValueError(f"rated_power_kw is {self.rated_power_kw!r}; it has to be more than 0")
        if not 0 < self.efficiency <= 1:
            raise ValueError(f"efficiency is {self.efficiency!r}; it has to be more than 0 and at most 1")
        if not 0 <= self.idle_power_kw < self.rated_power_kw:
            raise ValueError(f"idle_power_kw is {self.idle_power_kw!r}; it has to be from 0 to the rated power")
        if not (math.isfinite(self.spindle_rpm_min) and self.spindle_rpm_min > 0):
            raise ValueError(f"spindle_rpm_min is {self.spindle_rpm_min!r}; it has to be more than 0")


class CuttingForce(NamedTuple):
    """A force, or None with the reason why there is none."""

    force_n: float | None
    reason: str | None


def cutting_speed_m_s(tool_diameter_mm: float, spindle_rpm: float) -> float:
    """Speed of the cutting edge, m/s. A 20 mm tool at 3,000 rev/min turns 50 times a second on 62.83 mm:

    >>> round(cutting_speed_m_s(20.0, 3000.0), 4)
    3.1416
    """
    return math.pi * tool_diameter_mm * abs(spindle_rpm) / 60_000.0


def cutting_force(
    drive: SpindleDrive, spindle_load_pct: float | None, spindle_rpm: float | None, tool_diameter_mm: float | None
) -> CuttingForce:
    """Mean tangential cutting force, N; None with a reason where the inputs mean nothing.

    50 % of 10 kW at an efficiency of 0.8 are 4 kW; over 3.1416 m/s that makes 1273 N:

    >>> drive = SpindleDrive(rated_power_kw=10.0, efficiency=0.8)
    >>> round(cutting_force(drive, 50.0, 3000.0, 20.0).force_n)
    1273
    >>> cutting_force(drive, 50.0, 0.0, 20.0)
    CuttingForce(force_n=None, reason='spindle below 50 rev/min: power over speed means nothing')

    A load below the idle power is air, not a negative cut: the force is 0. Reasons hold no live figures, so that a reason
    is reported once and not at every change of a speed.
    """
    if spindle_load_pct is None or not math.isfinite(spindle_load_pct):
        return CuttingForce(None, "spindle load is missing")
    if spindle_load_pct < 0:
        return CuttingForce(None, "spindle load is negative: the spindle brakes")
    if spindle_rpm is None or not math.isfinite(spindle_rpm):
        return CuttingForce(None, "spindle speed is missing")
    if abs(spindle_rpm) < drive.spindle_rpm_min:
        return CuttingForce(None, f"spindle below {drive.spindle_rpm_min:g} rev/min: power over speed means nothing")
    if tool_diameter_mm is None or not math.isfinite(tool_diameter_mm) or tool_diameter_mm <= 0:
        return CuttingForce(None, "tool diameter is not known")
    power_kw = drive.efficiency * (spindle_load_pct / 100.0 * drive.rated_power_kw - drive.idle_power_kw)
    force_n = 1000.0 * (0.0 if power_kw < 0.0 else power_kw) / cutting_speed_m_s(tool_diameter_mm, spindle_rpm)
    if not math.isfinite(force_n):
        return CuttingForce(None, "spindle load is beyond any drive")
    return tuple.__new__(CuttingForce, (force_n, None))
