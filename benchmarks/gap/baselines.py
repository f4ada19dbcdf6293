"""Measure what the gap diagnosis is measured against: three plain ways to name the cause of a gap.

* smallest BIC: each effect of the catalogue is fitted in the sample, linearly about a typical size and with the machine's
  constants as nuisance; the one with the smallest Bayesian information criterion (Schwarz 1978) is named, where any lowers it
* sparse regression: the residual on the signatures of all effects at once, by the lasso with the BIC's penalty (Zou, Hastie,
  Tibshirani 2007), constants as nuisance; what makes up at least a floor of the residual is named, the three largest at most
* random forest: features of the residual by signal and regime, trained on cases that the twin simulates; effect and axis of the
  most probable class, unknown where it has less than half of the votes

All three see the fit runs only, and the machine as it is stated.
"""

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray
from sklearn.ensemble import RandomForestClassifier
from sklearn.linear_model import LassoLarsIC

from twin.case import Case, RunKind
from twin.effects.catalogue import catalogue
from twin.effects.effect import On
from twin.errors import TwinError
from twin.gap.diagnosis import Cause, Diagnosed, Diagnosis, GapNumbers, Verdict
from twin.gap.labels import measured_signals, regimes_of
from twin.machine import AddedEffect, MachineFile, machine_from_toml
from twin.machine_toml import machine_to_toml
from twin.runlog import RunLog
from twin.simulator.recorded import noise_of, told_of
from twin.simulator.response import RunInput, respond

Floats = NDArray[np.float64]
EVERY = 7
"""One of so many samples of a fast run is taken."""
VOTES_MIN = 0.5
CAUSES_MAX = 3


@dataclass(frozen=True, slots=True, eq=False)
class Seen:
    """A run as the baselines see it: recording, what the machine was told, floors by signal."""

    log: RunLog
    told: RunInput
    floors: dict[str, float]
    recorded: dict[str, Floats] | None


def seen_of(case: Case) -> list[Seen]:
    """The first fit run of each kind, with floors from its repeat, or the noise of the sensors."""
    seen = []
    for kind in RunKind:
        fit = case.of(kind, "fit")
        if not fit:
            continue
        log = fit[0].log
        again = next((other.log for one, other in case.repeats() if one is fit[0]), None)
        floors = {}
        for name in measured_signals(log):
            floor = noise_of(case.machine, log, name)
            if again is not None and again.has(name):
                floor = max(floor, float(np.sqrt(np.nanmean((log[name] - again[name]) ** 2) / 2.0)))
            floors[name] = floor
        recorded = {"spindle_load_pct": log["spindle_load_pct"]} if not log.axes() else None
        seen.append(Seen(log, told_of(log, case.machine), floors, recorded))
    return seen


def vector(machine: MachineFile, seen: list[Seen], *, measured: bool = False) -> Floats:
    """All signals of the runs over their floors, one after the other: of the twin, or as measured; (n,)."""
    parts = []
    for one in seen:
        columns = None if measured else respond(machine, one.told, recorded=one.recorded, courses=1).columns
        for name, floor in one.floors.items():
            if one.recorded and name in one.recorded:
                continue
            values = one.log[name] if columns is None else columns.get(name, np.full(len(one.log), np.nan))
            there = np.isfinite(one.log[name])
            step = EVERY if int(there.sum()) > 5000 and one.log.axes() else 1
            parts.append(values[there][::step] / floor)
    return np.nan_to_num(np.concatenate(parts))


def candidates(case: Case) -> Iterator[AddedEffect]:
    """Every effect of the catalogue on everything that it can be put on in this case, at its typical size."""
    signals = sorted({name for run in case.of(role="fit") for name in measured_signals(run.log)})
    for name, effect in catalogue().items():
        places = {On.AXIS: list(case.machine.axes), On.SIGNAL: signals, On.MACHINE: [""]}[effect.on]
        yield from (AddedEffect(effect=name, on=on, parameters=effect.typical_values()) for on in places)


