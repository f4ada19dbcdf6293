"""The search for a learned term: what is added, at which site and over which argument, takes away most of what is left.

    screen all sites × arguments (`twin.gap.learned.screening`) → fit the best few in the simulator → judge them on runs that were
    not fitted → a term over two arguments only where it is better than every one over one

The few are fitted without the courses of the disturbance, the one that is taken with them.
"""

from collections.abc import Collection
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from twin.gap.evidence import Advantage, advantage
from twin.gap.fitting import Fitted, fitted, left_by
from twin.gap.learned.learnable import Learnable
from twin.gap.learned.screening import Screen, Screened
from twin.gap.learned.shapes import shapes_of
from twin.gap.null import NULL, Null
from twin.gap.stages.free_term import FreeTerm
from twin.gap.stages.stage import Stage
from twin.learned.words import LearnedSite

Floats = NDArray[np.float64]
FITTED_MAX = 4
SCORE_PART = 0.2
"""Part of the best score from which on a term is fitted."""
SCORE_LEAST = 4.0
STEPS_FIRST, STEPS_LAST = 3, 4
MORE_SIGMAS = 2.0
"""Standard errors by which a term over two arguments has to be better than one over one."""
MUCH_SHARE, MUCH_SIGMAS = 0.25, 2.0
"""A term that takes away such a part of the gap is believed from so many standard errors on."""
SEEN_SHARE, SEEN_SIGMAS = 0.6, 4.0
"""The same on the runs that are fitted, of a term that does not help less than nothing on the others."""


@dataclass(frozen=True, slots=True, eq=False)
class Shaped:
    """A learned term that was fitted. over: its advantage over the parent, on runs that were not fitted."""

    term: FreeTerm
    found: Fitted
    over: Advantage


def free_form(
    stage: Stage, parent: Fitted, *, sites: Collection[LearnedSite] | None = None, null: Null = NULL
) -> tuple[Shaped, ...]:
    """Return the learned terms that take away more of what a parent leaves than chance does, best first.

    sites: only at these
    """
    if not isinstance(stage, Learnable):
        return ()
    screen = Screen.of(stage, parent)
    screened = sorted((screen.screened(term) for term in shapes_of(stage, sites)), key=lambda s: -s.score)
    wanted = [s for s in screened if s.score > max(SCORE_LEAST, SCORE_PART * screened[0].score)][:FITTED_MAX]
    fits = [_fitted(stage, screen.stage, parent, one) for one in wanted]
    shaped = [Shaped(s.term, f, advantage(parent.left, f.left)) for s, f in zip(wanted, fits, strict=True)]
    return _ranked(parent, [one for one in shaped if _significant(stage, parent, one, null)])


def refitted_beside(stage: Stage, found: Fitted, term: FreeTerm) -> Fitted:
    """Return a hypothesis with a term beside its effects, both fitted."""
    assert isinstance(stage, Learnable), f"{stage.name} takes no learned terms"
    start = Screen.of(stage, found).screened(term)
    scale = np.maximum(found.left_fit.rms(), 1.0)
    return fitted(stage, found.model.with_term(start.term), start.theta, scale=scale, steps_max=STEPS_LAST)


def refined(stage: Stage, shaped: Shaped, parent: Fitted) -> Shaped:
    """Return a term fitted with the courses of the disturbance, to what it leaves."""
    scale = np.maximum(shaped.found.left_fit.rms(), 1.0)
    found = fitted(stage, shaped.found.model, shaped.found.theta, scale=scale, steps_max=STEPS_LAST)
    return Shaped(shaped.term, found, advantage(parent.left, found.left))


def _fitted(stage: Learnable, quiet: Learnable, parent: Fitted, start: Screened) -> Fitted:
    """Fit on the quiet stage, and judge on the stage itself."""
    scale = np.maximum(parent.left_fit.rms(), 1.0)
    model = parent.model.with_term(start.term)
    found = fitted(quiet, model, start.theta, scale=scale, steps_max=STEPS_FIRST)
    if quiet is stage:
        return found
    left, left_fit = (left_by(stage, model, found.theta, fitted=which) for which in (False, True))
    return replace(found, left=left, left_fit=left_fit)


def _significant(stage: Stage, parent: Fitted, shaped: Shaped, null: Null) -> bool:
    """Return True where a term does more than on a healthy machine.

    One that takes away much may do so less surely; one that is certain on the runs that are fitted may help little where the
    other runs hardly come by.
    """
    over, seen = shaped.over, advantage(parent.left_fit, shaped.found.left_fit)
    surely = null.exceeded_by_any(over, stage.healthy_rms)
    much = over.sigmas > MUCH_SIGMAS and over.share > MUCH_SHARE and over.closes > null.closes_any
    elsewhere = over.gain > 0.0 and seen.sigmas > SEEN_SIGMAS and seen.share > SEEN_SHARE
    return surely or much or elsewhere


def _ranked(parent: Fitted, shaped: list[Shaped]) -> tuple[Shaped, ...]:
    """Order terms, best first; one over two arguments stands before one over one only where it is clearly better."""
    gains = {one.term.name: one.over.gain + advantage(parent.left_fit, one.found.left_fit).gain for one in shaped}
    shaped = sorted(shaped, key=lambda one: -gains[one.term.name])
    plain = [one for one in shaped if len(one.term.knots.columns) == 1]
    if not plain:
        return tuple(shaped)
    more = [one for one in shaped if one not in plain]
    clearly = [one for one in more if advantage(plain[0].found.left, one.found.left).sigmas > MORE_SIGMAS]
    return (*clearly, *plain, *(one for one in more if one not in clearly))
