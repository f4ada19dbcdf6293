"""The learned terms of a diagnosis: what is left in each stage that no named cause explains, described and put into the twin.

A term is a description, not a cause. Its closure is of what is left beside the named causes, on runs that were not fitted.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from twin.gap.diagnosis import Effected, Learned, LooksLike, Verdict
from twin.gap.evidence import advantage
from twin.gap.fitting import Fitted, Left
from twin.gap.intervals import closure_interval
from twin.gap.learned.search import Shaped, free_form, refined
from twin.gap.learned.wording import sentence
from twin.gap.null import NULL, Null
from twin.gap.refitted import with_constants
from twin.gap.score import Squares
from twin.gap.search import Explained, leaves_a_gap
from twin.gap.stages.free_term import FreeTerm
from twin.gap.stages.stage import Stage
from twin.gap.verdict import Judged
from twin.gap.wording import percent
from twin.learned.section import LearnedSection, Likeness
from twin.learned.sites import unit_at
from twin.learned.summed import summed
from twin.learned.term import Term
from twin.machine import MachineFile

Floats = NDArray[np.float64]
TERMS_MAX = 2
LIKE_MAX = 2
LIKE_LEAST = 0.05
"""Part of the gap that an effect has to close to be called near."""
CLOSES_LEAST = 0.1
"""Closure from which on a term is worth telling."""
REPEATS = (0.5, 1.5)
"""Size of a term in each run by itself, over that of all, within which it repeats."""


@dataclass(frozen=True, slots=True, eq=False)
class Described:
    """What was learned in a stage: the terms in the order in which they were found, and the hypothesis with all of them."""

    stage: Stage
    found: Fitted
    learned: tuple[Learned, ...]


def described_stages(
    stages: Sequence[Judged], progress: Callable[[str], None] = lambda _: None, null: Null = NULL
) -> tuple[Described, ...]:
    """Return what was learned in each stage in which something is left."""
    found = []
    for stage in stages:
        if stage.verdict in (Verdict.UNKNOWN, Verdict.PARTLY):
            progress(f"{stage.explained.stage.name}, what is in no catalogue")
            found.append(_described(stage.explained, stage.likeness, null))
    return tuple(one for one in found if one is not None)


def learned_of(described: Sequence[Described]) -> tuple[Learned, ...]:
    """Return all terms, the one that closes most first."""
    return tuple(sorted((term for one in described for term in one.learned), key=lambda term: -term.closure))


def with_learned(machine: MachineFile, described: Sequence[Described]) -> MachineFile:
    """Return the machine with the terms in it, and the constants that were fitted beside them."""
    sections = []
    for one in described:
        machine = with_constants(machine, one.stage, one.found)
        sections += [_section(term) for term in one.learned]
    return machine.model_copy(update={"learned": summed((*machine.learned, *sections))})


def _described(explained: Explained, likeness: Sequence[Effected], null: Null) -> Described | None:
    """The terms of one stage, the next on top of the last."""
    stage, parent = explained.stage, explained.best
    learned: list[Learned] = []
    for _ in range(TERMS_MAX):
        if learned and not leaves_a_gap(stage, parent):
            break
        shapes = free_form(stage, parent, null=null)
        if not shapes:
            break
        best = refined(stage, shapes[0], parent)
        one = _learned(explained, parent, best, likeness)
        if one.closure < CLOSES_LEAST:
            break
        learned.append(one)
        parent = best.found
    return Described(stage, parent, tuple(learned)) if learned else None


def _learned(explained: Explained, parent: Fitted, best: Shaped, likeness: Sequence[Effected]) -> Learned:
    term = fitted_term(best.term, best.found)
    known, closes = (closure_interval(_squares(explained.best.left), _squares(f.left)) for f in (parent, best.found))
    closure, low, high = (max(whole - known[0], 0.0) for whole in closes)  # on top of the terms before
    repeats = _repeats(explained.stage, best)
    return Learned(
        site=term.site.value,
        on=term.on,
        unit=unit_at(term.site, term.on),
        depends_on=term.depends_on,
        repeats=repeats,
        closure=round(closure, 4),
        closure_low=round(low, 4),
        closure_high=round(high, 4),
        table=term.table(),
        looks_like=_looks_like(explained, best, likeness),
        sentence=sentence(term, repeats=repeats),
    )


def fitted_term(term: FreeTerm, found: Fitted) -> Term:
    """Return a term of a hypothesis as a table with its band."""
    place = dict(found.model.term_places())[term]
    return term.term(found.theta[place], found.covariance[place, place])


def _squares(left: Left) -> dict[str, Squares]:
    columns = [(left.squares[:, i], left.counts[:, i]) for i in range(len(left.signals))]
    return {signal: Squares(ratio, count, count) for signal, (ratio, count) in zip(left.signals, columns, strict=True)}


def _repeats(stage: Stage, best: Shaped) -> bool:
    """Return True where the term has about its size in each run by itself that shows it."""
    model, theta = best.found.model, best.found.theta
    place = dict(model.term_places())[best.term]
    without = theta.copy()
    without[place] = 0.0
    sizes, worth = [], []
    for number, observed in enumerate(stage.observed):
        shown, bare = stage.predict(model, np.stack([theta, without]), number) / observed.sigma
        there = np.isfinite(observed.measured)
        own = np.where(there, shown - bare, 0.0)
        left = np.where(there, observed.measured / observed.sigma - bare, 0.0)
        sizes.append(float(own @ left / max(own @ own, 1e-12)))
        worth.append(float(own @ own))
    shows = [size for size, energy in zip(sizes, worth, strict=True) if energy > 0.01 * max(worth)]
    return all(REPEATS[0] < size < REPEATS[1] for size in shows)


def _looks_like(explained: Explained, best: Shaped, likeness: Sequence[Effected]) -> tuple[LooksLike, ...]:
    """The effects of the catalogue that were tried and are nearest, and what each leaves."""
    base = _excess(explained.base.left)
    near = []
    for tried in explained.tried:
        named = tried.effected in explained.best.effects
        if tried.found is None or named or base <= 0.0:
            continue
        closes = 1.0 - _excess(tried.found.left) / base
        if closes > LIKE_LEAST or tried.effected in likeness:
            worse = advantage(tried.found.left, best.found.left).sigmas > 2.0
            why = f"it closes {percent(max(closes, 0.0))}" + (", less than this does" if worse else "")
            near.append((closes, LooksLike(tried.effected.effect, tried.effected.on, why)))
    return tuple(one for _, one in sorted(near, key=lambda n: -n[0])[:LIKE_MAX])


def _excess(left: Left) -> float:
    return float(np.sum(np.maximum(left.rms() ** 2 - 1.0, 0.0)))


def _section(term: Learned) -> LearnedSection:
    """A term as it stands in machine.toml."""
    fields = {name: getattr(term, name) for name in ("site", "on", "unit", "depends_on", "repeats", "closure", "closure_low")}
    like = tuple(Likeness(effect=one.effect, on=one.on, why_not=one.why_not) for one in term.looks_like)
    more = {"closure_high": term.closure_high, "table": dict(term.table), "looks_like": like, "sentence": term.sentence}
    return LearnedSection.model_validate(fields | more)
