"""Learned terms of the cut, the spindle's power and its heat while they are fitted, as series in each lane."""

from collections.abc import Callable, Mapping

import numpy as np
from numpy.typing import NDArray

from twin.gap.stages.free_term import FreeTerm
from twin.gap.stages.stage import Model
from twin.learned.cutting import direction_of
from twin.learned.sites import MACHINE_QUANTITIES, MACHINE_READINGS
from twin.learned.words import LearnedSite

Floats = NDArray[np.float64]
Arguments = Callable[[], Mapping[str, Floats]]
"""The arguments that the terms depend on, asked for only where there are any."""
Series = Mapping[str, Floats]


def with_force_terms(known: Series, model: Model, theta: Floats, arguments: Arguments) -> Series:
    """Return direction x or y, or empty for a specific force → (ticks,) or (lanes, ticks), with the terms on top of `known`."""
    return _with(known, model, theta, arguments, lambda t: {direction_of(t.on): 1.0} if t.site is LearnedSite.CUT_FORCE else {})


def with_quantity_terms(known: Series, model: Model, theta: Floats, arguments: Arguments) -> Series:
    """Return quantity → (n,) or (lanes, n), likewise."""
    return _with(known, model, theta, arguments, lambda t: MACHINE_QUANTITIES.get(t.site, {}))


def reading_of_terms(model: Model, theta: Floats, signal: str, arguments: Arguments) -> Floats | float:
    """Return what the terms add to the reading of a signal, (lanes, n); 0 where none does."""
    there = _with({}, model, theta, arguments, lambda t: {signal: 1.0} if _reads(t, signal) else {})
    return there.get(signal, 0.0)


def _reads(term: FreeTerm, signal: str) -> bool:
    return signal in MACHINE_READINGS.get(term.site, ()) and term.on in ("", signal)


def _with(
    known: Series, model: Model, theta: Floats, arguments: Arguments, added_to: Callable[[FreeTerm], Mapping[str, float]]
) -> dict[str, Floats]:
    found = dict(known)
    for term, place in model.term_places():
        for name, sign in added_to(term).items():
            series = sign * term.series(theta[:, place], arguments())
            found[name] = found[name] + series if name in found else series
    return found
