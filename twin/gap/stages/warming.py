"""A stretch of a run in which the spindle warms up or cools down, from one hole in the recording to the next.

A hole is a time without any row, as a gateway that was off leaves one. What heated the spindle meanwhile is not known, so the
twin starts again from what is measured behind it.

A day at ten rows a second is more than the heat of a spindle has to say. Long runs are taken in even bins, with the inputs that
give the same heat, and the temperature as the mean of what was read in each:

    n = mean of n,   load = mean (load n²) / n²,   ambient and coolant as their means
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

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


@dataclass(frozen=True, slots=True, eq=False)
class Stretch:
    """rows: of the log; bin: (rows,) the bin of each; first: (n,) the row that each bin begins with

    warming: what drives the heat from the beginning of each bin on; at_s: (n,) times of the readings; start_c: temperature at its
    beginning; since_s: (n,) from reading to reading, 0 for the first
    """

    rows: slice
    bin: Ints
    first: Ints
    warming: Warming
    at_s: Floats
    since_s: Floats
    start_c: float
    switches_coolant: bool

    def means(self, values: Floats) -> Floats:
        """Return a column of the log as the mean of what there is in each bin, (n,), NaN where there is nothing."""
        if len(self.first) == len(self.bin):
            return values[self.rows]
        return _means(values[self.rows], self.bin)


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
    parts = [slice(int(begin), int(end)) for begin, end in zip(begins, ends, strict=True)]
    alone = len(parts) == 1
    return tuple(_stretch(log, part, inputs | {"coolant_on": coolant}, bin_s) for part in parts if alone or _says(log, part))


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
    at_s = _means(t_s, number) if bin_s > 0.0 else t_s
    warming = Warming(at_s, own["spindle_load_pct"], own["spindle_rpm"], own["ambient_temp_c"], own["coolant_on"])
    return Stretch(
        part,
        number,
        first + part.start,
        warming,
        at_s,
        np.diff(at_s, prepend=at_s[0]),
        start_temperature_c(t_s, log[SIGNAL][part]),
        len(np.unique(inputs["coolant_on"][part])) > 1,
    )


def _means(values: Floats, bins: Ints) -> Floats:
    """Return the mean of what there is in each bin, NaN where there is nothing."""
    there = np.isfinite(values)
    count = np.bincount(bins[there], minlength=int(bins[-1]) + 1)
    total = np.bincount(bins[there], values[there], minlength=len(count))
    return np.asarray(np.where(count > 0, total / np.maximum(count, 1), np.nan))
