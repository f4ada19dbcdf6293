"""The parts of the answer that are words: causes, candidates, what can't be observed or identified, the verdict in a sentence."""

from collections.abc import Mapping, Sequence
from dataclasses import replace
from math import exp, sqrt

import numpy as np
from scipy.special import erfc

from twin.case import Case
from twin.effects.catalogue import catalogue, effect_named
from twin.effects.effect import Effect, On
from twin.gap.diagnosis import Candidate, Cause, Effected, GapNumbers, Interval, MovedConstant, NotObservable, Verdict
from twin.gap.evidence import advantage
from twin.gap.intervals import parameter_intervals
from twin.gap.naming.constants import said_of
from twin.gap.null import Null
from twin.gap.refitted import KNOWN_MIN
from twin.gap.search import Explained, is_nothing
from twin.gap.stages.axis import AxisStage
from twin.gap.stages.open_loop.stage import OpenStage
from twin.gap.stages.stage import Stage
from twin.gap.verdict import Judged
from twin.gap.wording import percent
from twin.runlog import AXIS_COLUMN


def found_effects(stages: Sequence[Judged]) -> list[tuple[Effected, dict[str, float]]]:
    """The causes of all stages with their parameters; one that several stages found, with the mean of what they found."""
    found: dict[Effected, list[dict[str, float]]] = {}
    for stage in stages:
        for effected, values in stage.explained.best.values.items():
            if not is_nothing(effected, values):
                found.setdefault(effected, []).append(values)
    return [(e, {k: float(np.mean([v[k] for v in values])) for k in values[0]}) for e, values in found.items()]


def causes_of(stages: Sequence[Judged], shares: Mapping[Effected, float]) -> tuple[Cause, ...]:
    """Return the causes, largest share first."""
    causes: dict[Effected, Cause] = {}
    for stage in stages:
        found = stage.explained
        intervals = parameter_intervals(found.best, _input_errors(found.stage))
        for effected, values in found.best.values.items():
            if is_nothing(effected, values):
                continue
            share = float(f"{shares.get(effected, 0.0):.4g}")
            rivals = tuple(r for r in found.rivals.get(effected, ()) if r not in causes)
            one = Cause(effected.effect, effected.on, _probability(found, effected), intervals[effected], rivals, share)
            causes[effected] = one if effected not in causes else _joined(causes[effected], one)
    return tuple(sorted(causes.values(), key=lambda c: -c.closure))


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


def sentence_of(
    verdict: Verdict, stages: Sequence[Judged], causes: Sequence[Cause], gap: GapNumbers, constants: Sequence[MovedConstant]
) -> str:
    """The verdict, as one would say it."""
    moved = said_of(constants)
    if verdict is Verdict.HEALTHY:
        leaves = f"{gap.before:.2g} × what repeated runs differ by"
        if moved:
            return f"Healthy, with {moved}: the twin is then {leaves}."
        return f"Healthy: with its constants refitted, the twin is {leaves}."
    if verdict is Verdict.EXPLAINED and not causes:
        return f"Explained by constants that are further off than stated: {moved}; no effect of the catalogue does so better."
    unknown = [s for s in stages if s.verdict is Verdict.UNKNOWN]
    if not causes:
        where = ", ".join(s.explained.stage.name for s in unknown)
        looks = [str(e) for s in unknown for e in s.likeness]
        partly = f"; it partly looks like {', '.join(looks)}, which does not explain it" if looks else ""
        return f"Unknown: a gap of {gap.before:.3g} × the floor in {where} that no effect of the catalogue explains{partly}."
    parts = [f"{percent(c.closure)} {'' if i else 'of the gap comes '}from {_said(c)}" for i, c in enumerate(causes)]
    left = max(0.0, 1.0 - gap.closure)
    rest = "" if verdict is Verdict.EXPLAINED else f"; {percent(left)} remains, cause unknown"
    if verdict is Verdict.PARTLY and unknown:
        rest += f" ({', '.join(s.explained.stage.name for s in unknown)})"
    head = "Explained" if verdict is Verdict.EXPLAINED else "Partly explained"
    return f"{head}: {'; '.join(parts)}{rest}."


def _said(cause: Cause) -> str:
    parameters = effect_named(cause.effect).parameters
    told = max((p for p in parameters if p.null is not None), key=lambda p: _clearness(cause.parameters[p.name], p.null))
    figure = figure_of(cause.parameters[told.name])
    size = figure if len(parameters) == 1 else f"{told.name} {figure}"
    rivals = ", ".join(_in_words(e.effect, e.on if e.on != cause.on else "") for e in cause.indistinguishable_from)
    return f"{_in_words(cause.effect, cause.on)} ({size}{f'; or {rivals}' if rivals else ''})"


def _clearness(interval: Interval, null: float | None) -> float:
    """Return the half-widths of its interval by which a figure is away from nothing."""
    if null is None or not np.isfinite(null):
        return np.inf
    return abs(interval.value - null) / max((interval.high - interval.low) / 2.0, 1e-12)


def _in_words(effect: str, on: str) -> str:
    """
    >>> _in_words("direction_friction", "x"), _in_words("sensor_bias", "z_torque_a")
    ('direction friction on X', 'sensor bias on z_torque_a')
    """
    where = on.upper() if len(on) == 1 else on
    return f"{effect.replace('_', ' ')}{f' on {where}' if on else ''}"


def figure_of(interval: Interval) -> str:
    """A figure with the half of its interval, as sentences have it."""
    half = (interval.high - interval.low) / 2.0
    return f"{interval.value:.3g} ± {half:.1g} {interval.unit}".strip()
