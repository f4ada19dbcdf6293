"""A signal's gap beside what it may go with: direction and speed, position, phase of the screw and of the spindle, time, section.

All are taken from what the machine was told, not from what it did, so that they are known before any twin runs.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from twin.gap.diagnosis import Trace
from twin.gap.where import gap_of
from twin.machine import MachineFile
from twin.regimes import Regime
from twin.runlog import AXIS_COLUMN, RunLog

Floats = NDArray[np.float64]
Bools = NDArray[np.bool_]

TAU = 2.0 * np.pi


@dataclass(frozen=True, slots=True, eq=False)
class Covariates:
    """A signal over all its runs, (n,) each; NaN or False where there is none.

    gap: twin minus recording, in the unit of the signal; in_floors: the same over the floor, NaN where it is not known
    regimes: names; regime_code: which at each sample; stretch: number of the stretch without a change of regime, over all runs
    velocity_mm_s, position_mm, lead_rad: of the reference of its axis; spindle_rpm, spindle_rad: of the spindle
    part: of the time of its run, 0 to 1; time_s; section: NC line; coolant: 1 while on
    heading: eighth of a turn that the path points into, 0 to 7; −1 where nothing moves in x and y
    """

    signal: str
    unit: str
    gap: Floats
    in_floors: Floats
    regimes: tuple[str, ...]
    regime_code: NDArray[np.intp]
    stretch: NDArray[np.intp]
    velocity_mm_s: Floats
    position_mm: Floats
    lead_rad: Floats
    spindle_rpm: Floats
    spindle_rad: Floats
    part: Floats
    time_s: Floats
    section: Floats
    coolant: Floats
    heading: Floats

    @property
    def known(self) -> Bools:
        """Return where there is a gap, (n,)."""
        return np.isfinite(self.in_floors)

    @property
    def energy(self) -> float:
        """Return the energy of the gap, in floors²."""
        return float(np.nansum(self.in_floors**2))

    @property
    def resting(self) -> Bools:
        """Return where the axis stands still, (n,): what its gap is there is chance, one for each time that it comes to rest."""
        return self.within(Regime.REST.title)

    def within(self, *regimes: str) -> Bools:
        """Return where the signal is in one of these regimes, (n,)."""
        return np.isin(self.regime_code, [i for i, name in enumerate(self.regimes) if name in regimes])

    def pieces(self, cell: Bools) -> float:
        """Return what the samples of a cell (n,) are worth at most."""
        still = cell & self.resting
        return float(np.sum(cell & ~still) + len(np.unique(self.stretch[still])))

    def constant_speed(self) -> Bools:
        """Return where the axis keeps its speed, (n,)."""
        return self.within(Regime.CONSTANT_MINUS.title, Regime.CONSTANT_PLUS.title, "rapid")

    def without_means(self, values: Floats, by: NDArray[np.generic], where: Bools) -> Floats:
        """Values (n,) less their mean over the samples that have the same label `by`; NaN but `where`."""
        kept = where & self.known
        result = np.full(len(values), np.nan)
        if kept.any():
            _, label = np.unique(by[kept], return_inverse=True)
            mean = np.bincount(label, values[kept]) / np.bincount(label)
            result[kept] = values[kept] - mean[label]
        return result


def covariates(traces: Sequence[Trace], logs: Mapping[str, RunLog], machine: MachineFile, after: bool) -> Covariates:
    """Return what the gap of one signal may go with; traces: all of that signal, logs: run → what it recorded."""
    rows = [_of_run(trace, logs[trace.run], machine) for trace in traces]
    gap = np.concatenate([gap_of(trace, after) for trace in traces])
    floor = np.concatenate([trace.floor for trace in traces])
    regimes = tuple(dict.fromkeys(name for trace in traces for name in trace.regimes))
    codes = [np.array([regimes.index(name) for name in trace.regimes], dtype=np.intp)[trace.regime] for trace in traces]
    code = np.concatenate(codes)
    starts = np.cumsum([0, *(len(trace.t_s) for trace in traces[:-1])])
    changes = np.concatenate([[True], code[1:] != code[:-1]])
    changes[starts] = True
    joined = {name: np.concatenate([row[name] for row in rows]) for name in rows[0]}
    in_floors = gap / np.where(floor > 0.0, floor, np.nan)
    return Covariates(traces[0].signal, traces[0].unit, gap, in_floors, regimes, code, np.cumsum(changes) - 1, **joined)


def _of_run(trace: Trace, log: RunLog, machine: MachineFile) -> dict[str, Floats]:
    """The covariates of one run, at the samples of the trace."""
    index = np.clip(np.searchsorted(log.t_s, trace.t_s), 0, len(log) - 1)
    none = np.full(len(trace.t_s), np.nan)

    def column(name: str) -> Floats:
        return log[name][index] if log.has(name) else none

    match = AXIS_COLUMN.match(trace.signal)
    letter = match[1] if match else ""
    position = column(f"{letter}_ref_mm")
    axis = machine.axes.get(letter)
    lead = axis.screw_lead_mm if axis else None
    since = trace.t_s - trace.t_s[0]
    return {
        "velocity_mm_s": np.gradient(position, trace.t_s) if len(position) > 1 else none,
        "position_mm": position,
        "lead_rad": none if lead is None else np.mod(TAU * position / lead, TAU),
        "spindle_rpm": column("spindle_rpm"),
        "spindle_rad": np.where(column("spindle_rpm") > 0.0, np.mod(column("spindle_angle_rad"), TAU), np.nan),
        "part": since / max(float(since[-1]), 1e-12),
        "time_s": since,
        "section": column("line"),
        "coolant": column("coolant_on"),
        "heading": _heading(column("x_ref_mm"), column("y_ref_mm"), trace.t_s),
    }


def _heading(x_mm: Floats, y_mm: Floats, t_s: Floats) -> Floats:
    """Eighth of a turn that the motion in x and y points into, (n,); −1 where there is none."""
    if len(t_s) < 2:
        return np.full(len(t_s), -1.0)
    x, y = np.gradient(np.nan_to_num(x_mm), t_s), np.gradient(np.nan_to_num(y_mm), t_s)
    eighth = np.mod(np.round(np.arctan2(y, x) / (TAU / 8.0)), 8.0)
    return np.where(np.hypot(x, y) > 0.0, eighth, -1.0)
