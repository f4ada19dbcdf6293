"""Residuals of a tick: the quantity of each signal less what is usual in the section, in spreads.

    z = (x − centre − level · cut share) / spread          r = min(1, usual spread of the signal / spread) · cut share of a load

Where no earlier part has the section, the twin's expectation takes its place, with what training found it to be off by.
"""

import math
from collections.abc import Sequence
from math import exp, log, sqrt
from typing import NamedTuple

from twin.anomaly.parts import scales
from twin.anomaly.parts.heat import explained
from twin.anomaly.parts.model import RPM_STEP, PartsModel, Plan
from twin.anomaly.parts.own import Own
from twin.anomaly.parts.quantity import Kind
from twin.anomaly.parts.shared import LEARNED_MAX, felt, harder_after, own_shift, shift_of
from twin.anomaly.parts.told import Expects
from twin.anomaly.parts.told import Told as Moment
from twin.anomaly.parts.usual import Usual

_LOAD, _VIBRATION, _FEED, _SPEED, _TEMPERATURE = (int(k) for k in list(Kind)[:5])
_RPM_STEP = 1.0 / RPM_STEP
TWIN_CLIP = 2.5
"""A line of a program has air in it that the twin, line by line, does not tell from the cut."""
POWER_SPREAD = 0.25
"""Operations differ by so much in the power of the override with which load and vibration go."""
CORNERS = 0.5
"""A lower override comes closer to its feed in corners, a higher one less: sections differ by so much of its logarithm."""
TELLS_MIN = 0.15
"""A section whose spread is so many times larger than usual tells nothing of a signal."""


def idle_of(plan: Plan, values: Sequence[float | None]) -> float:
    rpm = values[plan.speed_at] if plan.speed_at >= 0 else None
    if rpm is None:
        return plan.idle_pct[0]
    return plan.idle_pct[min(len(plan.idle_pct) - 1, int(rpm * _RPM_STEP + 0.5))]


class Told(NamedTuple):
    """z, tells: r · z and r² of each signal, for the means; d: residuals that are learned from, never those beside the twin
    cut_z, cut_tells: of the signals that follow levels, before these leave them in doubt, less what the peers feel; 0 of others
    off: variance that the feed override brings, ln²; felt: by signal, for the peers; late: of each load since the operation began
    """

    z: list[float]
    tells: list[float]
    d: tuple[float | None, ...]
    cut_z: list[float]
    cut_tells: list[float]
    off: float
    felt: list[tuple[float, float]]
    late: list[tuple[float, float]]


