"""Measure how fast a spindle runs up, read off recordings of any programs in which the axes stand and wait for it.

Above its base speed ω_b a spindle accelerates at constant power: reaching ω takes t = ω_b / (2 α) + ω² / (2 α ω_b)
(`timeline`), a straight line over ω². Its two constants need run-ups to two speeds. Where the axes hardly stand they did not
wait, and the run-up was shorter than what is seen: those are left out.
"""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from twin.errors import RunLogError
from twin.recording.program_run import ProgramRun

Floats = NDArray[np.float64]
RISING_S = 1.0
"""The speed that the control tells rises in steps closer than this, and then stays."""
HELD_S = 3.0
"""A speed that is left again sooner was a twitch of the spindle at a tool change."""
STANDS_S = 0.8
"""Axes that stand for less did not wait for the spindle."""
LATEST_S = 6.0
"""They come to stand within this after the start of the spindle, or for another reason."""


class RunUp(NamedTuple):
    """From standstill to `rpm`: how long the axes were held back, counted from the start of the spindle."""

    rpm: float
    seconds: float


class SpindleRamp(NamedTuple):
    """α at constant torque, rev/min per s, and ω_b, rev/min, with one standard deviation of it."""

    acceleration_rpm_s: float
    base_rpm: float
    base_deviation_rpm: float


def run_ups(run: ProgramRun) -> list[RunUp]:
    """Every run-up of the spindle in `run` that the axes waited for."""
    t, rpm = run.t_s, np.asarray(run.columns["spindle_rpm"], dtype=np.float64)
    feed = np.asarray(run.columns["feed_mm_min"], dtype=np.float64)
    changed = np.flatnonzero(rpm[1:] != rpm[:-1]) + 1
    seen = []
    for n, k in enumerate(changed):
        if rpm[k - 1] != 0.0 or not rpm[k] > 0.0:
            continue
        last = n
        while (
            last + 1 < len(changed)
            and t[changed[last + 1]] - t[changed[last]] < RISING_S
            and rpm[changed[last + 1]] > rpm[changed[last]]
        ):
            last += 1
        if last + 1 < len(changed) and t[changed[last + 1]] - t[changed[last]] < HELD_S:
            continue
        halted = np.flatnonzero((feed == 0.0) & (t > t[k]) & (t < t[k] + LATEST_S))
        if not len(halted):
            continue
        moving = np.flatnonzero((feed > 0.0) & (np.arange(len(t)) > halted[0]))
        if len(moving) and t[moving[0]] - t[halted[0]] >= STANDS_S and t[moving[0]] > t[changed[last]]:
            seen.append(RunUp(float(rpm[changed[last]]), float(t[moving[0]] - t[k])))
    return seen


def spindle_ramp(seen: Sequence[RunUp]) -> SpindleRamp:
    """α and ω_b from run-ups to at least two speeds, each by its median. Raises RunLogError where they don't tell them.

    2.5 s to 6000 and 5.7 s to 10000 rev/min: slope 3.2 / (64 · 10⁶) = 5 · 10⁻⁸, intercept 0.7, so ω_b = √(0.7 / 5 · 10⁻⁸) = 3742.

    >>> round(spindle_ramp([RunUp(6000.0, 2.5), RunUp(10000.0, 5.7)]).base_rpm)
    3742
    """
    speeds = sorted({one.rpm for one in seen})
    if len(speeds) < 2:
        raise RunLogError(f"run-ups to {speeds or 'no speed'}: it takes two speeds to tell torque from power")
    squares = np.square(speeds)
    seconds = np.array([np.median([one.seconds for one in seen if one.rpm == speed]) for speed in speeds])
    design = np.column_stack([np.ones(len(speeds)), squares])
    (start, slope), _rest, _rank, _singular = np.linalg.lstsq(design, seconds, rcond=None)
    if start <= 0.0 or slope <= 0.0:
        raise RunLogError(f"run-ups to {speeds} take {seconds.round(2).tolist()} s: not those of a spindle at constant power")
    noise = np.sum((seconds - design @ [start, slope]) ** 2) / max(len(speeds) - 2, 1)
    covariance = noise * np.linalg.inv(design.T @ design)
    base = float(np.sqrt(start / slope))
    to_base = 0.5 * base * np.array([1.0 / start, -1.0 / slope])
    return SpindleRamp(float(0.5 / np.sqrt(start * slope)), base, float(np.sqrt(to_base @ covariance @ to_base)))
