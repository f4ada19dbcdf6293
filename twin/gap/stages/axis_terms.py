"""Learned terms of an axis as series: put on top of a quantity of its loops, or of what a sensor reads."""

from collections.abc import Mapping

import numpy as np
from numpy.typing import NDArray

from twin.gap.stages.axis_run import AxisRunData
from twin.gap.stages.stage import Model
from twin.learned.words import LearnedSite

Floats = NDArray[np.float64]
QUANTITIES = {
    LearnedSite.AXIS_FORCE: {"external_force_n": 1.0},
    LearnedSite.FRICTION: {"friction_n": 1.0, "breakaway_n": 1.0},
    LearnedSite.CONTROLLER: {"torque_command_a": 1.0},
    LearnedSite.TABLE_POSITION: {"table_mm": 1.0},
}
"""Site → quantities of the axis kernel that a term there is added to, with its sign: a force of + pushes towards +."""
READINGS = {
    LearnedSite.POSITION_READING: "pos_mm",
    LearnedSite.TABLE_READING: "table_mm",
    LearnedSite.TORQUE_READING: "torque_a",
}
"""Site → column, without the letter, whose reading a term there is added to."""


def series_of_terms(model: Model, theta: Floats, letter: str, arguments: Mapping[str, Floats], where: slice) -> dict[str, Floats]:
    """Return quantity → (lanes, ticks) of the terms on an axis over a stretch, added up; empty where there is none."""
    added: dict[str, Floats] = {}
    for term, place in model.term_places():
        if term.on == letter and term.site in QUANTITIES:
            series = term.series(theta[:, place], {c: arguments[c][where] for c in term.knots.columns})
            for quantity, sign in QUANTITIES[term.site].items():
                added[quantity] = added.get(quantity, 0.0) + sign * series
    return added


def readings_of_terms(model: Model, theta: Floats, signal: str, data: AxisRunData) -> Floats | float:
    """Return what the terms on a signal add to its reading over all stretches, (lanes, n); 0 where there is none."""
    total: Floats | float = 0.0
    for term, place in model.term_places():
        if READINGS.get(term.site) == signal.partition("_")[2] and term.on in (signal, signal.partition("_")[0]):
            where = np.concatenate([np.arange(len(data.t_s))[s] for s in data.stretches()])
            total = total + term.series(theta[:, place], {c: data.arguments[c][where] for c in term.knots.columns})
    return total