@dataclass(frozen=True, slots=True, eq=False)
class Linear:
    """The residual, the nuisance columns scaled to one standard deviation, and the candidates' signatures."""

    residual: Floats
    nuisance: Floats
    effects: list[AddedEffect]
    signatures: Floats


def linear_of(case: Case) -> Linear:
    """Differences of the twin: with each constant one standard deviation up, and with each effect at its typical size."""
    seen = seen_of(case)
    base = vector(case.machine, seen)
    nuisance = [vector(machine, seen) - base for machine in _nudged(case.machine)]
    effects, signatures = [], []
    for effect in candidates(case):
        try:
            signature = vector(case.machine.model_copy(update={"effects": (effect,)}), seen) - base
        except TwinError:
            continue
        if np.abs(signature).max() > 1e-3:
            effects.append(effect)
            signatures.append(signature)
    return Linear(vector(case.machine, seen, measured=True) - base, np.array(nuisance).T, effects, np.array(signatures).T)


def _nudged(machine: MachineFile) -> Iterator[MachineFile]:
    """The machine with each of its uncertain constants up by its standard deviation."""
    step = 1.0 + machine.uncertainty.get("relative", 0.05)
    for letter, axis in machine.axes.items():
        friction = ("coulomb_n", "static_n", "viscous_n_s_per_mm", "stribeck_velocity_mm_s")
        nudged = [axis.model_copy(update={"mass_kg": axis.mass_kg * step})]
        if axis.torque_constant_nm_per_a is not None:
            nudged.append(axis.model_copy(update={"torque_constant_nm_per_a": axis.torque_constant_nm_per_a * step}))
        for key in friction:
            value = getattr(axis.friction, key)
            if isinstance(value, float):
                nudged.append(axis.model_copy(update={"friction": axis.friction.model_copy(update={key: value * step})}))
        yield from (machine.model_copy(update={"axes": {**machine.axes, letter: one}}) for one in nudged)
    parts = {
        "tool": ("tangential_coefficient_n_per_mm2", "radial_ratio"),
        "spindle": ("efficiency", "idle_power_kw"),
        "thermal": ("alpha_w_per_pct_rpm2", "beta_w_per_rpm", "resistance_k_per_w"),
    }
    for part, keys in parts.items():
        section = getattr(machine, part)
        if section is not None:
            yield from (
                machine.model_copy(update={part: section.model_copy(update={key: getattr(section, key) * step})}) for key in keys
            )


def without_nuisance(linear: Linear) -> tuple[Floats, Floats]:
    """Residual and signatures less what the constants can make of them within their uncertainty, by a ridge."""
    j = linear.nuisance
    inner = np.linalg.inv(np.eye(j.shape[1]) + j.T @ j)

    def off(values: Floats) -> Floats:
        return np.asarray(values - j @ (inner @ (j.T @ values)))

    return off(linear.residual), off(linear.signatures)


def smallest_bic(case: Case) -> Diagnosed:
    """Names the effect with the smallest BIC in the sample."""
    linear = linear_of(case)
    residual, signatures = without_nuisance(linear)
    n = len(residual)
    power = np.maximum((signatures**2).sum(axis=0), 1e-12)
    size = signatures.T @ residual / power
    rss = (residual**2).sum() - size**2 * power
    parameters = np.array([sum(p.null is not None for p in catalogue()[e.effect].parameters) for e in linear.effects])
    bic = n * np.log(np.maximum(rss, 1e-9) / n) + parameters * np.log(n)
    best = int(np.argmin(bic))
    named = [best] if bic[best] < n * np.log((residual**2).sum() / n) else []
    return answer(case, [(linear.effects[i], float(size[i])) for i in named])


