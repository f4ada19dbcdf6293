"""The parts of the answer that are words: causes, candidates, what can't be observed or identified, the verdict in a sentence."""

from collections.abc import Mapping, Sequence
from dataclasses import replace
from math import exp, sqrt

import numpy as np
from scipy.special import erfc

from twin.case import Case
from twin.effects.catalogue import catalogue, effect_named
from twin.effects.effect import Effect, On
from twin.gap.diagnosis import Candidate, Cause, Effected, Interval, NotObservable
from twin.gap.evidence import advantage
from twin.gap.intervals import parameter_intervals
from twin.gap.null import Null
from twin.gap.refitted import KNOWN_MIN
from twin.gap.search import Explained, is_nothing
from twin.gap.stages.axis import AxisStage
from twin.gap.stages.open_loop.stage import OpenStage
from twin.gap.stages.stage import Stage
from twin.gap.verdict import Judged
from twin.runlog import AXIS_COLUMN


def found_effects(stages: Sequence[Judged]) -> list[tuple[Effected, dict[str, float]]]:
    """The causes of all stages with their parameters; one that several stages found, with the mean of what they found."""
    found: dict[Effected, list[dict[str, float]]] = {}
    for stage in stages:
        for effected, values in stage.explained.best.values.items():
            if not is_nothing(effected, values):
                found.setdefault(effected, []).append(values)
    return [(e, {k: float(np.mean([v[k] for v in values])) for k in values[0]}) for e, values in found.items()]


def causes_of(stages: Sequence[Judged], shares: Mapping[Effected, float], assumed: Sequence[str] = ()) -> tuple[Cause, ...]:
    """Return the causes, largest share first. assumed: columns that nobody recorded, and that may be off themselves"""
    causes: dict[Effected, Cause] = {}
    for stage in stages:
        found = stage.explained
        intervals = parameter_intervals(found.best, _input_errors(found.stage))
        for effected, values in found.best.values.items():
            if is_nothing(effected, values):
                continue
            share = float(f"{shares.get(effected, 0.0):.4g}")
            rivals = tuple(r for r in found.rivals.get(effected, ()) if r not in causes)
            rivals += _assumed_rivals((effected, *rivals), assumed)
            one = Cause(effected.effect, effected.on, _probability(found, effected), intervals[effected], rivals, share)
            causes[effected] = one if effected not in causes else _joined(causes[effected], one)
    return tuple(sorted(causes.values(), key=lambda c: -c.closure))


def _assumed_rivals(alike: Sequence[Effected], assumed: Sequence[str]) -> tuple[Effected, ...]:
    """Return what would be the same on an input that is assumed: a bias of the spindle's temperature is other surroundings."""
    inputs = [(one.effect, effect_named(one.effect).same_on.get(one.on)) for one in alike]
    return tuple(dict.fromkeys(Effected(effect, on) for effect, on in inputs if on is not None and on in assumed))


def _input_errors(stage: Stage) -> dict[str, float]:
    """Return the relative standard errors of what a stage is driven by, by quantity."""
    axis = stage.closed if isinstance(stage, OpenStage) else stage
    return {"temperature_rise_k": max(run.rise_error for run in axis.runs)} if isinstance(axis, AxisStage) else {}


def _joined(one: Cause, other: Cause) -> Cause:
    """Join what two stages found of one effect: the mean, and an interval that holds both."""
    both = {
        name: Interval(
            (one.parameters[name].value + other.parameters[name].value) / 2.0,
            min(one.parameters[name].low, other.parameters[name].low),
            max(one.parameters[name].high, other.parameters[name].high),
            one.parameters[name].unit,
        )
        for name in one.parameters
    }
    return replace(one, probability=max(one.probability, other.probability), parameters=both, indistinguishable_from=())


