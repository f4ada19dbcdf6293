"""Forces of an end mill: each tooth, slice by slice of its edge, twenty times a millisecond, held in between.

The uncut chip of a tooth is what its radius reaches beyond the surface that any of the teeth before it has left, so a short tooth
leaves its part to the next one. Forces along and across the feed are turned by the heading of the motion.
"""

# ruff: noqa: PLR0917 - physics takes what its equation takes

from math import atan2, cos, exp, pi, sin, tan
from typing import NamedTuple

import numpy as np
from numba import njit
from numpy.typing import NDArray

from cnctwin.standins.reference_machine.axis import STEPS

Floats = NDArray[np.float64]
SLICES = 16


class CutPhysics(NamedTuple):
    """Tool and material; from `edge_n_per_mm` on, what a nominal cut does not have, at nothing.

    chipped_mm is by how much tooth 0 is shorter, hard_* a stretch of the way where the material is harder, deep_* a depth from
    which it is, chatter_* a vibration of the force at a frequency of its own.
    """

    diameter_mm: float
    teeth: int
    tangential: float
    radial_ratio: float
    edge_n_per_mm: float = 0.0
    edge_radial_n_per_mm: float = 0.0
    thinning: float = 0.0
    runout_mm: float = 0.0
    runout_rad: float = 0.0
    helix_rad: float = 0.0
    chipped_mm: float = 0.0
    hard: float = 0.0
    hard_from_mm: float = 0.0
    hard_to_mm: float = 0.0
    deep: float = 0.0
    deep_mm: float = 1.0
    chatter_n_per_mm: float = 0.0
    chatter_hz: float = 400.0


@njit(cache=True)
def _radius_mm(p: CutPhysics, tooth: int) -> float:
    """By how much a tooth runs on a larger radius."""
    radius = p.runout_mm * cos(p.runout_rad + 2.0 * pi * tooth / p.teeth)
    return radius - p.chipped_mm if tooth % p.teeth == 0 else radius


@njit(cache=True)
def _chip_mm(p: CutPhysics, tooth: int, advance_sine: float) -> float:
    """Return the chip that a tooth takes beyond the teeth before it, each of which passed an advance earlier."""
    if p.runout_mm == 0.0 and p.chipped_mm == 0.0:
        return max(advance_sine, 0.0)
    own = _radius_mm(p, tooth)
    chip = p.teeth * advance_sine
    for earlier in range(1, p.teeth):
        chip = min(chip, earlier * advance_sine + own - _radius_mm(p, tooth - earlier + p.teeth))
    return max(chip, 0.0)


@njit(cache=True)
def _tooth_n(p: CutPhysics, chip: float, stiffer: float) -> tuple[float, float]:
    """Tangential and radial force by mm of edge."""
    if chip <= 0.0:
        return 0.0, 0.0
    coefficient = p.tangential * stiffer
    if p.thinning != 0.0:
        coefficient *= (max(chip, 0.002) / 0.05) ** (-p.thinning)
    engaged = 1.0 - exp(-chip / 0.001)
    tangential = coefficient * chip
    return tangential + p.edge_n_per_mm * engaged, p.radial_ratio * tangential + p.edge_radial_n_per_mm * engaged


@njit(cache=True)
def _cut_n(
    p: CutPhysics, angle: float, heading: float, advance: float, depth: float, entry: float, leaving: float, stiffer: float
) -> tuple[float, float, float]:
    """Force in x and in y on the tool, and the sum of the tangential forces, N."""
    slices = SLICES if p.helix_rad > 0.0 else 1
    along, across, turning = 0.0, 0.0, 0.0
    for tooth in range(p.teeth):
        for number in range(slices):
            height = depth * (number + 0.5) / slices
            lag = 2.0 * height * tan(p.helix_rad) / p.diameter_mm
            phi = (angle + 2.0 * pi * tooth / p.teeth - heading - lag) % (2.0 * pi)
            if not entry <= phi <= leaving:
                continue
            chip = _chip_mm(p, tooth, advance * sin(phi))
            tangential, radial = _tooth_n(p, chip, stiffer)
            width = depth / slices
            along += width * (-tangential * cos(phi) - radial * sin(phi))
            across += width * (tangential * sin(phi) - radial * cos(phi))
            turning += width * tangential
    x = along * cos(heading) - across * sin(heading)
    return x, along * sin(heading) + across * cos(heading), turning


@njit(cache=True)
def forces(
    p: CutPhysics,
    angle_rad: Floats,
    rpm: Floats,
    place_mm: Floats,
    velocity_mm_s: Floats,
    depth_mm: Floats,
    arc_rad: Floats,
    sampled_n: Floats,
    held_n: Floats,
    power_w: Floats,
) -> None:
    """Fills force at the ticks (2, n), in between (2, n · STEPS), and the mean power of a tick (n,).

    angle_rad, rpm, depth_mm: (n,); place_mm, velocity_mm_s: (2, n) of x and y; arc_rad: (2, n) where a tooth enters and leaves
    """
    count = len(angle_rad)
    for tick in range(count):
        depth = depth_mm[tick]
        if depth <= 0.0 or rpm[tick] <= 0.0:
            continue
        turn = rpm[tick] * 2.0 * pi / 60.0 * 0.001
        after = min(tick + 1, count - 1)
        travelled = place_mm[0, tick] + place_mm[1, tick]
        stiffer = 1.0 + (p.hard if p.hard_from_mm <= travelled <= p.hard_to_mm else 0.0)
        stiffer *= 1.0 + p.deep / (1.0 + exp(-(depth - p.deep_mm) / 0.05))
        spent = 0.0
        for step in range(-1, STEPS):
            part = 0.0 if step < 0 else (step + 0.5) / STEPS
            vx = velocity_mm_s[0, tick] + part * (velocity_mm_s[0, after] - velocity_mm_s[0, tick])
            vy = velocity_mm_s[1, tick] + part * (velocity_mm_s[1, after] - velocity_mm_s[1, tick])
            advance = 60.0 * (vx * vx + vy * vy) ** 0.5 / (p.teeth * rpm[tick])
            angle = angle_rad[tick] + part * turn
            x, y, turning = _cut_n(p, angle, atan2(vy, vx), advance, depth, arc_rad[0, tick], arc_rad[1, tick], stiffer)
            if p.chatter_n_per_mm != 0.0 and turning > 0.0:
                beat = 2.0 * pi * p.chatter_hz * 0.001 * (tick + part)
                x += depth * p.chatter_n_per_mm * sin(beat)
                y += depth * p.chatter_n_per_mm * sin(beat + 1.0)
            if step < 0:
                sampled_n[0, tick], sampled_n[1, tick] = x, y
            else:
                held_n[0, tick * STEPS + step], held_n[1, tick * STEPS + step] = x, y
                spent += turning * pi * p.diameter_mm * rpm[tick] / 60000.0 / STEPS
        power_w[tick] = spent
