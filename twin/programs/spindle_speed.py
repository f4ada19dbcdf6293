"""The speed of a spindle: within what any spindle turns, and at a constant surface speed.

n = V / (2 π r)
"""

import math
from typing import Final

from twin.programs.refusal import RefusedError

RPM_MAX: Final = 1_000_000.0
MM_PER_FOOT: Final = 304.8


def checked_speed(speed: float, text: str) -> float:
    """Return a speed word, if it can be one; else RefusedError."""
    if not 0.0 <= speed <= RPM_MAX:
        raise RefusedError(text, f"a spindle speed is from 0 to {RPM_MAX:g}; its direction is M3 or M4")
    return speed


def rpm_at_radius(surface_speed: float, feet: bool, radius_mm: float, clamp_rpm: float | None, clamp_word: str) -> float:
    """Return the speed at a radius for a surface speed, m/min or feet/min. Source: operator's manual B-64604EN, G96.

    clamp_rpm: the greatest speed, None without one; clamp_word: sets it. A control turns faster all along a facing cut; here
    the speed changes block by block, with the radius at its end.

    Raises RefusedError at radius 0 without a clamp: the speed is endless there.

    >>> round(rpm_at_radius(314.159265, False, 50.0, None, "G92 S"))
    1000
    """
    speed_mm_min = surface_speed * (MM_PER_FOOT if feet else 1000.0)
    if speed_mm_min > 0.0 and radius_mm < 1e-9 and clamp_rpm is None:
        raise RefusedError("", f"G96 at radius 0 is an endless speed; write {clamp_word} before, or [control] spindle_rpm_max")
    rpm = speed_mm_min / (math.tau * radius_mm) if radius_mm >= 1e-9 else math.inf
    return 0.0 if speed_mm_min == 0.0 else min(rpm, clamp_rpm if clamp_rpm is not None else RPM_MAX)