def _probability(found: Explained, effected: Effected) -> float:
    """Weigh this effect against what cannot be told from it, by how well each follows; sensors are wrong less often."""
    tried = {t.effected: t for t in found.tried}
    weights = []
    for other in (effected, *found.rivals.get(effected, ())):
        prior = 0.15 if effect_named(other.effect).is_of_measurement else 1.0
        one = tried.get(other)
        best = tried.get(effected)
        behind = 0.0
        if one is not None and best is not None and one.found is not None and best.found is not None:
            behind = advantage(one.found.left, best.found.left).sigmas
        weights.append(prior * exp(-(max(behind, 0.0) ** 2) / 2.0))
    evidence = found.evidence.get(effected)
    sure = 1.0 if evidence is None else 1.0 - 0.5 * float(erfc(max(evidence.sigmas, 0.0) / 2.0 / sqrt(2.0)))
    return round(sure * weights[0] / sum(weights), 3)


def candidates_of(stages: Sequence[Judged], null: Null) -> tuple[Candidate, ...]:
    """All that were tried alone on top of the refitted machine, best first."""
    found: dict[Effected, Candidate] = {}
    for stage in stages:
        base = stage.explained.base.left
        for tried in stage.explained.tried:
            closure, p = 0.0, 1.0
            if tried.found is not None and tried.over is not None:
                squares = [np.maximum(left.rms() ** 2 - 1.0, 0.0).sum() for left in (base, tried.found.left)]
                closure = float(np.clip(1.0 - squares[1] / squares[0], 0.0, 1.0)) if squares[0] > 0.0 else 0.0
                p = null.p_value(tried.over)
            one = Candidate(tried.effected.effect, tried.effected.on, round(closure, 4), float(f"{p:.3g}"))
            if tried.effected not in found or one.p_value < found[tried.effected].p_value:
                found[tried.effected] = one
    return tuple(sorted(found.values(), key=lambda c: (c.p_value, -c.closure)))


def not_observable_of(case: Case, stages: Sequence[Judged], left_out: frozenset[str]) -> tuple[NotObservable, ...]:
    """Effects that no run could have shown, and why."""
    tried = {e.effect for s in stages for e in s.explained.stage.candidates}
    columns = {c for run in case.of(role="fit") for c in run.log.columns if run.log.has(c)}
    said = []
    for effect in catalogue().values():
        if effect.name in tried | left_out:
            continue
        said.append(NotObservable(effect.name, _why(effect, columns, case)))
    return tuple(said)


def _why(effect: Effect, columns: set[str], case: Case) -> str:
    kinds = {run.entry.kind.value for run in case.of(role="fit")}
    if effect.site.name == "PROGRAM":
        return "no run of kind program" if "program" not in kinds else "how long the program took is diagnosed by itself"
    if "temperature_rise_k" in effect.needs and "spindle_temp_c" not in columns:
        return "no table-side position beside spindle_temp_c in any run"
    letters = sorted({m[1] for c in columns if (m := AXIS_COLUMN.match(c))}) or ["a"]
    shown = [s.replace("{a}", letters[0]) for s in effect.shows_in if "{s}" not in s]
    there = [s for s in shown if s in columns]
    if there and effect.on is On.MACHINE:
        return f"{', '.join(there)} without the speed, engagement, load or surroundings that drive it, or never switched"
    if there:
        return "not at the rate of these recordings, or the machine does not state what it needs"
    return f"no {', '.join(shown[:3])} in any run that is fitted" if shown else "no signal for it in any run"


def not_identifiable_of(stages: Sequence[Judged]) -> tuple[str, ...]:
    """Constants that these runs say nothing of beyond what the machine states."""
    said = []
    for stage in stages:
        best = stage.explained.best
        for free, known in zip(best.model.constants, best.known, strict=False):
            if known < KNOWN_MIN:
                where = stage.explained.stage.name
                said.append(f"{where}: {free.name}: these runs do not tell it; the stated value and its uncertainty stand")
    return tuple(said)
