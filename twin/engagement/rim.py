"""The contact of the tool's front rim with the material: the angles, the depth, the section of the chip.

The rim point at φ is p + R (sin φ u + cos φ l) with the heading u and l to its left. The front half, 0 ≤ φ ≤ π, is looked at in
steps of 1°; where the depth jumps between two steps, the place is found by bisection. So an angle is as exact as the heights are
(better than 1e-6 rad), and what is narrower than 1° of the rim may be missed.
"""

import math
from typing import NamedTuple

import numpy as np

from twin.engagement.cells import Cells, height_at
from twin.engagement.rectangle import rectangle
from twin.engagement.sweep import Floats
from twin.kernels.compiling import kernel

STEPS = 180
PHI = np.linspace(0.0, math.pi, STEPS + 1)
PHI[0], PHI[-1] = 1e-4, math.pi - 1e-4  # The ends themselves lie on what the tool has just cut.
SIN, COS = np.sin(PHI), np.cos(PHI)
BISECTIONS = 20
JUMP = 1 / 200
"""A change of depth from one step to the next that is larger than this part of the radius is a step, not a slope."""
DEPTH_MIN_MM = 1e-4
"""Least depth of cut: material that stands less above the end face is a trace of a former pass."""
WIDTH_MIN_MM = 1e-3
"""Least width of cut across the feed: anything narrower is rounding, no chip and no step in one."""


class Contact(NamedTuple):
    """The contact of the rim. depth_mm, entry_rad, exit_rad: the rectangle that stands for it; section_mm2: of the chip, across
    the feed (R ∫ a sin φ dφ); deepest_mm: largest depth; arcs: separate arcs, 0 = no contact; uniform: one arc of one depth."""

    depth_mm: float
    entry_rad: float
    exit_rad: float
    section_mm2: float
    deepest_mm: float
    arcs: int
    uniform: bool


@kernel
def _depth(cells: Cells, place: Floats, sine: float, cosine: float) -> float:
    """Depth of the material at the rim point of that sine and cosine; place: x, y, heading x, heading y, radius, lowest z."""
    x = place[0] + place[4] * (sine * place[2] - cosine * place[3])
    y = place[1] + place[4] * (sine * place[3] + cosine * place[2])
    depth = height_at(cells, x, y, place[5]) - place[5]
    return depth if depth >= DEPTH_MIN_MM else 0.0


@kernel
def _depths(cells: Cells, place: Floats) -> Floats:
    """`_depth` at each step of the rim, written out: a call for each costs four times as much."""
    depths = np.empty(STEPS + 1)
    x, y, heading_x, heading_y, radius, low = place
    for step in range(STEPS + 1):
        sine, cosine = radius * SIN[step], radius * COS[step]
        depth = height_at(cells, x + sine * heading_x - cosine * heading_y, y + sine * heading_y + cosine * heading_x, low) - low
        depths[step] = depth if depth >= DEPTH_MIN_MM else 0.0
    return depths


@kernel
def _edge(cells: Cells, place: Floats, low: float, high: float, before: float, after: float) -> float:
    """The angle between low and high at which the depth goes from `before` to `after`."""
    middle = (before + after) / 2.0
    for _ in range(BISECTIONS):
        phi = (low + high) / 2.0
        if (_depth(cells, place, math.sin(phi), math.cos(phi)) > middle) == (before > middle):
            low = phi
        else:
            high = phi
    return (low + high) / 2.0


@kernel
def _add(moments: Floats, depth: float, start: float, end: float, radius: float) -> None:
    """Add the piece of rim from start to end to (∫ a sin, ∫ a sin², ∫ a sin cos, smallest, largest depth)."""
    sine_a, cosine_a, sine_b, cosine_b = math.sin(start), math.cos(start), math.sin(end), math.cos(end)
    moments[0] += depth * (cosine_a - cosine_b)
    moments[1] += depth * (end - start - sine_b * cosine_b + sine_a * cosine_a) / 2.0
    moments[2] += depth * (sine_b * sine_b - sine_a * sine_a) / 2.0
    if radius * (cosine_a - cosine_b) >= WIDTH_MIN_MM:
        moments[3], moments[4] = min(moments[3], depth), max(moments[4], depth)


@kernel
def contact(cells: Cells, x: float, y: float, heading_x: float, heading_y: float, radius: float, tip: float) -> Contact:
    """Return the contact of the front rim of a tool at (x, y), its end face at the z `tip`, on the way along a unit vector."""
    place = np.array([x, y, heading_x, heading_y, radius, max(tip, cells.low_z)])
    total, arc = np.zeros(5), np.zeros(5)
    total[3] = arc[3] = math.inf
    arcs, entry, exit_, began = 0, 0.0, 0.0, 0.0
    piece, before = 0.0, 0.0
    depths = _depths(cells, place)
    for step in range(STEPS + 2):
        depth = depths[step] if step <= STEPS else 0.0
        if depth == before:
            continue
        if step == 0:
            edge = 0.0
        elif step > STEPS:
            edge = math.pi
        elif min(depth, before) == 0.0 or abs(depth - before) > JUMP * radius:
            edge = _edge(cells, place, PHI[step - 1], PHI[step], before, depth)
        else:
            edge = (PHI[step - 1] + PHI[step]) / 2.0
        if before == 0.0:
            began = edge
            arc[:3], arc[3], arc[4] = 0.0, math.inf, 0.0
        else:
            _add(arc, before, piece, edge, radius)
        if depth == 0.0 and radius * (math.cos(began) - math.cos(edge)) >= WIDTH_MIN_MM:
            total[:3] += arc[:3]
            total[3], total[4] = min(total[3], arc[3]), max(total[4], arc[4])
            entry, exit_ = began if arcs == 0 else entry, edge
            arcs += 1
        piece, before = edge, depth
    if arcs == 0:
        return Contact(0.0, 0.0, 0.0, 0.0, 0.0, 0, True)
    if total[4] == 0.0:  # Nothing but a slope near an end of the rim: no piece of it is wide.
        total[4] = total[0] / (math.cos(entry) - math.cos(exit_))
    uniform = arcs == 1 and total[4] - total[3] < DEPTH_MIN_MM
    depth = total[4]
    if not uniform:
        depth, entry, exit_ = rectangle(total[0], total[1], total[2])
    return Contact(depth, entry, exit_, radius * total[0], total[4], arcs, uniform)
