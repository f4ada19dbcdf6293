"""Effects of the control fitted to recorded runs of programs, in seconds between lines.

With the active seconds T between two lines of a run, least squares over windows of a second or more (a recorder asks a control a
few times a second), each residual counting linearly beyond 0.3 s:

    min Σ 2 s² (√(1 + ((T_twin − T) / s)²) − 1) + (0.1 s)² Σ z²,    s = 0.3 s

The parameters are free in their logarithm, z being their distance from what is typical in decades of e; so a parameter that the
runs say nothing of stays there, and its interval says so. Where the reference position of Z is, seen from the work, no machine
description says: it is free too, the same with and without effects, and no cause.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import least_squares

from twin.effects.catalogue import effect_named
from twin.effects.effect import Effect, Parameter
from twin.gap.diagnosis import Interval
from twin.gap.programs.trial import Trial
from twin.identification.estimate import clustered_covariance
from twin.motion.control import Control, changed
from twin.motion.limits import Limits
from twin.motion.plan import Plan
from twin.recording.recorded_program import NOMINAL, kept_apart, line_starts, windows

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]
Values = Mapping[str, Mapping[str, float]]
"""Effect → parameter → value."""

HICCUP_S = 0.3
"""Residuals beyond this count linearly (soft L1)."""
PRIOR_S = 0.1
SPREAD = 1.5
"""One standard deviation of the logarithm of a parameter, a factor of 4.5; of those without a null value a third."""
REFERENCE_MM = (0.0, 600.0)
REFERENCE_START_MM = 200.0
REFERENCE_SCALE_MM = 100.0
DETERMINED = 0.7
"""The runs know a parameter where its logarithm has less than this part of its spread before them."""
Z_90 = 1.6448536269514722
LONG_WINDOW_S = 10.0
"""Length of the windows that are judged: the recorder errs at the ends of a window only, and in a long one small gaps add up."""
BLOCK_WINDOWS = 10
SMALLEST = 1e-4
ENOUGH = 1e-4
STEP = 1e-3
INSIDE = 1e-6
"""Settings of the search: a gain that counts as none, the step of a difference, the distance from a bound at its start."""


@dataclass(frozen=True)
class Watched:
    """A run with the lines at which it is compared. begin: active seconds (k,) at the lines `line` (k,)."""

    trial: Trial
    begin: Floats
    line: Ints

    @classmethod
    def of(cls, trial: Trial, shortest_s: float) -> "Watched":
        """Windows of at least `shortest_s`, the last one to the end of the run."""
        begin, line = windows(trial.recorded, shortest_s)
        ends = trial.told_s(np.append(begin, trial.recorded.run.active_s))
        return cls(trial, ends, np.append(line, np.iinfo(np.int32).max))

    @cached_property
    def overrides(self) -> tuple[Floats, Floats]:
        """Feed and rapid override (segments,) as recorded."""
        return self.trial.recorded.overrides()

    @property
    def recorded_s(self) -> Floats:
        """Seconds of each window, (k − 1,)."""
        return np.asarray(np.diff(self.begin))

    def plan(self, model: "Model") -> Plan:
        """The run's program on the control of a model, driven with the recorded overrides."""
        recorded = self.trial.recorded
        path = recorded.with_set_up(NOMINAL._replace(reference_z=model.reference_mm)) if self.trial.references else recorded.path
        return model.control.plan(path, *self.overrides)

    def planned_s(self, plan: Plan) -> Floats:
        """Seconds at which each window begins in a plan, (k,), the last its end."""
        return line_starts(plan, self.line)

    @cached_property
    def sparse(self) -> Ints:
        """Which of the lines are LONG_WINDOW_S or more apart."""
        return kept_apart(self.begin, LONG_WINDOW_S)

    def gaps_s(self, model: "Model") -> Floats:
        """Twin minus recording in each window, and then in each long one."""
        apart = self.planned_s(self.plan(model)) - self.begin
        return np.concatenate([np.diff(apart), np.diff(apart[self.sparse])])

    def gap_s(self, model: "Model") -> Floats:
        """Twin minus recording in each window, (k − 1,)."""
        return np.asarray(np.diff(self.planned_s(self.plan(model))) - self.recorded_s)


@dataclass(frozen=True)
class Model:
    """A hypothesis: the limits as stated, effects with their parameters on top, and the reference position of Z."""

    stated: Limits
    effects: Values
    reference_mm: float = REFERENCE_START_MM

    @cached_property
    def control(self) -> Control:
        """The control with the effects."""
        return changed(self.stated, self.effects)

    def without(self, name: str) -> "Model":
        """The model with one effect left out, all else as it is."""
        return Model(self.stated, {n: values for n, values in self.effects.items() if n != name}, self.reference_mm)


@dataclass(frozen=True)
class Fitted:
    """A fitted model. spread: (effect, parameter) → one standard deviation of its logarithm; cost: what was minimised, s²."""

    model: Model
    spread: Mapping[tuple[str, str], float]
    cost: float

    def intervals(self, name: str) -> dict[str, Interval]:
        """The parameters of an effect with their 90 % intervals."""
        found = {}
        for p in effect_named(name).parameters:
            value, factor = self.model.effects[name][p.name], float(np.exp(Z_90 * min(self.spread[name, p.name], 10.0)))
            found[p.name] = Interval(value, max(value / factor, p.low), min(value * factor, p.high), p.unit)
        return found

    def unknown(self, name: str) -> tuple[str, ...]:
        """Parameters of an effect that the runs say nothing of."""
        effect = effect_named(name)
        return tuple(p.name for p in effect.parameters if self.spread[name, p.name] > DETERMINED * _spread(p))


