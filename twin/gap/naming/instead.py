"""Effects that explain what constants far from their stated values explain, and let them be near those again.

An effect is taken where it follows the unseen runs as well, puts back more constants than it has parameters of its own, and is
clearly the cheaper: Σ (θ / σ)² of the constants falls by more than chance and its parameters are worth. It has to be there for
sure: one whose size may as well be nothing explains nothing. An effect that only does what one constant does (a coefficient, a
mass) is no better an explanation than that constant.
"""

import numpy as np

from twin.effects.catalogue import effect_named
from twin.gap.evidence import advantage
from twin.gap.fitting import Fitted, fitted
from twin.gap.naming.moved import cost, deviations
from twin.gap.screening import guesses, unexplained
from twin.gap.stages.stage import Model, Stage

TRIED = 4
CHEAPER = 9.0
"""Amount by which Σ (θ / σ)² has to fall, and by twice the number of its parameters more."""
PUT_BACK = 1.0
"""Stated deviations within which a constant is back."""
AS_WELL = 0.02
SURE = 2.0
"""Standard errors by which a size of the effect has to differ from nothing."""
STEPS_MAX = 14


def instead_of_constants(stage: Stage, base: Fitted) -> tuple[Fitted, ...]:
    """Return the machine with one effect, cheapest first; empty where none explains better than the constants of `base`.

    Effects are screened and started on the machine as it is stated: the constants of `base` have taken up what they would show.
    """
    stated = fitted(stage, Model((), ()), np.zeros(0))
    left = unexplained(stage, stated)
    likely = sorted((guesses(stage, stated, c, left)[0] for c in stage.candidates), key=lambda guess: -guess.closes)[:TRIED]
    scale = np.maximum(base.left_fit.rms(), 1.0)
    at_first = np.zeros(len(base.model.constants))
    again = []
    for guess in likely:
        model = base.model.with_effect(guess.effected)
        again.append(fitted(stage, model, np.concatenate([at_first, guess.theta]), scale=scale, steps_max=STEPS_MAX))
    return tuple(sorted((one for one in again if _is_better(one, base)), key=cost))


def _is_better(one: Fitted, base: Fitted) -> bool:
    over = advantage(one.left, base.left)
    own = len(effect_named(one.effects[0].effect).parameters)
    back = _away(base) - _away(one)
    as_well = over.gain < max(2.0 * over.error, AS_WELL)
    return as_well and back > own and cost(base) - cost(one) > CHEAPER + 2.0 * own and _is_surely_there(one)


def _is_surely_there(found: Fitted) -> bool:
    sizes = found.model.size_places(found.effects[0])
    errors = np.sqrt(np.diagonal(found.covariance)[sizes])
    return bool((np.abs(found.theta[sizes]) > SURE * errors).any())


def _away(found: Fitted) -> int:
    return int(np.count_nonzero(np.abs(deviations(found)) >= PUT_BACK))
