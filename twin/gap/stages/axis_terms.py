"""Learned terms of an axis as series: put on top of a quantity of its loops, or of what a sensor reads."""

from collections.abc import Mapping, Sequence

import numpy as np
from numpy.typing import NDArray

from twin.gap.stages.axis_run import AxisRunData
from twin.gap.stages.stage import Model
from twin.learned.sites import QUANTITIES, READINGS
from twin.learned.standing import added_series, reading_series
from twin.learned.term import Term

Floats = NDArray[np.float64]


def series_of_terms(
    model: Model, theta: Floats, letter: str, arguments: Mapping[str, Floats], where: slice, standing: Sequence[Term] = ()
) -> dict[str, Floats]:
    """Return quantity → (lanes, ticks) of the terms on an axis over a stretch, added up; empty where there is none.

    standing: those that the machine has already
    """
    known = added_series(standing, {c: v[where] for c, v in arguments.items()}) if standing else {}
    added = {quantity: np.tile(series, (len(theta), 1)) for quantity, series in known.items()}
    for term, place in model.term_places():
        if term.on == letter and term.site in QUANTITIES:
            series = term.series(theta[:, place], {c: arguments[c][where] for c in term.knots.columns})
            for quantity, sign in QUANTITIES[term.site].items():
                added[quantity] = added.get(quantity, 0.0) + sign * series
    return added


def readings_of_terms(
    model: Model, theta: Floats, signal: str, data: AxisRunData, standing: Sequence[Term] = ()
) -> Floats | float:
    """Return what the terms on a signal add to its reading over all stretches, (lanes, n) or (n,); 0 where there is none.

    standing: those that the machine has already
    """
    known = reading_series(standing, signal, data.arguments)
    total: Floats | float = 0.0
    if known is not None:
        total = known[np.concatenate([np.arange(len(data.t_s))[s] for s in data.stretches()])]
    for term, place in model.term_places():
        if READINGS.get(term.site) == signal.partition("_")[2] and term.on in (signal, signal.partition("_")[0]):
            where = np.concatenate([np.arange(len(data.t_s))[s] for s in data.stretches()])
            total = total + term.series(theta[:, place], {c: data.arguments[c][where] for c in term.knots.columns})
    return total
