"""Features of the residual: signals as they are, and exponential means of them, the same in training and at the machine.

    mean(t + dt) = mean(t) + (1 − e^(−dt/τ)) (x(t + dt) − mean(t)),  mean(0) = x(0)

A name is that of the signal, with "~600" behind it for a mean with τ = 600 s. What was measured of the temperature is no feature:
a correction that follows the sensor would hide what the physics gets wrong.

>>> str(feature("spindle_rpm~600")), feature("spindle_rpm")
('spindle_rpm~600', Feature(signal='spindle_rpm', over_s=0.0))
"""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import NamedTuple

from twin.residual.errors import ResidualError
from twin.vocabulary.twin_signals import SPINDLE_TEMP_C

SPEED, LOAD, FEED = "spindle_rpm", "spindle_load_pct", "feed_mm_min"
POSITIONS = ("axis_x_pos_mm", "axis_y_pos_mm", "axis_z_pos_mm")
AMBIENT, PHYSICS, MEASURED = "ambient_temp_c", SPINDLE_TEMP_C, "spindle_temp_c"
RISE = "physics_rise_k"
"""Physics temperature less ambient."""
SIGNALS = (SPEED, LOAD, FEED, *POSITIONS, AMBIENT, PHYSICS)
OVER_S_MAX = 7 * 86_400.0


class Feature(NamedTuple):
    """over_s: τ of the mean; 0 = the signal as it is"""

    signal: str
    over_s: float = 0.0

    def __str__(self) -> str:
        return f"{self.signal}~{self.over_s:g}" if self.over_s else self.signal


def feature(name: str) -> Feature:
    """The feature of that name. Raises ResidualError where there is none."""
    signal, _, over = name.partition("~")
    try:
        over_s = float(over) if over else 0.0
    except ValueError:
        over_s = math.nan
    if signal not in (*SIGNALS, RISE) or not 0.0 <= over_s <= OVER_S_MAX or name != str(Feature(signal, over_s)):
        raise ResidualError(
            f"{name!r} is no feature of the residual: there are {', '.join((*SIGNALS, RISE))}, and means: {RISE}~600"
        )
    return Feature(signal, over_s)


PUBLISHED = tuple(map(feature, SIGNALS))
"""The eight that the published recipe names."""
REMEMBERED = tuple(Feature(RISE, over_s) for over_s in (600.0, 3600.0, 14_400.0))
"""The temperature rise of the past: it stands for masses beyond the one that the physics has."""
LEAN = (Feature(SPEED, 600.0), Feature(LOAD, 600.0), feature(AMBIENT), feature(PHYSICS), *REMEMBERED)
SETS: Mapping[str, tuple[Feature, ...]] = {"published": PUBLISHED, "remembering": (*PUBLISHED, *REMEMBERED), "lean": LEAN}
"""Sets of features; the published one is used unless another is better on time that was held out (twin/residual/training.py)."""


@dataclass(frozen=True, slots=True)
class Memory:
    """The means as of `at_s`, in the order of the features that are means; at_s None: there are none yet."""

    at_s: float | None = None
    means: tuple[float, ...] = ()


def signals_of(features: Sequence[Feature]) -> tuple[str, ...]:
    """The signals that have to be known for these features, in the order of `SIGNALS`."""
    needed = {one.signal for one in features}
    if RISE in needed:
        needed |= {AMBIENT, PHYSICS}
    return tuple(name for name in SIGNALS if name in needed)


def row_after(
    features: Sequence[Feature], memory: Memory, now: Mapping[str, float], at_s: float
) -> tuple[Memory, tuple[float, ...]]:
    """The memory after what is known at `at_s`, and the row of features then.

    >>> rise = [feature("physics_rise_k~100")]
    >>> memory, row = row_after(rise, Memory(), {"twin/spindle_temp_c": 30.0, "ambient_temp_c": 20.0}, 0.0)
    >>> row, round(row_after(rise, memory, {"twin/spindle_temp_c": 40.0, "ambient_temp_c": 20.0}, 100.0)[1][0], 3)
    ((10.0,), 16.321)
    """
    fresh = memory.at_s is None or at_s < memory.at_s
    elapsed_s = 0.0 if memory.at_s is None or fresh else at_s - memory.at_s
    means: list[float] = []
    row = []
    for signal, over_s in features:
        value = now[PHYSICS] - now[AMBIENT] if signal == RISE else now[signal]
        if over_s:
            if not fresh:
                mean = memory.means[len(means)]
                value = mean + -math.expm1(-elapsed_s / over_s) * (value - mean)
            means.append(value)
        row.append(value)
    return Memory(at_s, tuple(means)), tuple(row)
