"""The rows of training: features and residual every `row_s` of recorded time, as the processor would have them."""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from twin.residual.errors import ResidualError
from twin.residual.features import AMBIENT, FEED, MEASURED, PHYSICS, RISE, SPEED, Feature, signals_of

Floats = NDArray[np.float64]
CUTTING_RPM_MIN, CUTTING_FEED_MIN = 50.0, 1.0
GAP_S_MAX = 600.0
"""The processor's default: its means begin again after so long without a signal."""
HEATING_K, HEATING_OVER = 0.5, Feature(RISE, 1200.0)
REGIMES = ("standing", "warm_up", "steady", "cool_down")
"""By the modelled rise beside its mean over 20 min, as the processor `gap` tells them; standing: the spindle does."""


@dataclass(frozen=True, slots=True, eq=False)
class Recorded:
    """Signals at ticks, as last reported before each; NaN = unknown.

    t_s: (n,), s, increasing; stretch: (n,) number of the stretch: the physics and all means begin again with each
    signals: name → (n,), with `twin/spindle_temp_c`, the physics
    """

    t_s: Floats
    stretch: NDArray[np.int64]
    signals: Mapping[str, Floats]

    @property
    def tick_s(self) -> float:
        """Between two ticks."""
        return float(np.median(np.diff(self.t_s)))

    @property
    def hours(self) -> float:
        """Recorded."""
        return len(self.t_s) * self.tick_s / 3600.0

    @property
    def cutting_hours(self) -> float:
        """With the spindle turning and a feed; without a feed signal, with the spindle turning."""
        turning = np.abs(self.signals[SPEED]) > CUTTING_RPM_MIN
        feed = self.signals.get(FEED)
        return float((turning if feed is None else turning & (feed > CUTTING_FEED_MIN)).sum()) * self.tick_s / 3600.0


@dataclass(frozen=True, slots=True, eq=False)
class Table:
    """Rows whose features and residual are known.

    x: (n, features); residual_k: (n,) measured less physics; regime: (n,) number of one of REGIMES
    """

    features: tuple[Feature, ...]
    t_s: Floats
    x: Floats
    residual_k: Floats
    stretch: NDArray[np.int64]
    regime: NDArray[np.int64]

    def of(self, features: Sequence[Feature]) -> Floats:
        """The columns of these features, (n, len(features))."""
        return np.ascontiguousarray(self.x[:, [self.features.index(one) for one in features]])


def offered(recorded: Recorded, features: Sequence[Feature]) -> tuple[Feature, ...]:
    """Those of the features whose signals were told at all."""
    known = {name for name, values in recorded.signals.items() if np.isfinite(values).any()}
    return tuple(one for one in features if known.issuperset(signals_of([one])))


def table_of(recorded: Recorded, features: Sequence[Feature], row_s: float, settle_s: float = 0.0) -> Table:
    """The rows of these features, one every `row_s`, none in the first `settle_s` of a stretch. Raises ResidualError."""
    for name in (PHYSICS, MEASURED, AMBIENT, SPEED):
        if name not in recorded.signals or not np.isfinite(recorded.signals[name]).any():
            raise ResidualError(f"{name} is not in the recording, without which there is no residual to learn")
    asked = (*features, HEATING_OVER)
    now = dict(recorded.signals)
    known = np.isfinite(np.column_stack([now[name] for name in signals_of(asked)])).all(axis=1)
    at_s, stretch = recorded.t_s[known], recorded.stretch[known]
    if RISE in {one.signal for one in asked}:
        now[RISE] = now[PHYSICS] - now[AMBIENT]
    fresh = (np.diff(stretch, prepend=-1) != 0) | (np.diff(at_s, prepend=at_s[:1]) >= GAP_S_MAX)
    columns = [mean_of(at_s, now[name][known], over_s, fresh) if over_s else now[name][known] for name, over_s in asked]
    measured = recorded.signals[MEASURED]
    began_s = at_s[np.maximum.accumulate(np.where(fresh, np.arange(len(fresh)), 0))]
    wanted = np.flatnonzero(known) % max(1, round(row_s / recorded.tick_s)) == 0
    wanted &= np.isfinite(measured[known]) & (at_s >= began_s + settle_s)
    if wanted.sum() < 2:
        raise ResidualError("no moment of the recording has all features, the physics and the measured temperature")
    places, x = np.flatnonzero(known)[wanted], np.column_stack(columns)[wanted]
    residual = measured[places] - recorded.signals[PHYSICS][places]
    rise = recorded.signals[PHYSICS][places] - recorded.signals[AMBIENT][places]
    heating = rise - x[:, -1]
    regime = np.where(heating > HEATING_K, 1, np.where(heating < -HEATING_K, 3, 2))
    regime[np.abs(recorded.signals[SPEED][places]) <= CUTTING_RPM_MIN] = 0
    return Table(
        tuple(features), recorded.t_s[places], np.ascontiguousarray(x[:, :-1]), residual, recorded.stretch[places], regime
    )


def mean_of(t_s: Floats, values: Floats, over_s: float, fresh: NDArray[np.bool_]) -> Floats:
    """The exponential mean (n,) of values (n,), begun again where `fresh`: what `features.row_after` gives moment by moment.

    >>> mean_of(np.array([0.0, 100.0]), np.array([10.0, 20.0]), 100.0, np.array([True, False])).round(3).tolist()
    [10.0, 16.321]
    """
    share = [-math.expm1(-elapsed_s / over_s) for elapsed_s in np.diff(t_s, prepend=t_s[:1]).clip(0.0).tolist()]
    mean, found = 0.0, []
    for begins, part, value in zip(fresh.tolist(), share, values.tolist(), strict=True):
        mean = value if begins else mean + part * (value - mean)
        found.append(mean)
    return np.array(found)
