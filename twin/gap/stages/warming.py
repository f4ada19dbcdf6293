"""A stretch of a run in which the spindle warms up or cools down, from one hole in the recording to the next.

A hole is a time without any row, as a gateway that was off leaves one. What heated the spindle meanwhile is not known, so the
twin starts again from what is measured behind it.

A day at ten rows a second is more than the heat of a spindle has to say. Long runs are taken in even bins, with the inputs that
give the same heat, and the temperature as the mean of what was read in each:

    n = mean of n,   load = mean (load n²) / n²,   ambient and coolant as their means

A stretch of production starts warm, and what was before it is not recorded. A sensor that is late is behind a spindle that has
been warming at the rate that it reads. What the spindle has warmed beside itself is somewhere between the spindle and its
surroundings: where, the stretch itself tells, as far as it does.
"""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from twin.gap.stages.observed_through import Sensing
from twin.heat.run import Warming, held
from twin.runlog import RunLog
from twin.simulator.recorded import start_temperature_c

Floats = NDArray[np.float64]
Ints = NDArray[np.intp]
SIGNAL = "spindle_temp_c"
DRIVES = ("spindle_load_pct", "spindle_rpm", "ambient_temp_c")
NEEDS = (SIGNAL, "spindle_rpm", "spindle_load_pct", "ambient_temp_c")
HOLE_S, HOLE_PERIODS = 60.0, 10.0
"""Seconds, and sample periods, without a row that make a hole."""
ROWS_MIN, SECONDS_MIN = 10, 30.0
"""Rows and seconds of a stretch below which it says nothing."""
BINS_MAX = 20_000
START_S, START_PART, START_S_MAX, START_ROWS_MIN = 15.0, 0.01, 60.0, 5
"""The readings that a stretch begins with: those of a hundredth of it, within these bounds, if they are so many."""
SLOPE_S, SLOPE_ROWS_MIN = 60.0, 20
EVEN_STEP_S, EVEN_STEPS = 5.0, 240
"""The even warming that a sensor is taken to have read before a stretch."""


@dataclass(frozen=True, slots=True, eq=False)
class Stretch:
    """rows: of the log; bin: (rows,) the bin of each; first: (n,) the row that each bin begins with

    warming: what drives the heat from the beginning of each bin on; at_s, temperature_c: (n,) the readings; start_c: that at its
    beginning, rising by slope_k_per_s, in surroundings of ambient_c; since_s: (n,) from reading to reading, 0 for the first
    begun_c: (n,) the readings that it begins with, NaN all others
    """

    rows: slice
    bin: Ints
    first: Ints
    warming: Warming
    at_s: Floats
    since_s: Floats
    temperature_c: Floats
    start_c: float
    begun_c: Floats
    slope_k_per_s: float
    ambient_c: float
    switches_coolant: bool

    def means(self, values: Floats) -> Floats:
        """Return a column of the log as the mean of what there is in each bin, (n,), NaN where there is nothing."""
        if len(self.first) == len(self.bin):
            return values[self.rows]
        return _means(values[self.rows], self.bin)


@dataclass(frozen=True, slots=True)
class Warmed:
    """A spindle in a stretch. shown: temperature at the start, (lanes,) → (lanes, n); cold: with nothing else warm then

    keeps_heat: something beside the spindle warms up with it
    """

    shown: Callable[..., Floats]
    keeps_heat: bool


def stretches_of(log: RunLog) -> tuple[Stretch, ...]:
    """Return the stretches of a run that say something, each with a temperature."""
    told = np.any([np.isfinite(log[name]) for name in NEEDS], axis=0)
    rows = np.flatnonzero(told)
    if len(rows) < ROWS_MIN:
        return ()
    apart = np.diff(log.t_s[rows])
    holes = np.flatnonzero(apart > max(HOLE_S, HOLE_PERIODS * float(np.median(apart))))
    begins, ends = [0, *(rows[holes + 1])], [*(rows[holes] + 1), len(log)]
    # even bins for all stretches, so that a long run costs no more than a short one
    bin_s = float(log.t_s[-1] - log.t_s[0]) / BINS_MAX if len(log) > BINS_MAX else 0.0
    inputs = {name: held(log[name], len(log), name) for name in DRIVES}
    coolant = held(log["coolant_on"], len(log), "coolant_on") if log.has("coolant_on") else np.zeros(len(log))
    parts = [_read(log, int(begin), int(end)) for begin, end in zip(begins, ends, strict=True)]
    alone = len(parts) == 1
    return tuple(_stretch(log, part, inputs | {"coolant_on": coolant}, bin_s) for part in parts if alone or _says(log, part))


def _read(log: RunLog, begin: int, end: int) -> slice:
    """Return the rows from the first reading of the temperature on: before it nobody knows where the spindle starts from."""
    there = np.flatnonzero(np.isfinite(log[SIGNAL][begin:end]))
    return slice(begin + int(there[0]) if len(there) else begin, end)


def _says(log: RunLog, part: slice) -> bool:
    t_s, known = log.t_s[part], int(np.isfinite(log[SIGNAL][part]).sum())
    return known >= ROWS_MIN and float(t_s[-1] - t_s[0]) >= SECONDS_MIN


