"""Puts a recording onto the ticks of the servo loops: one with gaps, with stamps that jitter, or slower than the loops.

Nothing is made up: the reference is interpolated so that the loops can be run through, and what the machine answered is NaN
where there is no sample. Of a slow recording only samples are kept over which the reference goes on evenly: between them it is
not known.
"""

import numpy as np
from numpy.typing import NDArray

from twin.case import Run, RunAtHand
from twin.errors import RunLogError
from twin.runlog import AXIS_COLUMN, RunLog
from twin.simulator.response import period_of

Floats = NDArray[np.float64]
FAST, SLOW = 0.9, 1.5
"""Periods of the servo loops below which a recording cannot be used, and above which it is a slow one."""
JITTER = 0.2
"""Periods by which a stamp may be off its tick and still be taken for it."""
SHAKEN_MAX = 5.0
"""Periods by which the stamps of a recording without gaps may be off."""
BLOCK = 100
ANOTHER_CLOCK = 0.002
"""Part by which the period of a recording may differ from that of the loops without being mentioned."""
SETTLED_S, SAMPLES_EVEN = 0.2, 3
"""After which an axis has forgotten what it was told before: five time constants of a slow position loop, and some samples."""
GAP_TICKS = 4
"""Ticks over which a reference may be interpolated."""
EVEN_MM, RESOLUTION_MM_MAX = 3e-4, 3e-3
"""By which an even reference may bend from sample to sample, and what its resolution may add."""
HELD = ("spindle_rpm", "coolant_on", "ambient_temp_c", "axial_depth_mm", "line")


class SlowRun(RunAtHand):
    """A run that was recorded more slowly than the loops tick."""


def on_servo_ticks(run: Run, log: RunLog, period_s: float, notes: list[str]) -> Run:
    """The run with its recording, `log`, on the ticks; what was done about it is said in `notes`.

    Raises RunLogError where it is faster than the loops, or too short to say.
    """
    if len(log) < 2:
        raise RunLogError(f"{run.name}: has {len(log)} row; a recording of axes needs more than one")
    recorded_s = float(np.median(np.diff(log.t_s)))
    if recorded_s < FAST * period_s:
        raise RunLogError(
            f"{run.name}: is sampled every {1000 * recorded_s:.4g} ms, the servo loops tick every {1000 * period_s:.4g} ms; "
            "record at the servo period or slower, or state servo_period_s"
        )
    if recorded_s > SLOW * period_s:
        notes.append(
            f"{run.name}: is sampled every {1000 * recorded_s:.4g} ms, the loops tick every {1000 * period_s:.4g} ms: compared "
            "where the reference stands or goes on evenly; what happens within a sample is not seen"
        )
        return SlowRun(run.entry, run.folder, _placed(log, _rounded(log, period_s), period_s, slow=True))
    steps = np.diff(log.t_s)
    even = float(np.abs(steps - recorded_s).max()) <= JITTER * period_s
    if even or not _missing_any(log, period_s):
        if abs(period_of(log.t_s) / period_s - 1.0) > ANOTHER_CLOCK:
            every_ms = 1000 * period_of(log.t_s)
            notes.append(
                f"{run.name}: is sampled every {every_ms:.5g} ms, the loops tick every {1000 * period_s:.5g} ms: its clock is "
                "another one, and its samples are taken to be one a tick"
            )
        elif not even:
            worst = 1000 * float(np.abs(steps - recorded_s).max())
            notes.append(f"{run.name}: its time stamps jitter by up to {worst:.2g} ms; its samples are taken to be one a tick")
        return RunAtHand(run.entry, run.folder, _placed(log, np.arange(len(log)), period_s, slow=False))
    place = _rounded(log, period_s)
    missing = int(place[-1]) + 1 - len(np.unique(place))
    notes.append(f"{run.name}: has gaps, {missing} samples are missing; the reference is interpolated there and nothing compared")
    return RunAtHand(run.entry, run.folder, _placed(log, place, period_s, slow=False))


def _missing_any(log: RunLog, period_s: float) -> bool:
    """Whether samples are missing, and not only stamped badly: then the stamps run ahead of the ticks for good."""
    ahead = log.t_s / period_s - np.arange(len(log))
    blocks = [float(np.median(part)) for part in np.array_split(ahead, max(len(log) // BLOCK, 1))]
    return max(blocks) - min(blocks) > 0.5 or float(np.abs(ahead - np.median(ahead)).max()) > SHAKEN_MAX


def _rounded(log: RunLog, period_s: float) -> NDArray[np.intp]:
    return np.asarray(np.round((log.t_s - log.t_s[0]) / period_s), dtype=np.intp)


def _placed(log: RunLog, place: NDArray[np.intp], period_s: float, *, slow: bool) -> RunLog:
    """The recording with its samples at these ticks."""
    ticks = np.arange(int(place[-1]) + 1)
    settled = max(round(SETTLED_S / max(float(np.median(np.diff(log.t_s))), 1e-9)), SAMPLES_EVEN)
    columns: dict[str, Floats] = {}
    for name, values in log.columns.items():
        match = AXIS_COLUMN.match(name)
        if match and match[2] == "ref_mm":
            known = np.isfinite(values)
            columns[name] = np.interp(ticks, place[known], values[known])
            continue
        if not match and name in HELD:
            columns[name] = values[np.clip(np.searchsorted(place, ticks, side="right") - 1, 0, len(values) - 1)]
            continue
        if slow and not match:
            continue  # forces and the spindle's angle mean nothing at this rate
        reference = log.columns.get(f"{match[1]}_ref_mm") if match else None
        kept = np.where(_even_here(reference, place, settled), values, np.nan) if slow else values
        column = np.full(len(ticks), np.nan)
        column[place] = kept
        columns[name] = column if reference is None or slow else _after_known(column, reference, place, period_s)
    text = log.text if len(ticks) == len(log) else {}
    return RunLog(np.asarray(ticks * period_s, dtype=np.float64), columns, text, log.ignored, log.source)


def _after_known(column: Floats, reference: Floats, place: NDArray[np.intp], period_s: float) -> Floats:
    """The column without what comes before an axis has settled after a gap in its reference: where it went is not known."""
    known = place[np.isfinite(reference)]
    for gap in np.flatnonzero(np.diff(known) > GAP_TICKS):
        column[known[gap] + 1 : known[gap + 1] + round(SETTLED_S / period_s)] = np.nan
    return column


def _even_here(reference: Floats | None, place: NDArray[np.intp], settled: int) -> NDArray[np.bool_]:
    """Where the reference has gone on evenly for so many samples and does for one more, or has stood still until then.

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
