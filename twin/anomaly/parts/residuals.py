"""Residuals of a tick: the quantity of each signal less what is usual in the section, in spreads.

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
) -> tuple[list[float], tuple[float | None, ...], list[bool]]:
    """Return z, the residuals that are learned from (never beside the twin), and which signals this tick tells of.

    usual: the usual course of the operation, None where no earlier part has this section
    """
    plan = model.plan
    learned = plan.flat if usual is None else usual.centre[section]
    if usual is not None and model.follows_parts:
        centre: Sequence[float | None] = learned
        weight, clip = usual.weight[section], scales.CLIP
    else:
        centre, weight, clip = beside_twin(plan, model, told.expected), plan.over_twin, TWIN_CLIP
    z: list[float] = []
    d: list[float | None] = []
    is_told: list[bool] = []
    log_override = 0.0 if override == 1.0 else log(override)
    rows = zip(plan.kinds, told.values, plan.floors, plan.powers, centre, learned, weight, own.level, own.calm, strict=True)
    for at, (kind, value, floor, power, middle, usually, w, level, calm) in enumerate(rows):
        if value is None or (not settled and kind != _FEED and kind < _TEMPERATURE):
            z.append(0.0)
            d.append(None)
            is_told.append(False)
            continue
        if kind == _TEMPERATURE:
            base = own.heat.base[at]
            y = 0.0 if base is None else (value - explained(model.heat[at], own.heat.driven) - base) * plan.over_spread[at]
            d.append(None)
            is_told.append(base is not None and own.heat.is_settled)
        else:
            if kind == _LOAD:
                cut = value - idle_of(plan, told.values) if at == plan.load_at else value
                x = log((cut if cut > 0.0 else 0.0) * (exp(-power * log_override) if log_override else 1.0) + floor)
            elif kind == _FEED:
                x = log(value / override + floor)
            elif kind == _VIBRATION:
                x = log(value + floor) - power * log_override
            elif kind == _SPEED:
                x = log(value / _share(told.spindle_override_pct) + floor)
            else:
                x = value
            x -= level
            d.append(x - usually)
            is_told.append(middle is not None and w > 0.0)
            y = 0.0 if middle is None else (x - middle) * w * calm
        z.append(clip if y > clip else -clip if y < -clip else y)
    return z, tuple(d), is_told


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
