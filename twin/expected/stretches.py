"""The stretches of a run of a line: places whose forces are alike, as few as a look-up needs.

A row joins the stretch before it while its force differs from the mean of that stretch by less than a part of the greatest force
of the line; the part is doubled until no more than STRETCHES_MAX are left.
"""

import numpy as np
from numpy.typing import NDArray

from twin.expected.expected import RATIOS, Stretch
from twin.expected.forces import RowForces

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]
ALIKE, STRETCHES_MAX = 0.05, 24
PLANNED = RATIOS.index(1.0)
DIGITS = 4


def stretches_of(
    forces: RowForces | None, segments: Ints, length_mm: Floats, feeds: NDArray[np.bool_], feed_mm_min: float, rpm: float
) -> tuple[Stretch, ...]:
    """Return the stretches of a run that goes over these segments; one without force where it moves in rapid or not at all."""
    total_mm = float(length_mm.sum())
    if forces is None or not feeds.any():
        return (Stretch(total_mm, (0.0,)),)
    ways, rows, is_linear = [], [], True
    for segment, way_mm, does_feed in zip(segments.tolist(), length_mm.tolist(), feeds.tolist(), strict=True):
        own, linear = forces.of_segment(segment, feed_mm_min, rpm) if does_feed else (np.zeros((1, len(RATIOS))), True)
        is_linear &= linear
        ways.append(np.full(len(own), way_mm / len(own)))
        rows.append(own)
    way, force = np.concatenate(ways), np.concatenate(rows)
    bounds = _bounds(way, force[:, PLANNED])
    sums = np.add.reduceat(force * way[:, None], bounds)
    lengths = np.add.reduceat(way, bounds)
    ends = np.cumsum(lengths)
    columns = [PLANNED] if is_linear else list(range(len(RATIOS)))
    means = np.round(sums[:, columns] / np.maximum(lengths, 1e-12)[:, None], DIGITS)
    return tuple(Stretch(round(float(end), DIGITS), tuple(mean)) for end, mean in zip(ends.tolist(), means.tolist(), strict=True))


def _bounds(way_mm: Floats, force_n: Floats) -> list[int]:
    """Return the first row of each stretch."""
    most = float(force_n.max(initial=0.0))
    alike = ALIKE
    while True:
        found, total_n, total_mm = [0], 0.0, 0.0
        for k, (way, force) in enumerate(zip(way_mm.tolist(), force_n.tolist(), strict=True)):
            if total_mm > 0.0 and abs(force - total_n / total_mm) > alike * most:
                found.append(k)
                total_n = total_mm = 0.0
            total_n, total_mm = total_n + force * way, total_mm + way
        if len(found) <= STRETCHES_MAX:
            return found
        alike *= 2.0
