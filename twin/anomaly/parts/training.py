"""The figures taken from the recordings of a machine before they are replayed: idle load, heat, powers of the override, the
twin's error. All of it is plain least squares and quantiles over arrays (T,); what depends on the course of a part comes from the
replay itself (`replay.py`).
"""

import math
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from twin.anomaly.parts import quantity
from twin.anomaly.parts.heat import base_s, fit_heat
from twin.anomaly.parts.model import RPM_STEP, PartsModel
from twin.anomaly.parts.quantity import FEED, LOAD, SPEED, TURNS_RPM_MIN, Kind, floor_of, kind_of

if TYPE_CHECKING:
    from twin.anomaly.parts.recorded import Recorded

Floats = NDArray[np.float64]
IDLE_QUANTILE = 0.05
IDLE_TICKS_MIN = 60
LINES_OVERRIDDEN_MIN = 3
POWER_MAX = 1.2
CUTS_PCT_MIN = 8.0
TWIN_TICKS_MIN = 300
LINE_TICKS_MIN = 3
STEPS_MIN = 100
OVERRIDES_APART = 0.3
STEADY_QUANTILE = 0.7
"""Quantile of the load over the ticks of a line: its steady cut, above its edges in air."""
VIBRATION_POWER = 0.5
TWIN_CLIP = 3.0


def prepared(one: "Recorded") -> PartsModel:
    """Return the model of a machine before its parts are replayed. Raises ValueError where nothing turns or moves in it."""
    columns = {name: one.values[:, at] for at, name in enumerate(one.signals)}
    empty = np.full(len(one.values), np.nan)
    rpm, load, feed = (columns.get(name, empty) for name in (SPEED, LOAD, FEED))
    works = ~one.gated & (np.isnan(rpm) | (rpm >= TURNS_RPM_MIN)) & (np.isnan(feed) | (feed >= 1.0))
    if not works.any():
        raise ValueError(
            f"{one.machine}: neither spindle nor feed works in {len(one.values)} ticks: there is nothing to learn from"
        )
    settled = works & (np.isnan(rpm) | (np.abs(np.diff(rpm, prepend=rpm[:1])) <= 0.006 * rpm + 5.0))
    idle = _idle(rpm, load, settled)
    first = PartsModel(signals=one.signals, tick_s=one.tick_s, idle=idle)
    x = _quantities(first, one, settled)
    powers = tuple(_power(one, x[:, at], first.plan.kinds[at], first.plan.floors[at]) for at in range(len(one.signals)))
    heat = tuple(
        fit_heat(rpm, load, columns[name], one.tick_s, base_s(name)) if kind_of(name) is Kind.TEMPERATURE else ()
        for name in one.signals
    )
    step = tuple(_step(one, x[:, at]) for at in range(len(one.signals)))
    still = tuple(_still(one, at, rpm) for at in range(len(one.signals)))
    offset, spread = _twin_error(first.changed(power=powers), one, settled)
    return PartsModel(
        signals=one.signals,
        tick_s=one.tick_s,
        idle=idle,
        power=powers,
        heat=heat,
        twin_offset=offset,
        twin_spread=spread,
        still=still,
        step=step,
    )


def _idle(rpm: Floats, load: Floats, settled: NDArray[np.bool_]) -> tuple[tuple[float, float], ...]:
    """Return the load that the spindle takes at least, by speed."""
    known = settled & ~np.isnan(load)
    if np.isnan(rpm).all():
        return ((0.0, float(np.quantile(load[known], IDLE_QUANTILE)) if known.any() else 0.0),)
    known &= ~np.isnan(rpm)
    bins = np.round(rpm[known] / RPM_STEP).astype(np.int64)
    points, most = [], 0.0
    for step in np.unique(bins).tolist():
        own = load[known][bins == step]
        if len(own) >= IDLE_TICKS_MIN:
            most = max(most, float(np.quantile(own, IDLE_QUANTILE)))
            points.append((step * RPM_STEP, max(0.0, float(np.quantile(own, IDLE_QUANTILE)))))
    return tuple(points) or ((0.0, 0.0),)


def _still(one: "Recorded", at: int, rpm: Floats) -> float:
    """Return the quantity of a vibration while the spindle stands; 0 of other signals."""
    name = one.signals[at]
    known = ~one.gated & (rpm < TURNS_RPM_MIN) & ~np.isnan(one.values[:, at])
    if kind_of(name) is not Kind.VIBRATION or not known.any():
        return 0.0
    return float(np.log(np.median(one.values[known, at]) + floor_of(name)))


def _step(one: "Recorded", x: Floats) -> float:
    """Return the deviation of the change of a quantity from a tick to the next one in the same line; 0 = not known."""
    change = np.diff(x)
    same = (one.line[1:] == one.line[:-1]) & (one.tool[1:] == one.tool[:-1]) & ~np.isnan(change)
    if same.sum() < STEPS_MIN:
        return 0.0
    low, high = np.percentile(change[same], [25.0, 75.0])
    return float(high - low) / 1.349


