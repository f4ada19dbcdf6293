"""Puts a recording onto the ticks of the servo loops, whatever its own sample times.

The loops run at their own period, and samples are taken from them: at every tick, at every third one, between ticks, more often
than the loops tick, or at times that jitter. Nothing is made up: the reference is interpolated so that the loops can be run
through, and what the machine answered is NaN at a tick without a sample. A sample that lies between ticks is carried to the
nearest one, by at most half a tick or half a sample (`twin.gap.sampling.sample_times`). Of a recording slower than SLOW_S only
samples are kept over which the reference goes on evenly: between them it is not known.
"""

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from twin.case import Run, RunAtHand
from twin.errors import RunLogError
from twin.gap.sampling.sample_times import SampleTimes, sample_times
from twin.machine import MachineFile
from twin.runlog import AXIS_COLUMN, RunLog
from twin.simulator.recorded import STILL_MIN

Floats = NDArray[np.float64]
SLOW_S, SLOW_TICKS = 0.02, 1.5
"""Sample period, and periods of the loops, above both of which a recording is a slow one."""
SETTLED_S, SAMPLES_EVEN = 0.2, 3
"""After which an axis has forgotten what it was told before: five time constants of a slow position loop, and some samples."""
GAP_SAMPLES = 4
"""Sample periods over which a reference may be interpolated."""
EVEN_MM, RESOLUTION_MM_MAX = 3e-4, 3e-3
"""Distances by which an even reference may bend from sample to sample, and that its resolution may add."""
ANSWERS = ("force_x_n", "force_y_n", "spindle_load_pct", "spindle_power_kw", "spindle_temp_c", "vibration_rms_g")
"""Columns beside those of the axes that the machine answers with; all others are held between samples."""
DOUBT = "doubt"
"""Column of an axis, behind its letter."""
WHEN_SLOW = ("spindle_rpm", "coolant_on", "ambient_temp_c", "axial_depth_mm", "line")
"""Columns beside those of the axes that mean something in a slow recording: forces and the spindle's angle do not."""
TURN_RAD = 2.0 * np.pi


class SlowRun(RunAtHand):
    """A run that was recorded so slowly that only its even stretches can be compared."""


def on_servo_ticks(run: Run, log: RunLog, machine: MachineFile, notes: list[str]) -> Run:
    """The run with its recording, `log`, on the ticks; what was done about it is said in `notes`.

    Raises RunLogError where it is too short to have a sample period.
    """
    if len(log) < 2:
        raise RunLogError(f"{run.name}: has {len(log)} row; a recording of axes needs more than one")
    period_s, recorded_s = machine.machine.servo_period_s, float(np.median(np.diff(log.t_s)))
    if recorded_s > max(SLOW_S, SLOW_TICKS * period_s):
        notes.append(
            f"{run.name}: is sampled every {1000 * recorded_s:.4g} ms, the loops tick every {1000 * period_s:.4g} ms: compared "
            "where the reference stands or goes on evenly; what happens within a sample is not seen"
        )
        return SlowRun(run.entry, run.folder, _slow(log, period_s))
    times = sample_times(log, period_s)
    notes += [f"{run.name}: {said}" for said in times.notes]
    placed = _placed(log, times, period_s)
    return RunAtHand(run.entry, run.folder, _with_doubt(run.name, log, placed, times, machine, notes))


def _with_doubt(name: str, log: RunLog, placed: RunLog, times: SampleTimes, machine: MachineFile, notes: list[str]) -> RunLog:
    """The placed recording with a column that is 1 where the reference of an axis is not known well enough between samples."""
    columns = dict(placed.columns)
    moving = []
    for letter, axis in machine.axes.items():
        reference = log.columns.get(f"{letter}_ref_mm")
        if reference is None:
            continue
        unsettled = _unsettled(placed.columns[f"{letter}_ref_mm"], machine.machine.servo_period_s)
        doubt = times.in_doubt(reference, axis.position_gain_per_s, machine.machine.servo_period_s)
        if unsettled:
            moving.append(letter)
        if unsettled or doubt.any():
            columns[f"{letter}_{DOUBT}"] = (doubt | (np.arange(times.count) < unsettled)).astype(np.float64)
        if doubt.any():
            notes.append(
                f"{name}: between samples the reference of {letter} is not known well enough for {np.mean(doubt):.0%} of the "
                "time; its loops are not compared there"
            )
    if moving:
        notes.append(
            f"{name}: begins while {' and '.join(moving)} {'move' if len(moving) > 1 else 'moves'}, in a state that is not "
            f"recorded; the first {SETTLED_S:g} s are not compared"
        )
    return replace(placed, columns=columns)


