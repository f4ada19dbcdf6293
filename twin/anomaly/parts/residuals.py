"""Residuals of a tick: the quantity of each signal less what is usual in the section, in spreads.

    z = (x − centre − level · cut share) / spread          r = min(1, usual spread of the signal / spread) · cut share of a load

Where no earlier part has the section, the twin's expectation takes its place, with what training found it to be off by.
"""

import math
from collections.abc import Sequence
from math import exp, log

from twin.anomaly.parts import scales
from twin.anomaly.parts.heat import explained
from twin.anomaly.parts.model import RPM_STEP, PartsModel, Plan
from twin.anomaly.parts.own import Own
from twin.anomaly.parts.quantity import Kind
from twin.anomaly.parts.told import Expects, Told
from twin.anomaly.parts.usual import Usual

_LOAD, _VIBRATION, _FEED, _SPEED, _TEMPERATURE = (int(k) for k in list(Kind)[:5])
_RPM_STEP = 1.0 / RPM_STEP
TWIN_CLIP = 2.5
"""A line of a program has air in it that the twin, line by line, does not tell from the cut."""
TELLS_MIN = 0.15
"""A section whose spread is so many times larger than usual tells nothing of a signal."""


def idle_of(plan: Plan, values: Sequence[float | None]) -> float:
    rpm = values[plan.speed_at] if plan.speed_at >= 0 else None
    if rpm is None:
        return plan.idle_pct[0]
    return plan.idle_pct[min(len(plan.idle_pct) - 1, int(rpm * _RPM_STEP + 0.5))]


def residuals(
    model: PartsModel,
    own: Own,
    told: Told,
    override: float,
    settled: bool,
    usual: Usual | None,
    section: int,
) -> tuple[list[float], list[float], tuple[float | None, ...]]:
    """Return r · z and r² of each signal, and the residuals that are learned from, which are never those beside the twin.

    usual: the usual course of the operation, None where no earlier part has this section
    """
    plan, heat = model.plan, own.heat
    learned = plan.flat if usual is None else usual.centre[section]
    if usual is not None and model.follows_parts:
        centre: Sequence[float | None] = learned
        weight, clip = usual.weight[section], scales.CLIP
    else:
        centre, weight, clip = beside_twin(plan, model, told.expected), plan.over_twin, TWIN_CLIP
    cuts = cut_share(plan, centre)
    z: list[float] = []
    tells: list[float] = []
    d: list[float | None] = []
    log_override = 0.0 if override == 1.0 else log(override)
    rows = zip(plan.kinds, told.values, plan.floors, plan.powers, centre, learned, weight, own.level, own.calm, strict=True)
    for at, (kind, value, floor, power, middle, usually, w, level, calm) in enumerate(rows):
        y, r, x = 0.0, 0.0, value
        if value is None or (kind < _TEMPERATURE and kind != _FEED and not settled):
            x = None
        elif kind == _TEMPERATURE:
            base = heat.base[at]
            if base is not None and heat.is_settled:
                y, r = (value - explained(model.heat[at], heat.driven) - base) * plan.over_spread[at], 1.0
            x = None
        else:
            x = _quantity(plan, at, kind, value, told, (override, log_override, floor, power)) - level * cuts
            if middle is not None and w > 0.0:
                y, r = (x - middle) * w * calm, w * calm / plan.over_spread[at]
                r = r * cuts if kind == _LOAD else r
                r = 1.0 if r > 1.0 else 0.0 if r < TELLS_MIN else r
        d.append(None if x is None else x - usually)
        z.append(r * (clip if y > clip else -clip if y < -clip else y))
        tells.append(r * r)
    return z, tells, tuple(d)


def cut_share(plan: Plan, centre: Sequence[float | None]) -> float:
    """Return how far a change of the cut moves the ln ratio of the load in a section: 1 in a heavy cut, 0 in air."""
    usual = centre[plan.load_at] if plan.load_at >= 0 else None
    if usual is None:
        return 1.0
    share = 1.0 - plan.floors[plan.load_at] * exp(-usual)
    return share if share > 0.0 else 0.0


def _quantity(plan: Plan, at: int, kind: int, value: float, told: Told, scale: tuple[float, float, float, float]) -> float:
    """Return the quantity of a signal that is not a temperature; scale: override, its logarithm, floor and power."""
    override, log_override, floor, power = scale
    if kind == _LOAD:
        cut = value - idle_of(plan, told.values) if at == plan.load_at else value
        return log((cut if cut > 0.0 else 0.0) * (exp(-power * log_override) if log_override else 1.0) + floor)
    if kind == _FEED:
        return log(value / override + floor)
    if kind == _VIBRATION:
        return log(value + floor) - power * log_override
    if kind == _SPEED:
        return log(value / _share(told.spindle_override_pct) + floor)
    return value


def _share(pct: float | None) -> float:
    return 1.0 if pct is None or pct < 1.0 else pct / 100.0


def beside_twin(plan: Plan, model: PartsModel, expected: Expects | None) -> list[float | None]:
    """Return the quantity that the twin expects of each signal, with what it was off by in training; None where it knows none."""
    if expected is None or not model.twin_offset:
        return [None] * len(plan.kinds)
    found: list[float | None] = []
    for at, kind in enumerate(plan.kinds):
        raw = twin_quantity(kind, plan.floors[at], expected, is_spindle=at == plan.load_at)
        found.append(None if raw is None or not model.twin_spread[at] else raw + model.twin_offset[at])
    return found


def twin_quantity(kind: int, floor: float, expected: Expects, *, is_spindle: bool) -> float | None:
    """Return the quantity that the twin expects of a signal; vibration goes with the root of the force. None: it has none."""
    if kind == _LOAD:
        value = expected.cut_load_pct if is_spindle else None
    elif kind == _FEED:
        value = expected.feed_mm_min
    elif kind == _SPEED:
        value = expected.spindle_rpm
    elif kind == _VIBRATION:
        force = expected.force_n
        return None if force is None or not force >= 0.0 else 0.5 * math.log(force + 1.0)
    else:
        value = None
    return None if value is None or not 0.0 <= value < math.inf else math.log(value + floor)
