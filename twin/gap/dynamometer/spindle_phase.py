"""The angle of the spindle, from its speed and from the forces themselves.

A speed is stated to a percent or so, and a turn in a thousand is lost within seconds. The forces repeat with the spindle: the
order that carries most, an order being a line at so many times the spindle's frequency, is followed through the stretch, and its
phase is the spindle's,

    θ(t) = θ_stated(t) · s + arg(c(t)) / order,   c(t) = Σ over a few turns of force · exp(−i order θ_stated s)

with the s at which the orders up to three tooth passings carry most energy. Where the angle is recorded, s is 1, and its phase is
only replaced where it runs away from the forces.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from twin.gap.dynamometer.cutting import TAU

Floats = NDArray[np.float64]
Ints = NDArray[np.intp]
Complexes = NDArray[np.complex128]

OFF_MAX = 0.03
"""Part by which a stated speed may be off."""
SEGMENT_TURNS, WINDOW_TURNS = 48, 6
"""Turns over which the speed is sought, and over which a phase is taken."""
GRID_PER_TURN = 8
"""Trial speeds for each turn of a segment and order: finer than the width of a line."""
RUNS_AWAY_RAD = 0.06
"""Rms of the tooth's phase by which a recorded angle may depart from the forces."""
CLEAR = 3.0
"""Factor by which the energy of the strongest order has to exceed the median of all, for its phase to mean something."""


@dataclass(frozen=True, slots=True, eq=False)
class Followed:
    """The angle of a stretch, (n,) rad. off: part by which the speed is off; wanders_rad: rms about what was stated."""

    angle_rad: Floats
    off: float
    wanders_rad: float


def stated_angle(t_s: Floats, spindle_rpm: Floats, angle_rad: Floats | None) -> Floats:
    """The angle as far as it is told, (n,), increasing: as it was recorded, else the integral of the speed.

    >>> stated_angle(np.array([0.0, 0.01, 0.02]), np.full(3, 3000.0), None).round(6).tolist()
    [0.0, 3.141593, 6.283185]
    """
    rate = spindle_rpm * TAU / 60.0
    run = np.concatenate([[0.0], np.cumsum(0.5 * (rate[1:] + rate[:-1]) * np.diff(t_s))])
    if angle_rad is None:
        return run
    # a recorded angle may be wrapped, and turn more than once between samples: what it adds to the speed's integral is slow
    away = np.asarray(angle_rad) - run
    known = np.isfinite(away)
    unwrapped = np.interp(np.arange(len(run)), np.flatnonzero(known), np.unwrap(away[known]))
    return np.asarray(np.maximum.accumulate(run + unwrapped))


def followed(force: Floats, angle_rad: Floats, teeth: int, *, recorded: bool) -> Followed:
    """The angle of one even stretch, from the forces.

    force: (signals, n) about their means; angle_rad: (n,) as it is stated
    """
    orders = np.arange(1, 3 * teeth + 1)
    off = 0.0 if recorded else _off(force, angle_rad, orders)
    scaled = angle_rad[0] + (angle_rad - angle_rad[0]) * (1.0 + off)
    window = ((scaled - scaled[0]) / (TAU * WINDOW_TURNS)).astype(np.intp)
    windows = int(window[-1]) + 1
    amplitudes = np.stack([_by_window(force, scaled, window, windows, int(order)) for order in orders])
    energy = np.sum(np.abs(amplitudes) ** 2, axis=(1, 2))
    best = int(np.argmax(energy))
    if windows < 2 or energy[best] < CLEAR * np.median(energy):
        return Followed(scaled, off, 0.0)
    phase = _phase(amplitudes[best]) / orders[best]
    middle = np.bincount(window, weights=scaled, minlength=windows) / np.maximum(np.bincount(window, minlength=windows), 1)
    wanders = float(np.std(phase))
    if recorded and wanders * teeth < RUNS_AWAY_RAD:
        return Followed(scaled, off, wanders)
    line = np.polynomial.Polynomial.fit(middle, phase, 1)
    trend = float(line.convert().coef[1]) if windows > 2 else 0.0
    return Followed(scaled + _between(scaled, middle, phase, line), (1.0 + off) * (1.0 + trend) - 1.0, wanders)


def _between(angle_rad: Floats, middle: Floats, phase: Floats, line: np.polynomial.Polynomial) -> Floats:
    """The phase at each sample: between the windows' middles by straight lines, beyond the outer ones along the trend."""
    within = np.interp(angle_rad, middle, phase - line(middle))
    return np.asarray(within + line(angle_rad))


def _off(force: Floats, angle_rad: Floats, orders: Ints) -> float:
    """Part by which the speed is off, of the stretch as a whole."""
    turns = int((angle_rad[-1] - angle_rad[0]) / TAU)
    length = min(SEGMENT_TURNS, turns)
    segment = ((angle_rad - angle_rad[0]) / (TAU * length)).astype(np.intp)
    step = 1.0 / (GRID_PER_TURN * length * int(orders[-1]))
    count = int(OFF_MAX / step)
    tried = np.asarray(np.arange(-count, count + 1) * step, dtype=np.float64)
    energy = np.zeros(len(tried))
    for number in range(min(int(segment[-1]), 8) + 1):
        here = segment == number
        span = float(np.ptp(angle_rad[here])) if here.any() else 0.0
        if span < 0.5 * TAU * length:
            continue
        energy += _energy(force[:, here], angle_rad[here], orders, tried)
    return float(tried[int(np.argmax(energy))])


def _energy(force: Floats, angle_rad: Floats, orders: Ints, tried: Floats) -> Floats:
    """Energy of all orders at each trial of the speed, over one segment."""
    samples = len(angle_rad)
    grid = np.linspace(angle_rad[0], angle_rad[-1], samples)
    taper = np.hanning(samples)
    size = 1 << int(np.ceil(np.log2(16 * samples)))
    turns = (grid[-1] - grid[0]) / TAU * samples / (samples - 1)
    found = np.zeros(len(tried))
    for row in force:
        spectrum = np.abs(np.fft.rfft(np.interp(grid, angle_rad, row) * taper, size)) ** 2
        line = np.arange(len(spectrum)) * samples / (size * turns)
        for order in orders[orders * (1.0 + OFF_MAX) < line[-1]]:
            found += np.interp(order * (1.0 + tried), line, spectrum)
    return found


def _by_window(force: Floats, angle_rad: Floats, window: Ints, windows: int, order: int) -> Complexes:
    """Amplitude of an order in each window, (signals, windows)."""
    turned = np.exp(-1j * order * angle_rad)
    rows = []
    for row in force:
        part = row * turned
        rows.append(np.bincount(window, part.real, windows) + 1j * np.bincount(window, part.imag, windows))
    return np.asarray(np.array(rows) / np.maximum(np.bincount(window, minlength=windows), 1), dtype=np.complex128)


def _phase(amplitude: Complexes) -> Floats:
    """The phase that all signals share, over the windows, unwrapped."""
    _, _, shared = np.linalg.svd(amplitude, full_matrices=False)
    return np.asarray(np.unwrap(np.angle(shared[0])))