def _stretch(log: RunLog, part: slice, inputs: dict[str, Floats], bin_s: float) -> Stretch:
    t_s = log.t_s[part]
    if bin_s > 0.0:
        _, number = np.unique(((t_s - t_s[0]) / bin_s).astype(np.intp), return_inverse=True)
    else:
        number = np.arange(len(t_s))
    first = np.searchsorted(number, np.arange(int(number[-1]) + 1))
    own = {name: values[part] for name, values in inputs.items()}
    if bin_s > 0.0:
        rpm, load = np.abs(own["spindle_rpm"]), own["spindle_load_pct"]
        mean_rpm = _means(rpm, number)
        heating = _means(load * rpm**2, number) / np.where(mean_rpm > 0.0, mean_rpm, 1.0) ** 2
        own = {name: _means(values, number) for name, values in own.items()}
        own |= {"spindle_rpm": mean_rpm, "spindle_load_pct": heating}
    temperature = log[SIGNAL][part]
    readings = temperature if bin_s <= 0.0 else _means(temperature, number)
    at_s = _means(t_s, number) if bin_s > 0.0 else t_s
    warming = Warming(at_s, own["spindle_load_pct"], own["spindle_rpm"], own["ambient_temp_c"], own["coolant_on"])
    return Stretch(
        part,
        number,
        first + part.start,
        warming,
        at_s,
        np.diff(at_s, prepend=at_s[0]),
        readings,
        _start_c(t_s, temperature),
        _begun_c(at_s, readings),
        _slope(t_s, temperature),
        float(own["ambient_temp_c"][0]),
        len(np.unique(inputs["coolant_on"][part])) > 1,
    )


def _start_c(t_s: Floats, temperature_c: Floats) -> float:
    """Return the temperature at the first sample, by a line through the readings that the stretch begins with."""
    first = np.isfinite(begun_c := _begun_c(t_s, temperature_c))
    if not first.any():
        return start_temperature_c(t_s, temperature_c)
    return float(np.polyfit(t_s[first] - t_s[0], begun_c[first], 1)[1])


def _begun_c(t_s: Floats, temperature_c: Floats) -> Floats:
    """Return the readings that a stretch begins with, (n,), NaN after them; NaN throughout where they are too few."""
    span_s = float(t_s[-1] - t_s[0])
    begins_s = min(max(START_S, START_PART * span_s), START_S_MAX) if span_s >= 2.0 * START_S else 0.0
    first = np.where(t_s <= t_s[0] + begins_s, temperature_c, np.nan)
    return first if np.isfinite(first).sum() >= START_ROWS_MIN else np.full(len(t_s), np.nan)


def _slope(t_s: Floats, temperature_c: Floats) -> float:
    """Return the rate at which a stretch begins to warm, K/s, by a line through its first minute; 0 where that is too few."""
    first = np.isfinite(temperature_c) & (t_s <= t_s[0] + SLOPE_S)
    if first.sum() < SLOPE_ROWS_MIN:
        return 0.0
    return float(np.polyfit(t_s[first] - t_s[0], temperature_c[first], 1)[0])


def behind_k(sensing: Sensing, slope_k_per_s: float, lanes: int) -> Floats:
    """Return by how much the spindle is warmer than a sensor reads that is late, where it has been warming evenly, (lanes,)."""
    if not sensing.effects or slope_k_per_s == 0.0:
        return np.zeros(lanes)
    return np.asarray(-sensing.value(_ramp_read(sensing, slope_k_per_s, lanes)[:, -1]))


def read_from(sensing: Sensing, values: Floats, part: Stretch) -> Floats:
    """Return the readings of a stretch, (lanes, n), of a sensor that has read the even warming before it."""
    if not sensing.effects:
        return values
    before = values[:, :1] + part.slope_k_per_s * (_ramp_s() - EVEN_STEP_S)
    since = np.concatenate([np.full(EVEN_STEPS, EVEN_STEP_S), part.since_s])
    since[EVEN_STEPS] = EVEN_STEP_S
    return sensing.readings(np.concatenate([before, values], axis=1), since)[:, EVEN_STEPS:]


def _ramp_read(sensing: Sensing, slope_k_per_s: float, lanes: int) -> Floats:
    """Return the readings of an even warming up to 0 °C, (lanes, steps)."""
    ramp = np.broadcast_to(slope_k_per_s * _ramp_s(), (lanes, EVEN_STEPS))
    return sensing.readings(ramp, EVEN_STEP_S)


def _ramp_s() -> Floats:
    return EVEN_STEP_S * np.arange(1 - EVEN_STEPS, 1.0)


def from_rest(sensing: Sensing, values: Floats, part: Stretch) -> Floats:
    """Return by how much a sensor reads more of a spindle that is warmer by these values, (lanes, n), and was not before."""
    if not sensing.effects:
        return values
    before = np.zeros((len(values), 1))
    since = np.concatenate([[0.0, EVEN_STEP_S], part.since_s[1:]])
    whole = np.concatenate([before, values], axis=1)
    return (sensing.readings(whole, since) - sensing.readings(np.zeros_like(whole), since))[:, 1:]


def between(one: Floats, away: Floats, recorded: Floats, least: float) -> Floats:
    """Return one + part · away, (lanes, n), with the part from `least` to 1 that comes nearest to what was recorded, (n,).

    >>> between(np.zeros((1, 2)), np.array([[4.0, 8.0]]), np.array([1.0, 2.0]), 0.0).tolist()
    [[1.0, 2.0]]
    """
    there = np.isfinite(recorded)
    size = np.sum(away[:, there] ** 2, axis=1)
    along = np.sum(away[:, there] * (recorded[there] - one[:, there]), axis=1)
    part = np.clip(along / np.maximum(size, 1e-12), least, 1.0)
    return np.asarray(one + part[:, None] * away)


def _means(values: Floats, bins: Ints) -> Floats:
    """Return the mean of what there is in each bin, NaN where there is nothing."""
    there = np.isfinite(values)
    count = np.bincount(bins[there], minlength=int(bins[-1]) + 1)
    total = np.bincount(bins[there], values[there], minlength=len(count))
    return np.asarray(np.where(count > 0, total / np.maximum(count, 1), np.nan))