def sparse_regression(case: Case) -> Diagnosed:
    """Names what the lasso keeps."""
    linear = linear_of(case)
    residual, signatures = without_nuisance(linear)
    scale = np.maximum(np.sqrt((signatures**2).mean(axis=0)), 1e-9)
    variance = max(float(np.median(np.abs(residual)) / 0.6745) ** 2, 1.0)
    fit = LassoLarsIC(criterion="bic", fit_intercept=False, noise_variance=variance, max_iter=60).fit(
        signatures / scale, residual
    )
    share = np.abs(fit.coef_)
    kept = [int(i) for i in np.argsort(-share)[:CAUSES_MAX] if share[i] >= 1.0]
    return answer(case, [(linear.effects[i], float(fit.coef_[i] / scale[i])) for i in kept])


def answer(case: Case, named: list[tuple[AddedEffect, float]], *, unknown: bool = False) -> Diagnosed:
    """A diagnosis that names these effects, each at so many times its typical size, or none."""
    verdict = Verdict.UNKNOWN if unknown else Verdict.EXPLAINED if named else Verdict.HEALTHY
    causes = tuple(Cause(effect.effect, effect.on, 1.0, {}, (), 0.0) for effect, _ in named)
    numbers = GapNumbers(1.0, 1.0, 1.0, 1.0, 0.0, 0.0, 0.0, {})
    added = tuple(sized for effect, size in named if (sized := _sized(effect, size)) is not None)
    twin = case.machine.model_copy(update={"effects": added})
    return Diagnosed(Diagnosis(verdict, "", (), (), (), causes, numbers, (), (), (), None, (), 0.0), twin)


def _sized(effect: AddedEffect, size: float) -> AddedEffect | None:
    """The effect with what departs from null so many times as large, within its bounds."""
    values = {}
    for p in catalogue()[effect.effect].parameters:
        typical = effect.parameters[p.name]
        if p.null is None:
            values[p.name] = typical
        elif np.isfinite(p.null):
            values[p.name] = float(np.clip(p.null + size * (typical - p.null), p.low, p.high))
        elif size <= 0.0:
            return None
        else:
            values[p.name] = float(np.clip(typical / size, p.low, p.high))
    return AddedEffect(effect=effect.effect, on=effect.on, parameters=values)


FEATURE_SIGNALS = (
    *(f"{axis}_{what}" for axis in "xyz" for what in ("pos_mm", "table_mm", "torque_a")),
    *("force_x_n", "force_y_n", "spindle_load_pct", "spindle_temp_c"),
)
FEATURE_REGIMES = ("rest", "reversal", "acceleration", "constant speed -", "constant speed +")


def features(machine: MachineFile, seen: list[Seen], residual: list[dict[str, Floats]]) -> Floats:
    """Return for each signal: rms, mean and drift over its floor; of an axis' signals by regime as well; 0 where there is
    none."""
    row: list[float] = []
    for name in FEATURE_SIGNALS:
        at = next((i for i, one in enumerate(seen) if name in residual[i] and one.log.has(name)), None)
        if at is None:
            row += [0.0] * (3 + 2 * len(FEATURE_REGIMES))
            continue
        error = residual[at][name] / seen[at].floors[name]
        kept = error[np.isfinite(error)]
        half = len(kept) // 2
        row += [_squashed(np.sqrt(np.mean(kept**2))), _squashed(kept.mean()), _squashed(kept[half:].mean() - kept[:half].mean())]
        regimes = dict(regimes_of(seen[at].log, name, machine))
        for regime in FEATURE_REGIMES:
            there = error[regimes[regime] & np.isfinite(error)] if regime in regimes else np.zeros(0)
            row += [_squashed(np.sqrt(np.mean(there**2))), _squashed(there.mean())] if len(there) else [0.0, 0.0]
    return np.array(row)


def _squashed(value: Any) -> float:
    """Its logarithm, sign kept, so that sizes of all orders are told apart."""
    return float(np.sign(value) * np.log1p(abs(value)))


