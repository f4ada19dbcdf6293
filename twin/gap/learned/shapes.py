"""The learned terms that are tried in a stage: sites × what each may depend on there, knots where the recordings have been."""

from collections.abc import Collection, Iterable, Mapping

import numpy as np
from numpy.typing import NDArray

from twin.gap.learned.learnable import Learnable
from twin.gap.stages.free_term import FreeTerm
from twin.learned.knots import Knots
from twin.learned.words import OF_AXIS, PERIODS, LearnedSite

Floats = NDArray[np.float64]
S = LearnedSite
FINE, PLAIN, COARSE = 32, 16, 9
"""Knots over what may change sharply, over any other argument, and of each of two."""
SHARP = ("position_mm", "time_since_start_s")
FLAT = 1e-9
"""Range of an argument below which it is the same everywhere."""
MOTION = ("position_mm", "velocity_mm_s", "direction", "acceleration_mm_s2", "time_since_start_s", "temperature_c")
CUTTING = (
    "chip_mm",
    "axial_depth_mm",
    "spindle_angle_rad",
    "spindle_rpm",
    "x_position_mm",
    "y_position_mm",
    "time_since_start_s",
)
ALONE: Mapping[LearnedSite, tuple[str, ...]] = {
    S.AXIS_FORCE: MOTION,
    S.FRICTION: ("position_mm", "velocity_mm_s", "time_since_start_s", "temperature_c"),
    S.CONTROLLER: ("velocity_mm_s", "direction", "acceleration_mm_s2", "position_mm"),
    S.TABLE_POSITION: ("direction", "torque_a", "velocity_mm_s", "acceleration_mm_s2"),
    S.TABLE_READING: ("position_mm", "temperature_c", "time_since_start_s"),
    S.TORQUE_READING: ("torque_a",),
    S.CUT_FORCE: CUTTING,
    S.SPINDLE_POWER: ("load_pct", "spindle_rpm", "time_since_start_s"),
    S.HEAT_INPUT: ("temperature_rise_k", "spindle_rpm", "load_pct", "time_since_start_s"),
    S.HEAT_LOSS: ("coolant_on",),
    S.TEMPERATURE_READING: ("temperature_c",),
}
"""Site → the single arguments that are tried there."""
TOGETHER: Mapping[LearnedSite, tuple[tuple[str, str], ...]] = {
    S.AXIS_FORCE: (("position_mm", "direction"), ("velocity_mm_s", "time_since_start_s")),
    S.FRICTION: (("position_mm", "direction"),),
    S.TABLE_POSITION: (("position_mm", "direction"),),
    S.CUT_FORCE: (("x_position_mm", "y_position_mm"),),
    S.HEAT_INPUT: (("temperature_rise_k", "spindle_rpm"),),
}
"""Site → the pairs of arguments that are tried there."""
OTHERS: Mapping[LearnedSite, tuple[str, ...]] = {S.AXIS_FORCE: OF_AXIS}
"""Site → columns of the other axes that are tried there."""


def shapes_of(stage: Learnable, sites: Collection[LearnedSite] | None = None) -> tuple[FreeTerm, ...]:
    """Return the terms that are tried, over one argument before those over two; sites: only at these."""
    seen = [stage.term_arguments(run) for run in range(len(stage.observed))]
    ranges = {
        column: (min(lows), max(highs))
        for column in seen[0]
        if all(column in one for one in seen)  # a term is simulated in every run
        and (values := [one[column][np.isfinite(one[column])] for one in seen])
        and (lows := [float(v.min()) for v in values if len(v)])
        and (highs := [float(v.max()) for v in values if len(v)])
        and max(highs) - min(lows) > FLAT
    }
    single, double = [], []
    for site, where in stage.term_sites.items():
        if sites is not None and site not in sites:
            continue
        for on in where:
            size = stage.term_sizes(site, on)
            columns = [c for c in (*ALONE.get(site, ()), *_of_others(site, ranges)) if c in ranges]
            single += [
                FreeTerm(site, on, Knots({c: knots_of(c, *ranges[c], FINE if c in SHARP else PLAIN)}), size, {}) for c in columns
            ]
            pairs = [pair for pair in TOGETHER.get(site, ()) if set(pair) <= set(ranges)]
            double += [FreeTerm(site, on, Knots({c: knots_of(c, *ranges[c], COARSE) for c in p}), size, {}) for p in pairs]
    return (*single, *double)


def _of_others(site: LearnedSite, columns: Iterable[str]) -> list[str]:
    return [c for c in columns if any(c.endswith(f"_{own}") and c != own for own in OTHERS.get(site, ()))]


def knots_of(column: str, low: float, high: float, count: int = PLAIN) -> Floats:
    """Return the knots of an argument over its range; those of a velocity are denser where it is slow.

    >>> knots_of("velocity_mm_s", -100.0, 100.0, 5).tolist()
    [-100.0, -25.0, 0.0, 25.0, 100.0]
    """
    if column in PERIODS:
        return np.asarray(np.arange(count) * (PERIODS[column] / count), dtype=np.float64)
    if column in ("direction", "coolant_on"):
        return np.array([low, high])
    if column.endswith("velocity_mm_s"):
        side = np.linspace(-1.0, 1.0, count + 1 - count % 2) if low < 0.0 < high else np.linspace(0.0, 1.0, count)
        reach = max(abs(low), abs(high))
        return np.asarray(np.sign(side) * side**2 * reach if low < 0.0 else np.sign(high) * side**2 * reach)
    return np.linspace(low, high, count)
