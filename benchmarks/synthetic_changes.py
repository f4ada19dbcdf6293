"""A synthetic drive for the detector of tool changes: changes, things that look a bit like them, noise, and streams of these.

Drive current at 10 Hz. A change is stretched as a whole, stalled at a random moment, or both.
"""

import math
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray
from scipy.signal import lfilter

from twin.transient.evidence import UNKNOWN
from twin.transient.stream import Stream
from twin.transient.training import Trained, TrainingSettings, trained

Floats = NDArray[np.float64]
PERIOD_S = 0.1
CHANGE_S = 10.0
CONFUSERS_PER_HOUR = 40.0


def synthetic_change(t_s: Floats) -> Floats:
    """Drive current of a change of 10 s: braking, standstill with two moves of the magazine, start with its peak."""
    at = [0.0, 0.3, 0.8, 1.6, 2.0, 3.0, 3.2, 3.8, 4.0, 5.2, 5.4, 6.0, 6.2, 6.8, 7.1, 8.3, 8.6, 9.2, 10.0]
    current = [1.0, 1.0, -1.2, -0.8, 0.4, 0.4, 0.7, 0.7, 0.4, 0.4, 0.6, 0.6, 0.4, 0.4, 2.6, 2.2, 0.9, 1.0, 1.0]
    return np.interp(t_s, at, current)


def changed(stretch: float, stall_s: float, stall_at_s: float) -> Floats:
    """A change as it comes: stretched as a whole, held for `stall_s` at one moment of it."""
    t_s = np.arange(0.0, CHANGE_S * stretch + stall_s, PERIOD_S)
    at_s = stall_at_s * stretch
    own = np.where(t_s < at_s, t_s, np.where(t_s < at_s + stall_s, at_s, t_s - stall_s))
    return synthetic_change(own / stretch)


POWER = float(synthetic_change(np.arange(0.0, CHANGE_S, 0.01)).var())


def noise(count: int, snr_db: float, rng: np.random.Generator) -> Floats:
    """AR(0.6) of the variance that the ratio says."""
    raw = lfilter([math.sqrt(1.0 - 0.36)], [1.0, -0.6], rng.standard_normal(count + 100))[100:]
    return np.asarray(raw * math.sqrt(POWER / 10.0 ** (snr_db / 10.0)))


def confuser(rng: np.random.Generator) -> Floats:
    """Something else that a drive does, as deviation from the current before it."""
    t_s = np.arange(0.0, rng.uniform(3.0, 25.0), PERIOD_S)
    size, end = rng.uniform(0.4, 2.0), t_s[-1]
    kind = int(rng.integers(0, 7))
    if kind == 0:  # a start
        return synthetic_change(np.minimum(6.5 + t_s, 10.0)) - 1.0
    if kind == 1:  # a stop, and nothing after it for long
        return np.concatenate([synthetic_change(np.minimum(t_s, 2.5)) - 1.0, np.full(300, -0.6), np.linspace(-0.6, 0.0, 50)])
    if kind == 2:  # a cut
        return np.where((t_s > 0.1 * end) & (t_s < 0.9 * end), size, 0.0)
    if kind == 3:  # a ramp
        return size * np.interp(t_s, [0.0, 0.5 * end, end], [0.0, 1.0, 0.0])
    if kind == 4:  # peaks
        return size * (np.sin(2.0 * np.pi * t_s / rng.uniform(1.0, 4.0)) > 0.7)
    if kind == 5:  # a dip
        return np.where((t_s > 0.2 * end) & (t_s < 0.7 * end), -size, 0.0)
    return np.concatenate(
        [synthetic_change(np.minimum(t_s, 2.5))[:20] - 1.0, np.linspace(-0.6, 0.0, 20)]
    )  # a stop and a slow start


def null_stream(hours: float, snr_db: float, rng: np.random.Generator) -> Stream:
    """A stream without changes. Confusers do not overlap: a stop that a start follows at once is a change to any detector."""
    values = 1.0 + noise(int(hours * 3600.0 / PERIOD_S), snr_db, rng)
    at = 0
    while True:
        shape = confuser(rng)
        at += int((5.0 + rng.exponential(3600.0 / CONFUSERS_PER_HOUR - 20.0)) / PERIOD_S)
        if at + len(shape) > len(values):
            break
        values[at : at + len(shape)] += shape
        at += len(shape)
    return _stream(values)


def stream_of_changes(count: int, snr_db: float, rng: np.random.Generator, *, stretched: bool, stalled: bool) -> Stream:
    """So many changes, a minute apart, among confusers that do not touch them."""
    values, times = [], []
    length = 0
    for _ in range(count):
        stretch = rng.uniform(0.7, 1.5) if stretched else 1.0
        stall_s = rng.uniform(0.0, 4.0) if stalled else 0.0
        shape = changed(stretch, stall_s, rng.uniform(2.0, 6.8))
        before, after = np.ones(int(rng.uniform(25.0, 40.0) / PERIOD_S)), np.ones(250)
        if len(other := confuser(rng)) < len(before):
            before[: len(other)] += other
        times.append((length + len(before) + len(shape) / 2.0) * PERIOD_S)
        values += [before, shape, after]
        length += len(before) + len(shape) + len(after)
    whole = np.concatenate(values)
    return replace(_stream(whole + noise(len(whole), snr_db, rng)), changes_s=tuple(times))


def _stream(values: Floats) -> Stream:
    unknown = np.full(len(values), UNKNOWN)
    return Stream(PERIOD_S, 0.0, values, unknown, unknown)


def learned_from(captures: int, null_hours: float, snr_db: float, rng: np.random.Generator) -> Trained:
    """A detector from a few captures in noise, and a null stream."""
    given = stream_of_changes(captures, snr_db, rng, stretched=False, stalled=False)
    asked = TrainingSettings("spindle_current_a", before_s=9.0, after_s=9.0)
    return trained([given, null_stream(null_hours, snr_db, rng)], asked, rng)