def _residual(machine: MachineFile, one: Seen, columns: dict[str, Floats]) -> dict[str, Floats]:
    twin = respond(machine, one.told, recorded=one.recorded, courses=1).columns
    left = {name: columns[name] - twin[name] for name in one.floors if name in twin and name in columns}
    return {name: values for name, values in left.items() if not (one.recorded and name in one.recorded)}


def simulated_rows(case: Case, count: int, seed: int) -> tuple[list[Floats], list[str]]:
    """Features and labels of `count` machines like that of the case, simulated by the twin: scattered, some with an effect."""
    chance = np.random.default_rng(seed)
    seen, tried = seen_of(case), list(candidates(case))
    rows, labels = [], []
    while len(rows) < count:
        healthy = chance.random() < 0.2
        effect = tried[int(chance.integers(len(tried)))]
        sized = None if healthy else _sized(effect, float(np.exp(chance.normal(0.0, 1.0)) * chance.choice([-1.0, 1.0])))
        true = machine_from_toml(machine_to_toml(_scattered(case.machine, chance)))
        true = true.model_copy(update={"effects": () if sized is None else (sized,)})
        try:
            columns = [respond(true, one.told, recorded=one.recorded, seed=int(chance.integers(2**31))).columns for one in seen]
            residual = [_residual(case.machine, one, made) for one, made in zip(seen, columns, strict=True)]
        except TwinError:
            continue
        rows.append(features(case.machine, seen, residual))
        labels.append("healthy" if sized is None else f"{sized.effect}@{sized.on}")
    return rows, labels


def _scattered(machine: MachineFile, chance: np.random.Generator) -> MachineFile:
    """A machine of which the stated one is a fair description, and on which a force nobody commands acts."""
    relative = machine.uncertainty.get("relative", 0.05)

    def off(value: float) -> float:
        return value * (1.0 + relative * float(chance.standard_normal()))

    axes = {}
    for letter, axis in machine.axes.items():
        rubs = {k: off(v) for k, v in axis.friction.model_dump().items()}
        rubs["static_n"] = max(rubs["static_n"], rubs["coulomb_n"])
        friction = axis.friction.model_copy(update=rubs)
        constant = None if axis.torque_constant_nm_per_a is None else off(axis.torque_constant_nm_per_a)
        axes[letter] = axis.model_copy(
            update={"mass_kg": off(axis.mass_kg), "torque_constant_nm_per_a": constant, "friction": friction}
        )
    noise = dict(machine.noise) | {"disturbance_force_n": 1.0, "disturbance_correlation_s": 0.05}
    return machine.model_copy(update={"axes": axes, "noise": noise})


def forest_of(cases: list[Case], each: int, seed: int) -> RandomForestClassifier:
    """A forest trained on `each` simulated machines for each of the cases, of which only the programs and machines are used."""
    rows, labels = [], []
    for number, case in enumerate(cases):
        more_rows, more_labels = simulated_rows(case, each, seed + number)
        rows += more_rows
        labels += more_labels
    return RandomForestClassifier(n_estimators=300, min_samples_leaf=2, random_state=seed, n_jobs=1).fit(np.array(rows), labels)


def by_forest(forest: RandomForestClassifier, case: Case) -> Diagnosed:
    """Names the class with most of the votes, where it has half of them."""
    seen = seen_of(case)
    residual = [_residual(case.machine, one, dict(one.log.columns)) for one in seen]
    votes = forest.predict_proba(features(case.machine, seen, residual)[None, :])[0]
    best = int(np.argmax(votes))
    name, _, on = str(forest.classes_[best]).partition("@")
    if name == "healthy" and votes[best] >= VOTES_MIN:
        return answer(case, [])
    if votes[best] < VOTES_MIN or name == "healthy":
        return answer(case, [], unknown=True)
    effect = AddedEffect(effect=name, on=on, parameters=catalogue()[name].typical_values())
    return answer(case, [(effect, 1.0)])
