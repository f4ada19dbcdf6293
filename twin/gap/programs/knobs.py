"""The place of the rapid knob where no recording tells it: read off the rapids themselves.

A long rapid of one axis goes level at rate · override. Where some runs reach the machine's rapid rate and others do not, the
operator's knob stood elsewhere, and what a run's own rapids show is an input of that run, as a recorded override is. Where no run
reaches the stated rate, no knob that moved is at work: that is a gap, and left to the search.
"""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from twin.errors import RunLogError
from twin.gap.programs.trial import Trial
from twin.recording.recorded_program import RapidSeen, rapid_rate_mm_min, rapids_seen

Floats = NDArray[np.float64]
RAPID = "rapid_override_pct"
KNOB = 0.95
"""Long rapids below this part of the rate were slowed down."""


def rapid_rate_of(trials: Sequence[Trial]) -> float:
    """Return the rapid rate at 100 %, mm/min: by the runs whose override is recorded; where none is, the highest that is seen.

    Raises RunLogError where no run has a long rapid.
    """
    told = [trial.recorded for trial in trials if _is_told(trial) and rapids_seen(trial.recorded)]
    if told:
        return rapid_rate_mm_min(told)[0]
    rates = [seen.rate_mm_min for trial in trials for seen in rapids_seen(trial.recorded)]
    if not rates:
        raise RunLogError("no run has a long rapid of one axis: state rapid_mm_min")
    return max(rates)


def with_rapids_read(trials: Sequence[Trial], rate_mm_min: float) -> tuple[tuple[Trial, ...], tuple[str, ...]]:
    """Return the trials with the rapid override that their rapids show, where none is recorded, and what to say of it."""
    seen = {trial.name: rapids_seen(trial.recorded) for trial in trials}
    slowed = {name: min((one.rate_mm_min for one in some), default=np.inf) < KNOB * rate_mm_min for name, some in seen.items()}
    if not any(one.rate_mm_min >= KNOB * rate_mm_min for some in seen.values() for one in some):
        return tuple(trials), ()
    read = {t.name: _with_override(t, seen[t.name], rate_mm_min) for t in trials if slowed[t.name] and not _is_told(t)}
    if not read:
        return tuple(trials), ()
    shown = ", ".join(f"{n} {100.0 * float(np.median([s.rate_mm_min for s in seen[n]])) / rate_mm_min:.0f} %" for n in read)
    said = f"no rapid override is recorded, and long rapids are below {rate_mm_min:.0f} mm/min: taken from them in {shown}"
    return tuple(read.get(trial.name, trial) for trial in trials), (said,)


def _is_told(trial: Trial) -> bool:
    return bool(np.isfinite(np.asarray(trial.recorded.run.columns[RAPID], dtype=np.float64)).any())


def _with_override(trial: Trial, seen: Sequence[RapidSeen], rate_mm_min: float) -> Trial:
    """The trial with the knob where the nearest long rapid shows it."""
    run = trial.recorded.run
    at = np.array([one.t_s for one in seen])
    ratio = np.minimum([one.rate_mm_min / rate_mm_min for one in seen], 1.0)
    nearest = np.searchsorted(0.5 * (at[1:] + at[:-1]), np.asarray(run.columns["t_s"], dtype=np.float64))
    columns = dict(run.columns) | {RAPID: 100.0 * ratio[nearest]}
    return replace(trial, recorded=replace(trial.recorded, run=replace(run, columns=columns)))
