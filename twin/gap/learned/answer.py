"""The learned terms of a diagnosis: what is left in each stage that no named cause explains, described and put into the twin.

A term is a description, not a cause. Its closure is of what is left beside the named causes, on runs that were not fitted.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from twin.gap.diagnosis import Effected, Learned, LooksLike, Verdict
from twin.gap.evidence import advantage
from twin.gap.fitting import Fitted, Left
from twin.gap.intervals import Z90, closure_interval
from twin.gap.learned.learnable import Learnable
from twin.gap.learned.over_time import reconstructed
from twin.gap.learned.pushes import time_sentence
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
from twin.learned.words import TIME, LearnedSite
from twin.machine import MachineFile

Floats = NDArray[np.float64]
TERMS_MAX = 2
LIKE_MAX = 2
LIKE_LEAST = 0.05
"""Part of the gap that an effect has to close to be called near."""
CLOSES_LEAST = 0.1
"""Closure from which on a term is worth telling."""
TIME_CLOSES_LEAST = 0.5
"""The same of a force over time, which follows much that is no force as well."""
REPEATS = (0.5, 1.5)
"""Size of a term in each run by itself, over that of all, within which it repeats."""


@dataclass(frozen=True, slots=True, eq=False)
class Described:
    """The terms learned in a stage, in the order in which they were found, and the hypothesis with all of them."""

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
    """The terms of one stage, the next on top of the last; each as the hypothesis with all of them has it."""
    stage, parent = explained.stage, explained.best
    found: list[tuple[Shaped, tuple[float, float, float]]] = []
    for _ in range(TERMS_MAX):
        if found and not leaves_a_gap(stage, parent):
            break
        shapes = free_form(stage, parent, null=null)
        if not shapes:
            break
        best = refined(stage, shapes[0], parent)
        closures = _closures(explained, parent, best.found)
        if closures[0] < CLOSES_LEAST:
            break
        found.append((best, closures))
        parent = best.found
    learned = [_learned(explained, replace(one, found=parent), closures, likeness) for one, closures in found]
    if not learned and leaves_a_gap(stage, parent) and isinstance(stage, Learnable):
        over_time = _over_time(stage, parent)
        learned += [over_time] if over_time is not None else []
    return Described(stage, parent, tuple(learned)) if learned else None


def _closures(explained: Explained, parent: Fitted, found: Fitted) -> tuple[float, float, float]:
    """Closure of a term on top of the terms before it, with its interval."""
    known, closes = (closure_interval(_squares(explained.best.left), _squares(f.left)) for f in (parent, found))
    closure, low, high = (max(whole - known[0], 0.0) for whole in closes)
    return closure, low, high


def _over_time(stage: Learnable, parent: Fitted) -> Learned | None:
    """The force that is left where nothing else explains it: it goes with the time of each run; None where it closes little."""
    runs = reconstructed(stage, parent)
    judging = [r for r in runs if not stage.observed[r.run].fitted] or list(runs)
    if not judging:
        return None
    before, after = (_squares_of_runs(stage, [(r.run, getattr(r, which)) for r in judging]) for which in ("before", "after"))
    closure, low, high = closure_interval(before, after)
    if closure < TIME_CLOSES_LEAST:
        return None
    letter = stage.term_sites[LearnedSite.AXIS_FORCE][0]
    unit = unit_at(LearnedSite.AXIS_FORCE, letter)
    told = []
    for r in runs:
        arguments = stage.term_arguments(r.run)
        told.append((r.at_s, r.force, np.interp(r.at_s, arguments[TIME], arguments["position_mm"])))
    names = [name for r in runs for name in [stage.observed[r.run].name] * len(r.at_s)]
    columns = {TIME: [r.at_s for r in runs], "value": [r.force for r in runs]}
    columns |= {"low": [r.force - Z90 * r.error for r in runs], "high": [r.force + Z90 * r.error for r in runs]}
    table: dict[str, tuple[float | str, ...]] = {
        name: tuple(float(f"{v:.6g}") for v in np.concatenate(parts)) for name, parts in columns.items()
    }
    return Learned(
        site=LearnedSite.AXIS_FORCE.value,
        on=letter,
        unit=unit,
        depends_on=("time",),
        repeats=False,
        closure=round(closure, 4),
        closure_low=round(low, 4),
        closure_high=round(high, 4),
        table={TIME: table.pop(TIME), "run": tuple(names), **table},
        looks_like=(),
        sentence=time_sentence(letter, unit, told),
    )


def _squares_of_runs(stage: Learnable, parts: Sequence[tuple[int, Floats]]) -> dict[str, Squares]:
    """signal → squares by time block, of residuals in floors."""
    found: dict[str, list[tuple[Floats, Floats]]] = {}
    for number, residual in parts:
        observed = stage.observed[number]
        _, block = np.unique(observed.block, return_inverse=True)
        for index, signal in enumerate(observed.signals):
            there = np.isfinite(residual) & (observed.signal == index)
            many = int(block.max(initial=0)) + 1
            counts = np.bincount(block[there], minlength=many).astype(np.float64)
            squares = np.bincount(block[there], weights=residual[there] ** 2, minlength=many).astype(np.float64)
            found.setdefault(signal, []).append((squares, counts))
    joined = {signal: [np.concatenate(part) for part in zip(*own, strict=True)] for signal, own in found.items()}
    return {signal: Squares(squares, counts, counts) for signal, (squares, counts) in joined.items()}


def _learned(explained: Explained, best: Shaped, closures: tuple[float, float, float], likeness: Sequence[Effected]) -> Learned:
    term = fitted_term(best.term, best.found)
    closure, low, high = closures
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
