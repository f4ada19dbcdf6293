"""The peak force of a cut at each tick of a run, worked out once for neighbouring ticks that cut alike."""

from collections.abc import Mapping, Sequence
from types import MappingProxyType

import numpy as np
from numpy.typing import ArrayLike, NDArray

from twin.learned.bounds import greatest
from twin.learned.cutting import COEFFICIENT, KNOWN, cut_series, direction_of, sampled_forces
from twin.learned.term import Term
from twin.process.milling import peak_force

Floats = NDArray[np.float64]
BLOCK = 2048
"""Cuts that are sampled at a time."""
CHIP = "chip_mm"
GRID = 9
"""Values of a K_t that changes from tick to tick between which peaks are interpolated."""


def peaks(
    constants: Mapping[str, float],
    teeth: int,
    effects: tuple[str, ...],
    cut: tuple[Floats, ...],
    terms: Sequence[Term] = (),
    arguments: Mapping[str, Floats] = MappingProxyType({}),
) -> Floats:
    """Return the greatest resultant over a tooth period at each tick, (ticks,), N.

    cut: speed, feed, depth, entry and exit, (ticks,) each, alike where seven digits are
    terms: learned ones of the cut, with their arguments at the ticks

    What depends on the chip is sampled over a turn. A resultant is convex in K_t, so what is interpolated over it is exact or too
    high, and a force in one direction is taken to add to the resultant with all that it has.
    """
    rows = np.nan_to_num(np.array(cut))
    places = 6 - np.floor(np.log10(np.maximum(np.abs(rows).max(axis=1, keepdims=True), 1e-30)))
    rows = np.round(rows * 10.0**places) / 10.0**places
    new = np.concatenate([[True], (rows[:, 1:] != rows[:, :-1]).any(axis=0)])
    different = rows[:, new]
    cutting = (different[2] > 0.0) & (different[0] > 0.0)
    by_chip = [term for term in terms if not direction_of(term.on) and CHIP in term.knots.columns]
    series = cut_series([term for term in terms if term not in by_chip], arguments)
    specific = series.get("")
    grid = np.zeros(1) if specific is None else np.linspace(specific.min(), specific.max(), GRID)
    found = np.zeros((len(grid), different.shape[1]))
    if cutting.any():
        own: dict[str, ArrayLike] = {**constants, COEFFICIENT: constants[COEFFICIENT] + grid}
        found[:, cutting] = peak_force(own, teeth, *different[:, cutting], effects=effects)
        if by_chip:
            found[:, cutting] *= _over_without(by_chip, different[:, cutting], teeth, constants, effects)
    alike = np.cumsum(new) - 1
    shown = found[0, alike]
    if specific is not None and grid[-1] > grid[0]:
        place = np.clip((specific - grid[0]) / (grid[-1] - grid[0]) * (GRID - 1), 0.0, GRID - 1)
        below = np.minimum(place.astype(np.intp), GRID - 2)
        shown = found[below, alike] * (1.0 - (place - below)) + found[below + 1, alike] * (place - below)
    pushes = [series[direction] for direction in ("x", "y") if direction in series]
    return np.asarray(shown + np.where(shown > 0.0, np.hypot(*pushes, *[0.0] * (2 - len(pushes))), 0.0)) if pushes else shown


def _over_without(
    terms: Sequence[Term], cuts: Floats, teeth: int, constants: Mapping[str, float], effects: tuple[str, ...]
) -> Floats:
    """Peaks of cuts (speed, feed, depth, entry, exit) with terms of the chip over those without, (cuts,)."""
    known, ratios = [greatest(term, KNOWN) for term in terms], []
    for first in range(0, cuts.shape[1], BLOCK):
        rpm, feed, *arcs = cuts[:, first : first + BLOCK]
        advance_mm = feed / (teeth * rpm)
        (with_terms, _), (without, _) = sampled_forces(known, np.array(arcs), advance_mm, teeth, dict(constants), effects)
        ratios.append(with_terms / np.maximum(without, 1e-12))
    return np.concatenate(ratios)
