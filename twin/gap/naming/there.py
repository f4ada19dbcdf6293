"""Effects that are there for sure: one whose size may as well be nothing is no cause.

It may take a gap away on unseen runs all the same, as a little of anything does beside what nothing explains. What makes an
effect more than nothing are its sizes s, as θ; shapes and angles have no say. It is there where the interval of one of them does
not hold its null value, or where all of them together are beyond what they are uncertain by, as two are that only show as a sum:

    sᵀ C⁻¹ s > χ²,   at 90 %, with the covariance C that the intervals come from

An effect that may be nothing gives its place to one that cannot be told from it and is there, else it is dropped, and the others
are fitted again without it. What it took away has no name then.
"""

from dataclasses import replace

import numpy as np
from scipy.stats import chi2

from twin.effects.catalogue import effect_named
from twin.gap.diagnosis import Effected, Interval
from twin.gap.evidence import evidence_of
from twin.gap.fitting import Fitted, without_effect
from twin.gap.intervals import parameter_intervals, uncertainty_of
from twin.gap.naming.moved import has_to_be_beyond
from twin.gap.naming.twins import instead_of, is_known, leaves_no_more
from twin.gap.search import Explained

CERTAINTY = 0.9


def only_there(found: Explained) -> Explained:
    """Return the same with none but effects that are there, and a note on each of the others, which what is left looks like."""
    while (unsure := _least_there(found.best)) is not None:
        found = _with_another(found, unsure) or _dropped(found, unsure)
    return found


def is_there(found: Fitted, effected: Effected) -> bool:
    """Return True where an effect of a hypothesis is more than nothing for sure."""
    return _farness(found, effected) > 1.0


def _least_there(best: Fitted) -> Effected | None:
    """Return the effect of which least is known that it is there; None where all are."""
    unsure = [e for e in best.effects if not is_there(best, e)]
    return min(unsure, key=lambda e: _farness(best, e), default=None)


def _farness(found: Fitted, effected: Effected) -> float:
    """Return by how much the sizes of an effect are beyond chance, one by one or all together, 1 at the limit."""
    sizes = found.model.size_places(effected)
    if not sizes:
        return np.inf
    theta, covariance = found.theta[sizes], uncertainty_of(found)[np.ix_(sizes, sizes)]
    alone = theta**2 / np.maximum(np.diag(covariance), 1e-300) / chi2.isf(1.0 - CERTAINTY, 1)
    together = theta @ np.linalg.pinv(covariance, hermitian=True) @ theta / chi2.isf(1.0 - CERTAINTY, len(sizes))
    return float(max(alone.max(), together))


def _with_another(found: Explained, unsure: Effected) -> Explained | None:
    """Return the answer with one of the effects that cannot be told from an unsure one in its place; None where none is there."""
    stage, rivals = found.stage, found.rivals.get(unsure, ())
    fits = [(r, one[1]) for r in rivals if (one := instead_of(stage, found, unsure, r)) is not None]
    sure = [(r, f) for r, f in fits if is_there(f, r) and leaves_no_more(stage, f, found)]
    if not sure:
        return None
    leader, best = min(sure, key=lambda one: (not is_known(one[1], one[0]), one[1].left.excess()))
    others = {e: r for e, r in found.rivals.items() if e in best.effects}
    others[leader] = (*(r for r in rivals if r != leader), unsure)
    return replace(found, best=best, rivals=others, evidence=evidence_of(stage, found.base, best))


def _dropped(found: Explained, unsure: Effected) -> Explained:
    stage = found.stage
    best = without_effect(stage, found.base, found.best, unsure)
    evidence = evidence_of(stage, found.base, best)
    rivals = {e: r for e, r in found.rivals.items() if e in evidence}
    beyond = not best.effects and has_to_be_beyond(stage, found.base)
    notes = (*found.notes, _note(unsure, parameter_intervals(found.best)[unsure]))
    alike = (*found.alike, unsure)
    return replace(found, best=best, rivals=rivals, evidence=evidence, beyond=beyond, alike=alike, notes=notes)


def _note(effected: Effected, intervals: dict[str, Interval]) -> str:
    sizes = [p.name for p in effect_named(effected.effect).parameters if p.null is not None]
    said = " and ".join(f"{n} from {intervals[n].low:.3g} to {intervals[n].high:.3g} {intervals[n].unit}".strip() for n in sizes)
    return f"{effected} is not named: it fits with {said}, so it may as well not be there"
