"""Intervals of what is reported: of the causes' parameters, and of how far the gap shrinks."""

from collections.abc import Mapping
from types import MappingProxyType

import numpy as np
from numpy.typing import NDArray

from twin.effects.catalogue import effect_named
from twin.gap.diagnosis import Effected, Interval, closure_of
from twin.gap.fitting import Fitted
from twin.gap.score import Squares
from twin.gap.units import unit_on

Floats = NDArray[np.float64]
Intervals = dict[Effected, dict[str, Interval]]
Z90 = 1.6448536269514722
WIDER, FORM = 1.5, 0.012
"""Factor on what the blocks of a recording scatter by, and the part of an effect by which a machine differs from its equation, as
one standard error: calibrated on a blind check of other machines than those whose coverage is published."""
SEED = 4
DRAWS = 400


def parameter_intervals(found: Fitted, input_errors: Mapping[str, float] = MappingProxyType({})) -> Intervals:
    """The parameters of each effect with their 90 % intervals, from the covariance clustered over time blocks and from what no
    covariance knows: the few blocks that there are, and an equation that no machine is quite.

    input_errors: quantity that an effect needs → its relative standard error, by which the effect's size is uncertain as well
    """
    intervals: Intervals = {}
    free = found.model.free
    deviation = np.sqrt(np.diag(uncertainty_of(found)))
    for effected, place in found.model.places():
        effect = effect_named(effected.effect)
        parameters = effect.parameters
        also = Z90 * max((error for need, error in input_errors.items() if need in effect.needs), default=0.0)
        intervals[effected] = {}
        for p, i in zip(parameters, range(place.start, place.stop), strict=True):
            theta = found.theta[i]
            ends = np.clip(theta + Z90 * deviation[i] * np.array([-1.0, 0.0, 1.0]), free[i].low, free[i].high)
            low, value, high = np.sort(free[i].value(ends)).tolist()
            if also > 0.0:
                low, high = (value + sign * float(np.hypot(end - value, also * value)) for sign, end in ((-1, low), (1, high)))
            intervals[effected][p.name] = Interval(value, low, high, unit_on(p.unit, effected.on))
    return intervals


def uncertainty_of(found: Fitted) -> Floats:
    """Return the covariance of θ that intervals come from, (p, p): that of the fit, wider, and what an equation is off by."""
    covariance = WIDER**2 * found.covariance
    covariance[np.diag_indices_from(covariance)] = np.maximum(np.diag(covariance), 0.0) + (FORM * _size(found)) ** 2
    return np.asarray(covariance)


def _size(found: Fitted) -> Floats:
    """Return the size of each θ that an error of the form is a part of: 1 of a logarithm or an angle."""
    return np.array([1.0 if f.is_shape or f.is_angle else abs(t) for f, t in zip(found.model.free, found.theta, strict=True)])


def closure_interval(before: Mapping[str, Squares], after: Mapping[str, Squares]) -> tuple[float, float, float]:
    """Closure of all signals and its 90 % interval, by a paired bootstrap over time blocks."""
    draw = np.random.default_rng(SEED)
    signals = [s for s in before if s in after and before[s].count.sum() > 0]
    if not signals:
        return 0.0, 0.0, 0.0
    drawn = np.zeros((DRAWS + 1, 2))
    for signal in signals:
        one, other = before[signal], after[signal]
        blocks = len(one.count)
        weight = draw.multinomial(blocks, np.full(blocks, 1.0 / blocks), size=DRAWS).astype(np.float64)
        weight = np.concatenate([np.ones((1, blocks)), weight])
        count = np.maximum(weight @ one.count, 1.0)
        drawn += np.stack([weight @ one.ratio / count, weight @ other.ratio / count], axis=1)
    gaps = np.sqrt(drawn / len(signals))
    closures = [closure_of(float(b), float(a), 1.0) for b, a in gaps]
    low, high = np.quantile(closures[1:], [0.05, 0.95])
    return closures[0], float(min(low, closures[0])), float(max(high, closures[0]))
