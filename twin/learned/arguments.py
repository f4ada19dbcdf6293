"""The arguments of learned terms, column → (n,), from what an axis and its machine are told and what they answer."""

from collections.abc import Mapping

import numpy as np
from numpy.typing import NDArray

from twin.learned.words import OF_AXIS

Floats = NDArray[np.float64]
STILL_MM_S = 1e-6
"""Speed of a reference below which it stands."""


def motion_arguments(t_s: Floats, reference_mm: Floats) -> dict[str, Floats]:
    """Return the arguments that the reference of an axis tells; while it stands, its direction is the last one.

    >>> told = motion_arguments(np.array([0.0, 1.0, 2.0, 3.0]), np.array([0.0, 2.0, 2.0, 2.0]))
    >>> told["position_mm"].tolist(), told["velocity_mm_s"].tolist(), told["direction"].tolist()
    ([0.0, 2.0, 2.0, 2.0], [2.0, 1.0, 0.0, 0.0], [1.0, 1.0, 1.0, 1.0])
    """
    velocity = rate(reference_mm, t_s)
    moving = np.abs(velocity) > STILL_MM_S
    last = np.maximum.accumulate(np.where(moving, np.arange(len(velocity)), -1))
    return {
        "position_mm": reference_mm,
        "velocity_mm_s": velocity,
        "direction": np.where(last >= 0, np.sign(velocity[np.maximum(last, 0)]), 0.0),
        "acceleration_mm_s2": rate(velocity, t_s),
        "time_since_start_s": t_s - t_s[:1],
    }


def other_axes(t_s: Floats, references_mm: Mapping[str, Floats]) -> dict[str, Floats]:
    """Return the motion of other axes, by the letter that stands before the column."""
    found: dict[str, Floats] = {}
    for letter, reference in references_mm.items():
        velocity = rate(reference, t_s)
        found |= zip((f"{letter}_{column}" for column in OF_AXIS), (reference, velocity, rate(velocity, t_s)), strict=True)
    return found


AROUND = {
    "spindle_rpm": "spindle_rpm",
    "spindle_angle_rad": "spindle_angle_rad",
    "axial_depth_mm": "axial_depth_mm",
    "coolant_on": "coolant_on",
    "spindle_load_pct": "load_pct",
    "spindle_temp_c": "temperature_c",
    "ambient_temp_c": "ambient_c",
}
"""Column of a run log → argument that it is; the surroundings only as what the spindle is warmer than they."""


def around(t_s: Floats, columns: Mapping[str, Floats | None]) -> dict[str, Floats]:
    """Return the arguments that the machine as a whole tells; missing samples lie on the line between known ones.

    A coolant that is not recorded is off.
    """
    found = {"time_since_start_s": t_s - t_s[:1], "coolant_on": np.zeros(len(t_s))}
    for column, argument in AROUND.items():
        values = columns.get(column)
        known = np.flatnonzero(np.isfinite(values)) if values is not None else np.array([], dtype=np.intp)
        if values is not None and len(known):
            found[argument] = values if len(known) == len(t_s) else np.interp(t_s, t_s[known], values[known])
    if {"temperature_c", "ambient_c"} <= set(found):
        found["temperature_rise_k"] = found["temperature_c"] - found.pop("ambient_c")
    return found


def rate(values: Floats, t_s: Floats) -> Floats:
    """Return the rate of change at each sample, by central differences over the period of the samples."""
    if len(values) < 2:
        return np.zeros(len(values))
    return np.asarray(np.gradient(values, float(np.median(np.diff(t_s)))))
