"""A force on an axis that depends on nothing but time: reconstructed run by run, from what is left there.

    r = J f,   f ~ N(0, s²) at knots in time

What a force does is over within a few tenths of a second, so the columns of J come from a comb: one lane of the simulator has a
unit force at every TEETH-th knot, and each answer is cut where the next one begins. A force that is reconstructed in one run says
nothing of another one.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from twin.gap.fitting import Fitted
from twin.gap.learned.learnable import Learnable
from twin.gap.learned.screening import quiet_of
from twin.gap.stages.free_term import FreeTerm
from twin.gap.stages.stage import Observed
from twin.learned.knots import Knots
from twin.learned.words import TIME, LearnedSite

Floats = NDArray[np.float64]
STEP_S, TEETH, BEFORE = 0.02, 24, 2
"""Distance of the knots; every so many of them in one lane; answers begin so many knots before their force."""
KNOTS_MAX = 2500
ROUNDS = 2
SIZE = 30.0
"""Standard deviation of a force, in small terms."""
KNOWN_PART = 0.05
"""Standard error of a force, in parts of that, above which the run says nothing of it: the axis stands."""


@dataclass(frozen=True, slots=True, eq=False)
class Reconstructed:
    """The force in one run, (knots,) each, with its standard error; both 0 where the run says nothing of it.

    before, after: (n,) residual without and with it, in floors; NaN where there is none
    """

    run: int
    at_s: Floats
    force: Floats
    error: Floats
    before: Floats
    after: Floats


def reconstructed(stage: Learnable, parent: Fitted) -> tuple[Reconstructed, ...]:
    """Return the force on an axis in each run; empty where the stage has none, or a run is too long."""
    where = stage.term_sites.get(LearnedSite.AXIS_FORCE, ())
    if not where:
        return ()
    found = []
    for number in range(len(stage.observed)):
        t_s = stage.term_arguments(number)[TIME]
        knots = np.arange(t_s[0], t_s[-1] + STEP_S, STEP_S)
        if not TEETH < len(knots) <= KNOTS_MAX:
            return ()
        size = stage.term_sizes(LearnedSite.AXIS_FORCE, where[0])
        term = FreeTerm(LearnedSite.AXIS_FORCE, where[0], Knots({TIME: knots}), size, {})
        found.append(_of_run(stage, parent, term, number))
    return tuple(found)


def _of_run(stage: Learnable, parent: Fitted, term: FreeTerm, number: int) -> Reconstructed:
    observed, count = stage.observed[number], term.knots.count
    model = parent.model.with_term(term)

    def shown(of: Learnable, z: Floats) -> Floats:
        return of.predict(model, np.concatenate([np.tile(parent.theta, (len(z), 1)), z], axis=1), number)

    comb = np.zeros((TEETH + 1, count))
    for tooth in range(TEETH):
        comb[tooth + 1, tooth::TEETH] = 1.0
    answers = shown(quiet_of(stage), comb)
    gram, moves = _columns(stage, observed, (answers[1:] - answers[0]) / observed.sigma, term, number)
    z = np.zeros(count)
    before = (observed.measured - shown(stage, z[None, :])[0]) / observed.floor
    left = before
    noise = max(float(np.nanmean(before**2)), 1.0)
    for _ in range(ROUNDS):
        towards = np.array([column @ np.nan_to_num(left * observed.floor / observed.sigma)[rows] for rows, column in moves])
        step = np.linalg.solve(gram + np.eye(count) * noise / SIZE**2, towards - z * noise / SIZE**2)
        again = (observed.measured - shown(stage, (z + step)[None, :])[0]) / observed.floor
        if np.nansum(again**2) >= np.nansum(left**2):
            break
        z, left = z + step, again
        noise = max(float(np.nanmean(left**2)), 1.0)
    error = np.sqrt(noise * np.diag(np.linalg.inv(gram + np.eye(count) * noise / SIZE**2)))
    known = error < KNOWN_PART * SIZE
    return Reconstructed(number, term.knots.by_column[TIME], z * known * term.size, error * known * term.size, before, left)


Column = tuple[NDArray[np.intp], Floats]


def _columns(
    stage: Learnable, observed: Observed, answers: Floats, term: FreeTerm, number: int
) -> tuple[Floats, Sequence[Column]]:
    """JᵀJ, and each column of J as its rows and values."""
    t_s = np.tile(stage.term_arguments(number)[TIME], len(observed.signals))
    at_s = term.knots.by_column[TIME]
    place = np.clip(((t_s - at_s[0]) / STEP_S).astype(np.intp), 0, len(at_s) - 1)
    order = np.argsort(place, kind="stable")
    edges = np.searchsorted(place[order], np.arange(len(at_s) + 1))
    there = np.isfinite(observed.measured)
    moves: list[Column] = []
    for knot in range(len(at_s)):
        first, last = max(knot - BEFORE, 0), min(knot + TEETH - BEFORE, len(at_s))
        rows = order[edges[first] : edges[last]]
        moves.append((rows, np.where(there[rows], np.nan_to_num(answers[knot % TEETH, rows]), 0.0)))
    gram = np.zeros((len(at_s), len(at_s)))
    whole = np.zeros(len(t_s))
    for knot, (rows, column) in enumerate(moves):
        whole[rows] = column
        for other in range(knot, min(knot + TEETH, len(at_s))):
            gram[knot, other] = gram[other, knot] = moves[other][1] @ whole[moves[other][0]]
        whole[rows] = 0.0
    return gram, moves
