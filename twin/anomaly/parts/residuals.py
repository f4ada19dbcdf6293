"""Residuals of a tick: the quantity of each signal less what is usual in the section, in spreads.

Where no earlier part has the section, the twin's expectation takes its place, with what training found it to be off by.
"""

import math
from collections.abc import Sequence

from twin.anomaly.parts import scales
from twin.anomaly.parts.heat import explained
from twin.anomaly.parts.model import PartsModel, Plan
from twin.anomaly.parts.own import Own
from twin.anomaly.parts.quantity import Kind
from twin.anomaly.parts.told import Expects, Told
from twin.anomaly.parts.usual import Usual

_LOAD, _VIBRATION, _FEED, _SPEED, _TEMPERATURE = (int(k) for k in list(Kind)[:5])
_RPM_STEP = 1.0 / 500.0


def quantities(model: PartsModel, told: Told, override: float, settled: bool) -> list[float | None]:
    """Return the quantity of each signal, None where this tick does not tell of it; temperatures as they are told."""
    plan = model.plan
    found: list[float | None] = []
    speed = 1.0 if told.spindle_override_pct is None else max(told.spindle_override_pct, 1.0) / 100.0
    log_override = math.log(override)
    for at, (kind, value, floor, power) in enumerate(zip(plan.kinds, told.values, plan.floors, model.powers, strict=True)):
        if value is None or (not settled and kind != _FEED and kind != _TEMPERATURE):
            found.append(None)
        elif kind == _LOAD:
            idle = idle_of(plan, told.values) if at == plan.load_at else 0.0
            found.append(math.log(max(0.0, value - idle) * math.exp(-power * log_override) + floor))
        elif kind == _VIBRATION:
            found.append(math.log(max(0.0, value) + floor) - power * log_override)
        elif kind == _FEED:
            found.append(math.log(max(0.0, value) / override + floor))
        elif kind == _SPEED:
            found.append(math.log(max(0.0, value) / speed + floor))
        else:
            found.append(value)
    return found


def idle_of(plan: Plan, values: Sequence[float | None]) -> float:
    rpm = values[plan.speed_at] if plan.speed_at >= 0 else None
    if rpm is None:
        return plan.idle_pct[0]
    return plan.idle_pct[min(len(plan.idle_pct) - 1, int(rpm * _RPM_STEP + 0.5))]


def residuals(
    plan: Plan, model: PartsModel, own: Own, x: list[float | None], expected: Expects | None, usual: Usual | None, section: int
) -> tuple[list[float], list[float | None], list[bool]]:
    """Return z, the residual that is learned from (without the twin), and which signals are told of."""
    if usual is not None and model.follows_parts:
        centre: Sequence[float | None] = usual.centre[section]
        learned, weight = usual.centre[section], usual.weight[section]
    else:
        centre, learned, weight = beside_twin(plan, model, expected), plan.flat, plan.over_twin
        if usual is not None:
            learned = usual.centre[section]
    z: list[float] = []
    d: list[float | None] = []
    told: list[bool] = []
    clip, base = scales.CLIP, own.heat.base
    for at, value in enumerate(x):
        if value is None:
            z.append(0.0)
            d.append(None)
            told.append(False)
            continue
        if plan.kinds[at] == _TEMPERATURE:
            level = base[at]
            y = 0.0 if level is None else (value - explained(model.heat[at], own.heat.driven) - level) * plan.over_spread[at]
            d.append(None)
            told.append(level is not None)
        else:
            value -= own.level[at]  # noqa: PLW2901
            middle, w = centre[at], weight[at]
            d.append(value - learned[at])
            told.append(middle is not None and w > 0.0)
            y = 0.0 if middle is None else (value - middle) * w * own.calm[at]
        z.append(clip if y > clip else -clip if y < -clip else y)
    return z, d, told


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