def _unsettled(reference: Floats, period_s: float) -> int:
    """Return the ticks over which an axis still has the state that it had before a recording; 0 where it begins at rest.

    That state (velocity, integral, friction) is only guessed from the first samples. At most a quarter of a short run.
    """
    if np.all(np.diff(reference[: STILL_MIN + 1]) == 0.0):
        return 0
    return min(round(SETTLED_S / period_s), len(reference) // 4)


def _placed(log: RunLog, times: SampleTimes, period_s: float) -> RunLog:
    """The recording with its samples at the ticks."""
    ticks = np.arange(times.count)
    columns: dict[str, Floats] = {}
    for name, values in log.columns.items():
        match = AXIS_COLUMN.match(name)
        if match and match[2] == "ref_mm":
            columns[name] = times.interpolated(values)
        elif match:
            column = times.held(values) if match[2] == "torque_a" else times.carried(values)
            reference = log.columns.get(f"{match[1]}_ref_mm")
            columns[name] = column if reference is None else _after_known(column, reference, times, period_s)
        elif name == "spindle_angle_rad" and not times.one_a_tick:
            columns[name] = _turned(log, times, period_s)
        elif name in ANSWERS or name == "spindle_angle_rad":
            columns[name] = times.nearest(values)
        else:
            columns[name] = times.last(values)
    text = log.text if len(ticks) == len(log) else {}
    return replace(log, t_s=np.asarray(ticks * period_s, dtype=np.float64), columns=columns, text=text)


def _turned(log: RunLog, times: SampleTimes, period_s: float) -> Floats:
    """The angle of the spindle at every tick: what was recorded where there is a sample, between them as fast as it turns."""
    angle = log["spindle_angle_rad"]
    known = np.isfinite(angle)
    if known.sum() < 2:
        return times.nearest(angle)
    at, turned = times.at[known], np.diff(angle[known])
    if log.has("spindle_rpm"):
        expected = np.nan_to_num(log["spindle_rpm"][known])[:-1] * TURN_RAD / 60.0 * period_s * np.diff(at)
        turned = expected + (turned - expected + np.pi) % TURN_RAD - np.pi
    else:
        turned = (turned + np.pi) % TURN_RAD - np.pi
    whole = np.interp(np.arange(times.count), at, angle[known][0] + np.concatenate([[0.0], np.cumsum(turned)]))
    sampled = times.nearest(angle)
    return np.where(np.isfinite(sampled), sampled, np.mod(whole, TURN_RAD))


def _after_known(column: Floats, reference: Floats, times: SampleTimes, period_s: float) -> Floats:
    """The column without what comes before an axis has settled after a gap in its reference: where it went is not known."""
    known = times.at[np.isfinite(reference)]
    for gap in np.flatnonzero(np.diff(known) > GAP_SAMPLES * max(times.every, 1.0)):
        column[int(known[gap]) + 1 : int(np.ceil(known[gap + 1])) + round(SETTLED_S / period_s)] = np.nan
    return column


def _slow(log: RunLog, period_s: float) -> RunLog:
    """A slow recording at its ticks, where the reference goes on evenly."""
    place = np.asarray(np.round((log.t_s - log.t_s[0]) / period_s), dtype=np.intp)
    ticks = np.arange(int(place[-1]) + 1)
    settled = max(round(SETTLED_S / max(float(np.median(np.diff(log.t_s))), 1e-9)), SAMPLES_EVEN)
    columns: dict[str, Floats] = {}
    for name, values in log.columns.items():
        match = AXIS_COLUMN.match(name)
        if match and match[2] == "ref_mm":
            known = np.isfinite(values)
            columns[name] = np.interp(ticks, place[known], values[known])
        elif match:
            columns[name] = np.full(len(ticks), np.nan)
            columns[name][place] = np.where(_even_here(log.columns.get(f"{match[1]}_ref_mm"), place, settled), values, np.nan)
        elif name in WHEN_SLOW:
            columns[name] = values[np.clip(np.searchsorted(place, ticks, side="right") - 1, 0, len(values) - 1)]
    return replace(log, t_s=np.asarray(ticks * period_s, dtype=np.float64), columns=columns, text={})


def _even_here(reference: Floats | None, place: NDArray[np.intp], settled: int) -> NDArray[np.bool_]:
    """Return True where the reference has gone on evenly for so many samples and does for one more, or stood still until then.

    What an axis sticks at is left over from motions that slow samples may have missed; of a rest only the samples before the next
    motion are compared, which starts from them.
    """
    count = len(place)
    if reference is None or count < 2 * SAMPLES_EVEN:
        return np.zeros(count, dtype=bool)
    moves, ticks = np.diff(reference), np.diff(place).astype(np.float64)
    bend = np.concatenate([[0.0], np.abs(moves[1:] - moves[:-1] * ticks[1:] / ticks[:-1]), [0.0]])
    resolution = min(3.0 * float(np.nanmedian(bend)), RESOLUTION_MM_MAX)
    smooth = bend < EVEN_MM + resolution + 1e-3 * np.abs(np.gradient(reference)) / settled
    even = _samples_since(~smooth) > settled
    even[:-1] &= smooth[1:]
    still = _samples_since(np.concatenate([[False], moves != 0.0])) > settled
    return np.asarray(even | still)


def _samples_since(there: NDArray[np.bool_]) -> NDArray[np.intp]:
    """Samples since the last one that is so, or since before the first one."""
    index = np.arange(len(there))
    return np.asarray(index - np.maximum.accumulate(np.where(there, index, -1)))
