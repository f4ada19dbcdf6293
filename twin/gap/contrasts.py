"""Contrasts: what the gap is here against what it is there. They tell more than single cells.

    share = n₁ n₂ / (n₁ + n₂) (mean₁ − mean₂)² / Σ ρ²          z = (|mean₁ − mean₂| − δ) / √(error₁² + error₂²)

with ρ in floors, and means, errors and δ as in `twin.gap.significance`.
"""

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from twin.gap.covariates import Covariates
from twin.gap.significance import means_of, p_of
from twin.gap.wording import figure
from twin.regimes import Regime

Floats = NDArray[np.float64]
Bools = NDArray[np.bool_]

SAMPLES_MIN = 8
FASTER = 1.5
"""Times that the mean speed of the fast samples has to be that of the slow ones."""


@dataclass(frozen=True, slots=True, eq=False)
class Sides:
    """Two sets of samples to compare: a name, what is compared (n,) in floors and in its unit, and where (n,)."""

    over: str
    in_floors: Floats
    in_unit: Floats
    one: Bools
    other: Bools
    one_words: str
    other_words: str


@dataclass(frozen=True, slots=True)
class Contrast:
    """The difference between two sides. share: of the gap's energy; size in floors; p; says: both means in words."""

    over: str
    share: float
    size: float
    p: float
    says: str


def contrasts(of: Covariates, share_min: float) -> Iterator[Contrast]:
    """The contrasts of a signal; p is 1 where the share is below `share_min`, since nobody will ask."""
    for sides in _sides(of):
        one, other = (where & np.isfinite(sides.in_floors) for where in (sides.one, sides.other))
        many = int(one.sum()), int(other.sum())
        if min(many) < SAMPLES_MIN:
            continue
        apart = float(sides.in_floors[one].mean() - sides.in_floors[other].mean())
        share = many[0] * many[1] / sum(many) * apart**2 / max(of.energy, 1e-300)
        p = 1.0 if share < share_min else _p_of(of, sides.in_floors, one, other, apart)
        means = [figure(float(sides.in_unit[where].mean()), of.unit) for where in (one, other)]
        yield Contrast(
            sides.over, min(share, 1.0), abs(apart), p, f"{means[0]} {sides.one_words}, {means[1]} {sides.other_words}"
        )


def _p_of(of: Covariates, values: Floats, one: Bools, other: Bools, apart: float) -> float:
    """p of the two means being no further apart than the tolerance."""
    means = means_of(values, np.array([one, other]), np.array([of.pieces(one), of.pieces(other)]))
    return float(p_of(np.array([apart]), np.array([np.hypot(*means.error)]))[0])


def _sides(of: Covariates) -> Iterator[Sides]:
    """Every contrast that makes sense for the signal."""
    plain = (of.in_floors, of.gap)
    moves = np.nan_to_num(np.abs(of.velocity_mm_s)) > 0.0
    if moves.any():
        steady = moves & ~of.within(Regime.REVERSAL.title)
        forward, rest = of.velocity_mm_s > 0.0, of.resting
        yield Sides("+v against −v", *plain, steady & forward, steady & ~forward, "moving in +", "moving in −")
        yield Sides("rest against motion", *plain, rest, ~rest, "at rest", "in motion")
        yield from _by_speed(of, steady, np.abs(of.velocity_mm_s), np.sign(of.velocity_mm_s), "")
    else:
        turns = np.nan_to_num(of.spindle_rpm) > 0.0
        yield from _by_speed(of, turns, of.spindle_rpm, np.ones(len(turns)), " spindle")
        yield Sides("spindle turning against standing", *plain, turns, ~turns, "turning", "standing")
        cutting = of.within("cutting")
        yield Sides("cutting against not cutting", *plain, cutting, ~cutting, "while cutting", "else")
    on = of.coolant > 0.0
    yield Sides("coolant on against off", *plain, on, of.coolant == 0.0, "with coolant", "without")
    level = [of.without_means(values, of.regime_code, ~of.resting) for values in plain]
    yield Sides("early against late", level[0], level[1], of.part < 1.0 / 3.0, of.part > 2.0 / 3.0, "early", "late")


def _by_speed(of: Covariates, where: Bools, speed: Floats, sign: Floats, whose: str) -> Iterator[Sides]:
    """Fast against slow, with a gap that opposes the motion counted the same in both directions."""
    usable = where & of.known
    if usable.sum() < 2 * SAMPLES_MIN:
        return
    middle = float(np.median(speed[usable]))
    fast, slow = usable & (speed > middle), usable & (speed <= middle)
    if not fast.any() or speed[fast].mean() < FASTER * speed[slow].mean():
        return
    along = " along the motion" if not whose else ""
    yield Sides(f"fast against slow{whose}", of.in_floors * sign, of.gap * sign, fast, slow, f"fast{along}", f"slow{along}")
