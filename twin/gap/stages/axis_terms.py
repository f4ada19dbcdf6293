"""Learned terms of an axis as series: put on top of a quantity of its loops, or of what a sensor reads."""

from collections.abc import Mapping, Sequence

import numpy as np
from numpy.typing import NDArray

from twin.gap.stages.axis_run import AxisRunData
from twin.gap.stages.stage import Model
from twin.learned.sites import QUANTITIES, READINGS
from twin.learned.standing import added_series, reading_series
from twin.learned.term import Term
from twin.learned.words import LearnedSite
from twin.machine import Axis
from twin.servo.constants import axis_constants

Floats = NDArray[np.float64]
FRICTION_PART = 0.1
FLOORS = 3.0
SITES = {
    "pos_mm": (LearnedSite.AXIS_FORCE, LearnedSite.FRICTION, LearnedSite.CONTROLLER),
    "torque_a": (LearnedSite.AXIS_FORCE, LearnedSite.FRICTION, LearnedSite.CONTROLLER, LearnedSite.TORQUE_READING),
    "table_mm": (LearnedSite.TABLE_POSITION, LearnedSite.TABLE_READING),
}
"""Output → the sites whose terms it shows."""


def sites_of_terms(letter: str, outputs: Sequence[str]) -> dict[LearnedSite, tuple[str, ...]]:
    """Return the sites of an axis whose terms these outputs show, each with what it is on."""
    return {site: (letter,) for output in outputs for site in SITES[output]}


def size_of_terms(site: LearnedSite, axis: Axis, data: AxisRunData) -> float:
    """Return the size of a small term: a part of the friction, or a few floors of what is read."""
    output = READINGS.get(site, "table_mm" if site is LearnedSite.TABLE_POSITION else "")
    if output in data.floor:
        return FLOORS * float(np.median(data.floor[output]))
    constants = axis_constants(axis)
    friction_n = FRICTION_PART * constants["coulomb_plus_n"]
    return friction_n / constants["newton_per_command"] if site is LearnedSite.CONTROLLER else friction_n


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
    if added:  # all of them, so that any terms together run on one kernel
        first = next(iter(added.values()))
        none = np.broadcast_to(np.zeros(first.shape[1]), first.shape)
        added = {quantity: added.get(quantity, none) for own in QUANTITIES.values() for quantity in own}
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


def start_of_terms(
    model: Model, theta: Floats, letter: str, arguments: Mapping[str, Floats], tick: int, standing: Sequence[Term] = ()
) -> dict[str, Floats]:
    """Return what the terms on an axis add at one tick, by quantity of its kernel and by column that is read, (lanes,) each."""
    if not standing and not model.terms:
        return {}
    here = {column: values[tick : tick + 1] for column, values in arguments.items()}
    found = {name: values[:, 0] for name, values in series_of_terms(model, theta, letter, here, slice(0, 1), standing).items()}
    for column in READINGS.values():
        known = reading_series(standing, f"{letter}_{column}", here)
        own = [
            term.series(theta[:, place], here)[:, 0]
            for term, place in model.term_places()
            if READINGS.get(term.site) == column and term.on in (letter, f"{letter}_{column}")
        ]
        if known is not None or own:
            found[column] = sum(own, np.full(len(theta), 0.0 if known is None else known[0]))
    return found
