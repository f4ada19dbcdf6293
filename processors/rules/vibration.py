"""Rule on vibration: the zone of the velocity, rms over 10 to 1000 Hz, as ISO 20816 and the ISO 10816 before it define zones.

    A newly commissioned · B fit for unrestricted long-term operation · C not fit for long-term continuous operation ·
    D severe enough to damage the machine

Boundaries A/B, B/C, C/D in mm/s, by class or group:
ISO 10816-1:1995, table B.1: I small machines, to 15 kW; II medium ones, 15 to 75 kW without special foundations; III large ones
on rigid and heavy, IV on soft foundations. ISO 10816-3:2009, which ISO 20816-3:2022 has replaced: group 1 above 300 kW, group 2
15 to 300 kW, on a rigid or flexible support; published copies of these differ in places, so check them against your own.
Neither is meant for a spindle in the cut. ISO/TR 17243 is for machine-tool spindles, and is judged without cutting; its limits
are not here. Where you have a figure for your spindle, configure it.
"""

from bisect import bisect_left, bisect_right
from enum import Enum
from functools import cached_property
from typing import Self

from pydantic import Field, NonNegativeFloat, PositiveFloat, model_validator

from processors.config import ProcessorConfig
from processors.rules.alarm import EXCUSED, UNDER, Judgement, over, unknown
from processors.rules.spindle import Known, Motion
from processors.sample import Sample
from twin.vocabulary.twin_signals import VIBRATION_VELOCITY_MM_S

VELOCITY = "vibration_velocity_mm_s"
SOURCES = (VELOCITY, VIBRATION_VELOCITY_MM_S)
"""The edge's figure; else that of processor `vibration`."""
VELOCITY_MM_S_MAX = 1000.0
STANDS = "the spindle stands still"
RAMPS = "the spindle changes its speed"
NOT_OFFERED = f"neither {SOURCES[0]} nor {SOURCES[1]} is offered"


class VibrationClass(Enum):
    """A row of boundaries; see the module."""

    CLASS_1 = "iso_10816_1_class_1"
    CLASS_2 = "iso_10816_1_class_2"
    CLASS_3 = "iso_10816_1_class_3"
    CLASS_4 = "iso_10816_1_class_4"
    GROUP_1_RIGID = "iso_10816_3_group_1_rigid"
    GROUP_1_FLEXIBLE = "iso_10816_3_group_1_flexible"
    GROUP_2_RIGID = "iso_10816_3_group_2_rigid"
    GROUP_2_FLEXIBLE = "iso_10816_3_group_2_flexible"


class Zone(Enum):
    """The zones from good to bad."""

    A = "A"
    B = "B"
    C = "C"
    D = "D"


ZONES = tuple(Zone)
BOUNDARIES_MM_S: dict[VibrationClass, tuple[float, float, float]] = {
    VibrationClass.CLASS_1: (0.71, 1.8, 4.5),
    VibrationClass.CLASS_2: (1.12, 2.8, 7.1),
    VibrationClass.CLASS_3: (1.8, 4.5, 11.2),
    VibrationClass.CLASS_4: (2.8, 7.1, 18.0),
    VibrationClass.GROUP_1_RIGID: (2.3, 4.5, 7.1),
    VibrationClass.GROUP_1_FLEXIBLE: (3.5, 7.1, 11.0),
    VibrationClass.GROUP_2_RIGID: (1.4, 2.8, 4.5),
    VibrationClass.GROUP_2_FLEXIBLE: (2.3, 4.5, 7.1),
}


class VibrationLimits(ProcessorConfig):
    """The boundaries that hold, and the zone from which on it is an alarm.

    vibration_boundaries_mm_s: A/B, B/C, C/D of your own; None = those of the class
    vibration_hysteresis_pct: a zone is left downwards so far below its boundary
    """

    vibration_class: VibrationClass = VibrationClass.CLASS_2
    vibration_boundaries_mm_s: tuple[PositiveFloat, PositiveFloat, PositiveFloat] | None = None
    vibration_alarm_zone: Zone = Zone.D
    vibration_hysteresis_pct: float = Field(default=10.0, ge=0.0, le=50.0)
    vibration_dwell_s: NonNegativeFloat = 10.0
    vibration_clear_s: NonNegativeFloat = 10.0

    @cached_property
    def boundaries_mm_s(self) -> tuple[float, float, float]:
        """A/B, B/C, C/D."""
        return self.vibration_boundaries_mm_s or BOUNDARIES_MM_S[self.vibration_class]

    @cached_property
    def lower_boundaries_mm_s(self) -> tuple[float, ...]:
        """The same where a zone is left downwards."""
        lower = 1.0 - self.vibration_hysteresis_pct / 100.0
        return tuple(boundary * lower for boundary in self.boundaries_mm_s)

    @model_validator(mode="after")
    def _zones_follow_each_other(self) -> Self:
        first, second, third = self.boundaries_mm_s
        if not first < second < third:
            raise ValueError(f"vibration_boundaries_mm_s {self.boundaries_mm_s} do not rise; give A/B, B/C, C/D")
        if self.vibration_alarm_zone is Zone.A:
            raise ValueError("vibration_alarm_zone A is every machine; use B, C or D")
        return self


def velocity(sample: Sample) -> Known:
    """The velocity, mm/s rms, of the edge or else of processor `vibration`; None with the reason."""
    why_not = None
    for name in SOURCES:
        if name in sample.row:
            value, reason = sample.number(name)
            if value is not None and 0.0 <= value <= VELOCITY_MM_S_MAX:
                return value, None
            why_not = why_not or reason or f"{name} is beyond any machine"
    return None, why_not or NOT_OFFERED


def zone_of(limits: VibrationLimits, velocity_mm_s: float, before: Zone | None = None) -> Zone:
    """The zone of a velocity. From `before` it goes down only where the velocity is well below the boundary.

    >>> [zone_of(VibrationLimits(), v).value for v in (1.12, 1.13, 2.81, 7.11)]
    ['A', 'B', 'C', 'D']
    >>> zone_of(VibrationLimits(), 2.7, Zone.C).value, zone_of(VibrationLimits(), 2.5, Zone.C).value
    ('C', 'B')
    """
    found = bisect_left(limits.boundaries_mm_s, velocity_mm_s)  # so many boundaries are exceeded
    if before is not None:
        stays = bisect_right(limits.lower_boundaries_mm_s, velocity_mm_s)
        found = max(found, min(stays, ZONES.index(before)))
    return ZONES[found]


def vibration(limits: VibrationLimits, moves: Motion, zone: Zone | None, found: Known) -> Judgement:
    """The zone is one of those that alarm. A spindle that stands or changes its speed is not judged."""
    if moves.rpm is None:
        return unknown(moves.why_not)
    velocity_mm_s, why_not = found
    if velocity_mm_s is None:
        return unknown(why_not or "")
    if moves.is_ramping or zone is None:
        return EXCUSED
    if ZONES.index(zone) < ZONES.index(limits.vibration_alarm_zone):
        return UNDER
    boundary = limits.boundaries_mm_s[ZONES.index(limits.vibration_alarm_zone) - 1]
    text = f"vibration {velocity_mm_s:.1f} mm/s rms in zone {zone.value}, over {boundary:g} mm/s"
    return over(text, velocity_mm_s, boundary, "mm/s")