def fit(runs: Sequence[Watched], stated: Limits, names: Sequence[str], already: Values, near: Model | None = None) -> Fitted:
    """The effects `names` fitted to `runs`, on top of those that the machine has `already`; the search begins `near` a model."""
    free = [(effect_named(name), p) for name in names for p in effect_named(name).parameters]
    moved = any(run.trial.references for run in runs)

    def model(x: Floats) -> Model:
        values: dict[str, dict[str, float]] = {name: dict(own) for name, own in already.items()}
        for (effect, p), one in zip(free, x.tolist(), strict=False):
            values.setdefault(effect.name, {})[p.name] = float(np.clip(_centre(p) * np.exp(one), p.low, p.high))
        reference = REFERENCE_START_MM + REFERENCE_SCALE_MM * float(x[-1]) if moved else REFERENCE_START_MM
        return Model(stated, values, reference)

    spread = np.array([_spread(p) for _, p in free] + ([3.0] if moved else []))

    def residuals(x: Floats) -> Floats:
        return np.concatenate([*(run.gaps_s(model(x)) for run in runs), PRIOR_S * x / spread])

    if not len(spread):
        return Fitted(model(np.zeros(0)), {}, 0.0)
    ends = np.array([_ends(p) for _, p in free] + ([_reference_ends()] if moved else []))
    found = least_squares(
        residuals,
        np.clip(_start(free, moved, near), ends[:, 0] + INSIDE, ends[:, 1] - INSIDE),
        loss="soft_l1",
        f_scale=HICCUP_S,
        diff_step=np.full(len(spread), STEP),
        x_scale=0.3,
        ftol=ENOUGH,
        xtol=ENOUGH,
        bounds=(ends[:, 0], ends[:, 1]),
    )
    deviation = _deviation(np.asarray(found.jac), np.asarray(found.fun), spread)
    spreads = {(e.name, p.name): float(s) for (e, p), s in zip(free, deviation, strict=False)}
    return Fitted(model(found.x), spreads, float(found.cost))


def _start(free: Sequence[tuple[Effect, Parameter]], moved: bool, near: Model | None) -> Floats:
    """Return what a model has, else what is expected."""
    if near is None:
        return np.zeros(len(free) + moved)
    x = [
        np.log(max(near.effects.get(e.name, {}).get(p.name, _centre(p)), p.low, SMALLEST * _centre(p)) / _centre(p))
        for e, p in free
    ]
    return np.array(x + ([(near.reference_mm - REFERENCE_START_MM) / REFERENCE_SCALE_MM] if moved else []))


def _centre(p: Parameter) -> float:
    """Return where a parameter is expected: a ratio at its null value, any other at what is typical."""
    return p.null if p.null is not None and np.isfinite(p.null) and p.null > 0.0 else p.typical


def _spread(p: Parameter) -> float:
    return SPREAD if p.null is not None else SPREAD / 3.0


def _ends(p: Parameter) -> tuple[float, float]:
    centre = _centre(p)
    return float(np.log(max(p.low / centre, SMALLEST))), float(np.log(min(p.high / centre, 1.0 / SMALLEST)))


def _reference_ends() -> tuple[float, float]:
    low, high = REFERENCE_MM
    return (low - REFERENCE_START_MM) / REFERENCE_SCALE_MM, (high - REFERENCE_START_MM) / REFERENCE_SCALE_MM


def _deviation(jacobian: Floats, residuals: Floats, spread: Floats) -> Floats:
    """One standard deviation of each free variable, neighbouring windows taken together."""
    rows = len(residuals) - len(spread)
    weight = np.sqrt(1.0 / np.sqrt(1.0 + np.square(residuals[:rows] / HICCUP_S)))
    noise = max(float(np.sqrt(np.mean(np.square(weight * residuals[:rows])))), 1e-6)
    scale = weight / noise
    blocks = np.arange(rows) // BLOCK_WINDOWS
    covariance = clustered_covariance(
        jacobian[:rows] / np.maximum(weight, 1e-9)[:, None] * scale[:, None],
        residuals[:rows] * scale,
        blocks,
        np.diag(1.0 / spread**2),
    )
    return np.sqrt(np.maximum(np.diag(covariance), 0.0))


def is_one_sided(p: Parameter) -> bool:
    """Return whether a parameter can go one way only from its null value."""
    return p.null is None or np.isinf(p.null) or p.null <= p.low


def small_values(effect: Effect, p: Parameter, size: float) -> dict[str, float]:
    """Parameters of an effect with only `p` off its null value, by `size` of the way to what is typical (−1 … 1)."""
    values = effect.null_values()
    assert p.null is not None, "a parameter without a null value has no say of its own"
    values[p.name] = p.typical / size if np.isinf(p.null) else p.null + size * (p.typical - p.null)
    return values
