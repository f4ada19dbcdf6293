"""Points, tangents and curvature along segments: the compiled part of a path. Formulas: see `path`."""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from twin.kernels.compiling import kernel

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]
ARC = 2


class Segments(NamedTuple):
    """The segments of a path, n rows.

    line, kind, sweep_rad, length_mm: (n,); start_mm, end_mm, centre_mm: (n, axes)
    plane_axes: (n, 2) first and second axis of the plane
    """

    line: Ints
    kind: Ints
    start_mm: Floats
    end_mm: Floats
    centre_mm: Floats
    plane_axes: Ints
    sweep_rad: Floats
    length_mm: Floats


@kernel
def _polar(point: Floats, centre: Floats, u: int, v: int) -> tuple[float, float]:
    du, dv = point[u] - centre[u], point[v] - centre[v]
    return np.hypot(du, dv), np.arctan2(dv, du)


@kernel
def points_at(segments: Segments, segment: Ints, s_mm: Floats) -> Floats:
    """Points (n, axes) at distances `s_mm` (n,) of segments `segment` (n,); the ends of a segment are met exactly."""
    _line, kind, start_mm, end_mm, centre_mm, plane_axes, sweep_rad, length_mm = segments
    axes = start_mm.shape[1]
    points = np.empty((len(segment), axes))
    for n in range(len(segment)):
        k = segment[n]
        f = s_mm[n] / length_mm[k]
        if f >= 1.0:
            points[n] = end_mm[k]
            continue
        for a in range(axes):
            points[n, a] = start_mm[k, a] + (end_mm[k, a] - start_mm[k, a]) * f
        if kind[k] == ARC and f > 0.0:
            u, v = plane_axes[k, 0], plane_axes[k, 1]
            r0, angle = _polar(start_mm[k], centre_mm[k], u, v)
            r1, _ = _polar(end_mm[k], centre_mm[k], u, v)
            radius = r0 + (r1 - r0) * f
            points[n, u] = centre_mm[k, u] + radius * np.cos(angle + sweep_rad[k] * f)
            points[n, v] = centre_mm[k, v] + radius * np.sin(angle + sweep_rad[k] * f)
    return points


@kernel
def tangents_at(segments: Segments, segment: Ints, s_mm: Floats) -> Floats:
    """dp/ds (n, axes) at distances `s_mm` (n,) of segments `segment` (n,)."""
    _line, kind, start_mm, end_mm, centre_mm, plane_axes, sweep_rad, length_mm = segments
    axes = start_mm.shape[1]
    tangents = np.empty((len(segment), axes))
    for n in range(len(segment)):
        k = segment[n]
        for a in range(axes):
            tangents[n, a] = (end_mm[k, a] - start_mm[k, a]) / length_mm[k]
        if kind[k] == ARC:
            u, v = plane_axes[k, 0], plane_axes[k, 1]
            r0, angle = _polar(start_mm[k], centre_mm[k], u, v)
            r1, _ = _polar(end_mm[k], centre_mm[k], u, v)
            angle += sweep_rad[k] * s_mm[n] / length_mm[k]
            along = 0.5 * (r0 + r1) * sweep_rad[k] / length_mm[k]
            tangents[n, u] = -along * np.sin(angle)
            tangents[n, v] = along * np.cos(angle)
    return tangents


@kernel
def curvature_at(segments: Segments) -> Floats:
    """Curvature (n,) of each segment, 1/mm: r θ² / L²; a circle of 10 mm has 0.1, a line 0."""
    _line, kind, start_mm, end_mm, centre_mm, plane_axes, sweep_rad, length_mm = segments
    curvature = np.zeros(len(kind))
    for k in range(len(kind)):
        if kind[k] == ARC:
            u, v = plane_axes[k, 0], plane_axes[k, 1]
            r0, _ = _polar(start_mm[k], centre_mm[k], u, v)
            r1, _ = _polar(end_mm[k], centre_mm[k], u, v)
            curvature[k] = 0.5 * (r0 + r1) * (sweep_rad[k] / length_mm[k]) ** 2
    return curvature