def residuals(
    model: PartsModel, own: Own, told: Moment, override: float, settled: bool, usual: Usual | None, section: int
) -> Told:
    """Return the residuals of a tick; usual: the usual course of the operation, None where no earlier part has this section."""
    plan, heat = model.plan, own.heat
    learned = plan.flat if usual is None else usual.centre[section]
    if usual is not None and model.follows_parts:
        centre: Sequence[float | None] = learned
        weight, clip = usual.weight[section], scales.CLIP
    else:
        centre, weight, clip = beside_twin(plan, model, told.expected), plan.over_twin, TWIN_CLIP
    log_override = 0.0 if override == 1.0 else log(override)
    off = (POWER_SPREAD * log_override) ** 2
    cuts = _cut_share_now(plan, told) if usual is None else cut_share(plan, learned)
    z: list[float] = []
    tells: list[float] = []
    cut_z: list[float] = []
    cut_tells: list[float] = []
    d: list[float | None] = []
    felt_now, late = list(own.felt), list(own.gathered.late)
    harder = own.shared[plan.load_at] * plan.gain[plan.load_at] if plan.load_at >= 0 else 0.0
    columns = (plan.floors, plan.powers, centre, learned, weight, own.level, own.calm, own.shared)
    rows = zip(plan.kinds, told.values, *columns, strict=True)
    for at, (kind, value, floor, power, middle, usually, w, level, calm, common) in enumerate(rows):
        y = r = 0.0
        x = value
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
                away = x - middle
                if kind == _VIBRATION:
                    g = exp(middle + level * cuts + power * log_override) - floor
                    felt_now[at] = felt(felt_now[at], plan.felt_shares[0], value, g)
                    shift = shift_of(plan.gain[at] ** 2 * common, g, floor) if common else 0.0
                    shift += harder * cuts if harder > 0.0 else 0.0
                    away = _beyond(away, shift)
                    x = None if shift > LEARNED_MAX else x
                elif kind == _LOAD and not -LEARNED_MAX < common < LEARNED_MAX:
                    x = None
                elif kind == _FEED and away * log_override < 0.0:
                    w /= sqrt(1.0 + (CORNERS * log_override * w) ** 2)  # noqa: PLW2901
                y, r = away * w, w / plan.over_spread[at]
                r = r * cuts if kind == _LOAD else r
                r = 1.0 if r > 1.0 else 0.0 if r < TELLS_MIN else r
        d.append(None if x is None else x - usually)
        most = clip if usual is None else clip * r
        value_z, value_r = r * (most if y > most else -most if y < -most else y), r * r
        cut = (0.0, 0.0)
        if kind <= _VIBRATION:
            if value_r and usual is not None and model.follows_parts:
                cut = (value_z, value_r)
                if kind == _LOAD:
                    change, share = value_z / plan.over_spread[at], plan.felt_shares[1]
                    felt_now[at] = harder_after(felt_now[at], share, change, value_r)
                    late[at] = harder_after(late[at], share, change, value_r)
                    cut = _left(late[at], plan.gain[at] * common, plan.over_spread[at])
            damp = calm / (1.0 + off * w * w) if off else calm
            value_z, value_r = value_z * damp, value_r * damp
        z.append(value_z)
        tells.append(value_r)
        cut_z.append(cut[0])
        cut_tells.append(cut[1])
    return Told(z, tells, tuple(d), cut_z, cut_tells, off, felt_now, late)


def _left(now: tuple[float, float], common: float, over_spread: float) -> tuple[float, float]:
    """Return r · z and r² of what is left of a load that was smoothed as the peers' were."""
    total, weight = now
    if not common:
        return total * over_spread, weight
    return weight * _beyond(own_shift(now), common) * over_spread, weight


def _beyond(away: float, shift: float) -> float:
    """Return how far a residual lies beyond a shift to the same side."""
    if shift > 0.0 < away:
        return max(0.0, away - shift)
    return min(0.0, away - shift) if shift < 0.0 > away else away


def felt_still(model: PartsModel, own: Own, values: Sequence[float | None]) -> tuple[tuple[float, float], ...]:
    """Return what a machine feels whose spindle stands: it says nothing of the machine, but of the floor."""
    plan, found = model.plan, list(own.felt)
    for at in plan.levelled:
        value = values[at]
        if plan.kinds[at] == _VIBRATION and value is not None:
            found[at] = felt(found[at], plan.felt_shares[0], value, exp(model.still[at]) - plan.floors[at])
    return tuple(found)


def cut_share(plan: Plan, centre: Sequence[float | None]) -> float:
    """Return how far a change of the cut moves the ln ratio of the load in a section: 1 in a heavy cut, 0 in air."""
    usual = centre[plan.load_at] if plan.load_at >= 0 else None
    if usual is None:
        return 1.0
    share = 1.0 - plan.floors[plan.load_at] * exp(-usual)
    return share if share > 0.0 else 0.0


def _cut_share_now(plan: Plan, told: Moment) -> float:
    """Return the same of a section that no earlier part has, by its load at this tick."""
    load = told.values[plan.load_at] if plan.load_at >= 0 else None
    if load is None:
        return 1.0
    cut = max(0.0, load - idle_of(plan, told.values))
    return cut / (cut + plan.floors[plan.load_at])


def _quantity(plan: Plan, at: int, kind: int, value: float, told: Moment, scale: tuple[float, float, float, float]) -> float:
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