def _quantities(model: PartsModel, one: "Recorded", settled: NDArray[np.bool_]) -> Floats:
    """Return the quantities (T, F) without overrides' powers, NaN where they are not told."""
    found = np.full(one.values.shape, np.nan)
    override, speed = (
        np.where(np.isnan(pct), 1.0, np.maximum(pct, 1.0) / 100.0) for pct in (one.feed_override_pct, one.spindle_override_pct)
    )
    points = np.array(model.idle)
    rpm = one.values[:, model.plan.speed_at] if model.plan.speed_at >= 0 else np.zeros(len(one.values))
    for at, name in enumerate(one.signals):
        values, kind = one.values[:, at], kind_of(name)
        idle = np.interp(rpm, points[:, 0], points[:, 1]) if at == model.plan.load_at else 0.0
        scale = override if kind is Kind.FEED else speed if kind is Kind.SPEED else 1.0
        if kind in (Kind.LOAD, Kind.VIBRATION, Kind.FEED, Kind.SPEED):
            found[:, at] = np.log(np.maximum(values - idle, 0.0) / scale + floor_of(name))
    found[~settled] = np.nan
    return found


def _groups(one: "Recorded") -> NDArray[np.int64]:
    """Return a number for each line of each operation, (T,)."""
    keys = np.stack([one.program, one.tool, one.line], axis=1).astype(np.int64)
    return np.asarray(np.unique(keys, axis=0, return_inverse=True)[1].ravel(), dtype=np.int64)


def _power(one: "Recorded", x: Floats, kind: int, floor: float) -> float:
    """Return the power of the feed override in a signal, without its floor, from lines that were run at several."""
    usual = quantity.POWERS.get(Kind(kind), 0.0)
    if usual == 0.0:
        return 0.0
    known = ~np.isnan(x) & (one.feed_override_pct >= 10.0)
    if not known.any():
        return usual
    group, y, pct = _groups(one)[known], x[known], one.feed_override_pct[known]
    if kind == Kind.LOAD:
        cuts = y > math.log(CUTS_PCT_MIN)
        group, y, pct = group[cuts], np.log(np.exp(y[cuts]) - floor), pct[cuts]
    pairs, place = np.unique(np.stack([group, np.round(pct).astype(np.int64)], axis=1), axis=0, return_inverse=True)
    order = np.argsort(place.ravel(), kind="stable")
    stretches = np.split(y[order], np.flatnonzero(np.diff(place.ravel()[order])) + 1)
    points: dict[int, list[tuple[float, float]]] = {}
    for (line, override), own in zip(pairs.tolist(), stretches, strict=True):
        if len(own) >= LINE_TICKS_MIN:
            points.setdefault(line, []).append((math.log(override / 100.0), float(np.quantile(own, STEADY_QUANTILE))))
    slopes = [_slope(own) for own in points.values() if max(own)[0] - min(own)[0] > OVERRIDES_APART]
    if len(slopes) < LINES_OVERRIDDEN_MIN:
        return usual
    return float(np.clip(np.median(slopes), 0.0, POWER_MAX))


def _slope(points: "list[tuple[float, float]]") -> float:
    """Return the slope between the lowest and the highest override of a line."""
    (x0, y0), (x1, y1) = min(points), max(points)
    return (y1 - y0) / (x1 - x0)


def _twin_error(model: PartsModel, one: "Recorded", settled: NDArray[np.bool_]) -> tuple[tuple[float, ...], tuple[float, ...]]:
    """Return offset and spread of each signal beside the twin's expectation; spread 0 where there is none."""
    count = len(one.signals)
    if one.expected is None:
        return (0.0,) * count, (0.0,) * count
    x, offset, spread = _quantities(model, one, settled), [0.0] * count, [0.0] * count
    override = np.log(np.where(np.isnan(one.feed_override_pct), 100.0, np.maximum(one.feed_override_pct, 1.0)) / 100.0)
    columns = {Kind.LOAD: 0, Kind.FEED: 2, Kind.SPEED: 3, Kind.VIBRATION: 4}
    for at, name in enumerate(one.signals):
        kind = kind_of(name)
        if kind not in columns or (kind is Kind.LOAD and name != LOAD):
            continue
        raw = np.maximum(one.expected[:, columns[kind]], 0.0)
        twin = VIBRATION_POWER * np.log(raw + 1.0) if kind is Kind.VIBRATION else np.log(raw + floor_of(name))
        off = x[:, at] - model.powers[at] * override - twin
        off = off[~np.isnan(off)]
        if len(off) * one.tick_s >= TWIN_TICKS_MIN:
            low, middle, high = np.percentile(off, [16.0, 50.0, 84.0])
            half = max(float(high - low) / 2.0, quantity.SPREAD_LEAST[kind])
            cut_off = np.clip(off - middle, -TWIN_CLIP * half, TWIN_CLIP * half)
            offset[at], spread[at] = float(middle + cut_off.mean()), max(float(cut_off.std()), quantity.SPREAD_LEAST[kind])
    return tuple(offset), tuple(spread)
